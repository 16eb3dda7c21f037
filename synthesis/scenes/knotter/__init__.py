"""The D-knotter: a spatial mechanism whose bodies follow a single driver, and the conditions for tying a knot."""
