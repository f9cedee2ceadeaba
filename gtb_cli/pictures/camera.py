"""The direction from which a picture is seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gtb_cli.arrays import FloatArray


@dataclass(frozen=True)
class Camera:
    """A distant eye: its angle around the z axis from x towards y, and its angle above the xy plane, in degrees.

    The factors `stretch` lengthen what it sees along the axes.
    """

    azimuth: float = -60.0
    elevation: float = 30.0
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)

    @property
    def axes(self) -> FloatArray:
        """Return (3, 3) unit vectors to the right, upwards, and towards the eye."""
        a, e = math.radians(self.azimuth), math.radians(self.elevation)
        right = [-math.sin(a), math.cos(a), 0.0]
        up = [-math.sin(e) * math.cos(a), -math.sin(e) * math.sin(a), math.cos(e)]
        return np.array([right, up, [math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)]])
