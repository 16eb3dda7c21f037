"""Poses, paths and mixtures of both without crank angles: the linkage and the angle at each sample are found together."""
