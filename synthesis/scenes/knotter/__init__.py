"""The D-knotter: a spatial mechanism of turns under laws of one driver, and the conditions under which the knot is tied."""
