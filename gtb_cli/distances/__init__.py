"""Distances and areas of patches, models and meshes, and whether two of them are the same."""
