"""Distances between patches, models, curves and meshes, their extents, and whether two of them are the same."""
