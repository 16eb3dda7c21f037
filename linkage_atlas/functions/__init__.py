"""Function generation: linkages whose output is a wanted function of their input."""
