"""Mesh to bytes and back, and what each format can hold."""
