"""Families of patches on one complex: degenerations and knot limits, as meshes with the same faces."""
