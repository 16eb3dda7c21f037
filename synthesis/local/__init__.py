"""Refinement of one given four-bar: to the nearest optimum from just there, which may not be the best there is."""
