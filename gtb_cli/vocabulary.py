"""Names and limits that commands offer, in a room without numpy."""

MAX_FACES = 5_000_000
"""Cells of a mesh that is made without being asked for more."""
