"""Drives of a linkage: rotary drives, actuators, motors with a rod, knees, and springs that carry the weight."""
