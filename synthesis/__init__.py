"""Planar linkages as pure numerics: no HTTP, no command line, no clock, no global state."""
