"""Measurements behind the figures in the docs; each writes its raw numbers to ``benchmarks/results``."""
