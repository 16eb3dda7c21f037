"""What drives a linkage that swings: rotary drives, actuators, motors that turn on, and springs that carry the weight."""
