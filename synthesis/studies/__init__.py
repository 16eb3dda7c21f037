"""Studies of a finished linkage."""
