"""Linkages of a body on two guides: cranks, rails and slots in any pair, driven by crank, slider, cylinder or hinge."""
