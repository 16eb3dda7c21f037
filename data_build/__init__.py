"""The batch job that enumerates dimension types and writes the atlas file: it knows files and processes."""
