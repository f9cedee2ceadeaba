"""How fine a mesh may be: numbers that make sense, and how many faces there is room for."""

import math
import os

from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.vocabulary import PARAMETRIZATIONS, percentage


def check_fineness(resolution: int, tolerance: float | str | None, parametrization: str) -> None:
    """Raise `DomainError` for numbers that make no sense, and for a tolerance in toric parameters."""
    if isinstance(resolution, bool) or not hasattr(resolution, "__index__") or resolution < 1:
        raise DomainError(f"resolution: expected a whole number of at least 1, got {resolution!r}")
    if parametrization not in PARAMETRIZATIONS:
        raise DomainError(f"parametrization: expected toric or linear, got {parametrization!r}")
    if isinstance(tolerance, str):
        percentage(tolerance)
    elif tolerance is not None and not 0 < tolerance < math.inf:
        raise DomainError(f"tolerance: must be positive, got {tolerance!r}")
    if tolerance is not None and parametrization == "toric":
        raise DomainError("parametrization: a tolerance chooses the parameters itself: leave out toric")


def refuse_faces(faces: int, resolution: int, max_faces: int) -> None:
    """Raise `ToleranceError` if a uniform mesh has more faces than are allowed, or than the machine's memory holds."""
    estimate = f"`resolution` {resolution} makes {faces} faces"
    if faces > max_faces:
        raise ToleranceError(
            f"{estimate}, more than {max_faces}: take a smaller `resolution`, or allow them with `max_faces` {faces}"
        )
    needed = 100 * faces  # bytes, measured: 1.92 GB for twenty million faces of a model, 0.83 of a patch
    try:
        there = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):  # the system does not say
        there = math.inf
    if needed > there:
        raise ToleranceError(
            f"{estimate} and needs about {needed / 1e9:.0f} GB of memory, this machine has {there / 1e9:.0f}: "
            "take a smaller `resolution`"
        )
