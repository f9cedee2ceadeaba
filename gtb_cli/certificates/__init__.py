"""Bounds that hold for every point of a surface, and not for samples only."""
