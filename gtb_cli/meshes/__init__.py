"""Meshes, and operations on them that need no patch: measures, distances, differences, tubes, solids."""
