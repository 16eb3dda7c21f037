"""Measurements: what the software reaches, how fast, and where its limits are."""
