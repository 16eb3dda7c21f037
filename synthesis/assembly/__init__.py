"""Assemblies: plates and pins in layers, collisions between them, and the ends of the motion."""
