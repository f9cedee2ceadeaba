"""Names and limits that commands offer, in a room without numpy."""

FORMATS = ("obj", "ply", "stl", "glb")
"""Mesh formats; also the suffixes of their files."""

SPEC_FORMATS = ("toml", "json")
"""Formats of specs; also the suffixes of their files."""

ATTRIBUTES = ("u", "v", "gaussian_curvature", "mean_curvature")
"""Scalars that a mesh may have at each vertex."""

PARAMETRIZATIONS = ("toric", "linear")

TEMPLATES = ("curve", "triangle", "rectangle", "pentagon", "n-gon", "model")
"""Starter specs."""

SHELLS = ("bash", "zsh", "fish")
"""Shells that complete names and options."""

RESOLUTION = 32
"""Segments along each edge of the domain, where neither a number nor a tolerance is given."""

MAX_FACES = 5_000_000
"""Cells of a mesh that is made without being asked for more."""
