"""Names and limits that commands offer, in a room without numpy."""

MAX_FACES = 5_000_000
"""Cells of a mesh that is made without being asked for more."""

RESOLUTION = 32
"""Segments of each hull edge."""

ATTRIBUTES = ("u", "v", "gaussian_curvature", "mean_curvature")
"""Scalars for the vertices of a mesh."""
