"""The refusal of `-n` with too many faces or too little memory, before it meshes (for a tolerance: `refinement`)."""

import math
import os

from gtb_cli.errors import ToleranceError


def refuse_faces(faces: int, resolution: int, max_faces: int, meshes: int = 1) -> None:
    """Raise `ToleranceError` if uniform meshes have more faces than are allowed, or than the machine's memory holds."""
    estimate = f"`resolution` {resolution} makes {faces} faces" + f" in {meshes} meshes" * (meshes > 1)
    if faces > max_faces:
        ways_out = f"take a smaller `resolution`, or allow them with `max_faces` {faces}"
        raise ToleranceError(f"{estimate}, more than {max_faces}: {ways_out}")
    needed = 100 * faces  # bytes, measured: 1.92 GB for twenty million faces of a model, 0.83 of a patch
    try:
        there = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):  # the system does not say
        there = math.inf
    if needed > there:
        memory = f"about {needed / 1e9:.0f} GB of memory, this machine has {there / 1e9:.0f}"
        raise ToleranceError(f"{estimate} and needs {memory}: take a smaller `resolution`")
