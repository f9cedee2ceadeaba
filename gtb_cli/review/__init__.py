"""Meshes under review: what changed between two folders of meshes, as a page to look at and as Markdown to read."""
