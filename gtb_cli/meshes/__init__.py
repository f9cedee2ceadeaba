"""Meshes, and what is done with meshes alone: measures, distances, differences, tubes, solids. Knows no patch."""
