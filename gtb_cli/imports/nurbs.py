"""B-spline and NURBS curves and surfaces as exact Bézier patches, span by span.

Knots are inserted until their multiplicity is the degree. This gives the Bézier points of a span [t_k, t_{k+1}]: the
values of its polar form at (t_k, …, t_k, t_{k+1}, …, t_{k+1}), which de Boor's algorithm finds by averages alone.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import DomainError
from gtb_cli.imports.nets import MAX_DEGREE, curve, dehomogenized, rectangle
from gtb_cli.language.reader import MAX_PATCHES
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

MAX_CONTROL_POINTS = 100_000  # largest number of control points of a curve or surface


@frozen
class Nurbs:
    """A NURBS curve or surface.

    Attributes
    ----------
    degrees : sequence of one or two int
    knots : sequence of one or two (m + degree + 1,) float
        Ascending; clamped or not.
    net : (m, 4) or (m, n, 4) float
        Homogeneous control points x w, y w, z w, w.
    """

    degrees: Sequence[int]
    knots: Sequence[FloatArray]
    net: FloatArray

    @property
    def span_count(self) -> int:
        """Number of patches of `spans`; raises the errors of knots that do not fit or do not ascend."""
        return math.prod(map(len, map(span_numbers, self.degrees, self.knots, self.net.shape)))

    def spans(self, name: str | None = None) -> list[Patch]:
        """Return the Bézier curves, one for each span, or the Bézier rectangles, one for each pair of spans.

        Parameters
        ----------
        name : str, optional
            Name of the whole; if there are several spans, their numbers follow it.

        Raises
        ------
        DomainError
            The knots do not fit or do not ascend, a weight is not positive, or there are too many spans.
        """
        total = self.span_count
        if total > MAX_PATCHES:
            raise DomainError(f"has {total} spans, a model has at most {MAX_PATCHES} patches")
        patches: list[Patch] = []
        for pieces in itertools.product(*map(span_matrices, self.degrees, self.knots, self.net.shape)):
            part = self.net[tuple(slice(first, first + len(matrix)) for first, matrix in pieces)]
            matrices = [matrix for _, matrix in pieces]
            rows = matrices[0] @ part if part.ndim == 2 else np.einsum("ai,ijk,bj->abk", matrices[0], part, matrices[1])
            points, weights = dehomogenized(rows.reshape(-1, 4))
            make, shape = (curve if rows.ndim == 2 else rectangle), rows.shape[:-1]
            label = name if total == 1 or name is None else f"{name}-{len(patches)}"
            patches.append(make(points.reshape(*shape, 3), weights.reshape(shape), label))
        return patches


def span_numbers(degree: int, knots: FloatArray, count: int) -> IntArray:
    """Return the numbers k of the spans [t_k, t_{k+1}] that are not empty; refuse knots that are not a B-spline's."""
    min_span = 1e-12  # spans shorter than this fraction of all are ignored: their knots were meant to be equal
    if not 1 <= degree <= MAX_DEGREE:
        raise DomainError(f"degree: expected 1 to {MAX_DEGREE}, got {degree}")
    if not degree < count <= MAX_CONTROL_POINTS:
        raise DomainError(f"control points: expected {degree + 1} to {MAX_CONTROL_POINTS} for degree {degree}")
    if len(knots) != count + degree + 1:
        raise DomainError(f"knots: expected {count + degree + 1}, control points plus order, got {len(knots)}")
    steps = np.diff(knots)
    if not (steps >= 0).all():
        k = int(np.argmin(steps >= 0))
        raise DomainError(f"knots: must ascend, got {knots[k]:g} before {knots[k + 1]:g}")
    low, high = knots[degree], knots[count]
    spans = degree + np.flatnonzero(steps[degree:count] > min_span * (high - low))
    if not high > low or not len(spans):
        raise DomainError("knots: all spans are empty")
    if len(spans) > MAX_PATCHES:
        raise DomainError(f"has {len(spans)} spans, a model has at most {MAX_PATCHES} patches")
    return spans


def span_matrices(degree: int, knots: FloatArray, count: int) -> list[tuple[int, FloatArray]]:
    """Find, for each span of a B-spline basis, its first control point and the matrix that gives its Bézier points.

    Parameters
    ----------
    degree : int
    knots : (count + degree + 1,) float
    count : int
        Number of control points.

    Returns
    -------
    list of (int, (degree + 1, degree + 1) float)
        Rows of a matrix are nonnegative and add up to 1: no accuracy is lost, and positive weights stay positive.
    """
    return [(k - degree, _bezier_points(degree, knots, k)) for k in span_numbers(degree, knots, count).tolist()]


def _bezier_points(degree: int, knots: FloatArray, k: int) -> FloatArray:
    """Apply de Boor's algorithm to unit control points, with degree − j times the span's start and j times its end."""
    start, end = knots[k], knots[k + 1]
    rows = []
    for j in range(degree + 1):
        table = np.eye(degree + 1)
        for step, place in enumerate([start] * (degree - j) + [end] * j, 1):
            for i in range(degree, step - 1, -1):
                low, high = knots[k - degree + i], knots[k + 1 + i - step]
                share = (place - low) / (high - low)
                table[i] = (1 - share) * table[i - 1] + share * table[i]
        rows.append(table[degree])
    return np.array(rows)
