"""Mesh to bytes and back: what each format can hold, which axis is up, and how exact a file's numbers are."""
