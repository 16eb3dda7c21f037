"""The search for the best linkage: seeds from a coarse table, refinement in rounds, within limits or without."""
