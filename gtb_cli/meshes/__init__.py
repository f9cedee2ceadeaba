"""Meshes without a patch: topology, measures, distances; what differs between two, and beyond which tolerance."""
