"""Meshes without a patch: topology, measures, distances, and what differs between two."""
