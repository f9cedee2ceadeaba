"""An origin and a power of two as the unit, in which coordinates of any size keep their digits."""

import numpy as np

from gtb_cli.arrays import FloatArray, bounds_of
from gtb_cli.values import frozen


@frozen
class Frame:
    """An origin and a power of two as unit, in which products keep their digits and neither over- nor underflow."""

    origin: FloatArray  # (3,)
    exponent: int  # of the unit

    @staticmethod
    def around(*points: FloatArray) -> "Frame":
        """The frame about the middle of several arrays of points, all of which have coordinates from -1 to 1."""
        low, high = bounds_of(np.concatenate([bounds_of(each) for each in points]))
        return Frame(low / 2 + high / 2, int(np.frexp((high / 2 - low / 2).max())[1]))

    def inside(self, points: FloatArray) -> FloatArray:
        """(m, 3) points in coordinates of the frame."""
        return np.asarray(np.ldexp(points - self.origin, -self.exponent))

    def outside(self, points: FloatArray) -> FloatArray:
        """(m, 3) points of the frame in model units."""
        return np.asarray(self.length(points) + self.origin)

    def length(self, length: FloatArray | float, dimension: int = 1) -> FloatArray:
        """Lengths, areas or volumes in the frame as those in model units, or the other way round with dimension -1."""
        with np.errstate(over="ignore", under="ignore"):
            return np.asarray(np.ldexp(length, dimension * self.exponent))
