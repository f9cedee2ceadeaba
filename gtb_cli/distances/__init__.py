"""Distances between patches, models, curves and meshes, and whether two of them are the same."""
