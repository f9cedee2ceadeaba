"""Refusal of uniform meshes that are too large, before anything is made."""

import math
import os

from gtb_cli.errors import ToleranceError


def refuse_faces(faces: int, resolution: int, max_faces: int) -> None:
    """Raise `ToleranceError` if a uniform mesh has more faces than are allowed, or than the machine's memory holds."""
    estimate = f"`resolution` {resolution} makes {faces} faces"
    if faces > max_faces:
        raise ToleranceError(
            f"{estimate}, more than {max_faces}: take a smaller `resolution`, or allow them with `max_faces` {faces}"
        )
    bytes_per_face = 100  # measured: 1.92 GB for twenty million faces of a model, 0.83 of a patch
    needed, there = faces * bytes_per_face, physical_memory()
    if needed > there:
        raise ToleranceError(
            f"{estimate} and needs about {needed / 1e9:.0f} GB of memory, this machine has {there / 1e9:.0f}: "
            "take a smaller `resolution`"
        )


def physical_memory() -> float:
    """Bytes of memory that the machine has, or infinity where the system does not say."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return math.inf
