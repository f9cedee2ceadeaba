"""Mesh to bytes and back: what each format can hold, which axis is up, where digits are lost."""
