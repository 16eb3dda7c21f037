"""The pneumatic lift: pose in closed form, motion without integration, optimum design."""
