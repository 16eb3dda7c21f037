"""From lines to parts: plates and pins in layers, whether they pass one another, and where the motion stops."""
