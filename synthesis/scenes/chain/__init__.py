"""The chain on a U-shaped slide: track, closure, the slot that takes the slack, its files."""
