"""Readers of mesh files that are not ours: which of them read which of our files."""
