"""Drives of a linkage: rotary drives, actuators, motors with a rod, and springs that carry the weight."""
