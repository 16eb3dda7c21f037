"""A body on a crank that a rail or a slot guides: how it turns, its types, and coordinates of its shapes for a search."""
