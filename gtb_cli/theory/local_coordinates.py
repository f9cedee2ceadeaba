"""Coordinates of the knots about the one with the largest T, in which no digits of derivatives are lost.

They are 0 at this knot, and 1 in turn at the next d knots with most of T, so that terms ``w_i x^ξ_i y^η_i`` of the
basis have no second derivatives in x or y at these knots. Towards an edge or a corner only the layers of knots whose T
vanishes last are left in a derivative: its limit is a sum over them.
"""

from collections.abc import Iterator
from itertools import combinations_with_replacement, starmap
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, groups
from gtb_cli.knots.about_a_knot import Differences, cleared
from gtb_cli.knots.domain import LAYER_TOLERANCE, Domain
from gtb_cli.knots.face import Face
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.moment.torus import UNDERFLOW_EXPONENT, block_length, exponents
from gtb_cli.theory.basis import Location
from gtb_cli.values import frozen


class Terms(NamedTuple):
    """Terms of T up to a factor for each column, (n, m), and their derivatives: d first, and second, xx, xy and yy."""

    point: FloatArray
    first: tuple[FloatArray, ...]
    second: tuple[FloatArray, ...]


@frozen
class FaceLayers:
    """The knots, (n,) bool, that count in each sum on a face, and the knots that prevent a limit there.

    Inside Δ all knots count in all sums. A limit on an edge is a sum over the knots with one value of η, a limit at a
    corner is one over the knots with one value of ξ and of η. Knots in the tangent plane prevent no limit.
    """

    point: BoolArray
    first: tuple[BoolArray, ...]
    second: tuple[BoolArray, ...]
    slow: BoolArray  # knots that leave first derivatives at a corner without a limit
    against: tuple[tuple[int, BoolArray], ...]  # knots that leave second derivatives across a facet without a limit


def face_layers(shape: Domain, face: Face) -> FaceLayers:
    """Return the layers of knots at a face of Δ; at a corner, ξ runs along the edge that starts there."""
    every, d = np.ones(len(shape.knots), dtype=bool), shape.dimension
    known: dict[int, tuple[int, FloatArray]] = {}  # facets on which a coordinate is 0, with levels over them
    if face.is_corner and d == 2:
        before, after = (face.index - 1) % len(shape.vertices), face.index
        known[0] = before, _levels(shape, before, shape.incidence[:, after])
        known[1] = after, _levels(shape, after, shape.incidence[:, before])
    elif not face.is_interior:
        known[d - 1] = face.index, _levels(shape, face.index)

    def members(*axes: int) -> BoolArray:
        """Mark the knots that count in the derivative along some axes."""
        return np.asarray(np.all([every, *(level == axes.count(k) for k, (_, level) in known.items())], axis=0))

    second = starmap(members, combinations_with_replacement(range(d), 2))
    slow = np.any([~every, *((level > 0) & (level < 1) for _, level in known.values())], axis=0)
    against = tuple((facet, (level > 1) & (level < 2)) for facet, level in known.values())
    return FaceLayers(members(), tuple(map(members, range(d))), tuple(second), slow, against)


def _levels(shape: Domain, edge: int, among: BoolArray | None = None) -> FloatArray:
    """Return heights over the lowest positive one (among some knots), (n,), 1 and 2 where they are to rounding."""
    heights = shape.heights[:, edge]
    lowest = heights[(heights > 0) & (True if among is None else among)].min()
    level = heights / lowest
    rounding = LAYER_TOLERANCE * heights.max() + 3 * knot_tolerance(shape.knots) * shape.normal_lengths[edge]
    for whole in (1, 2):
        level[np.abs(level - whole) * lowest <= rounding] = whole
    return np.asarray(level)


class Local(NamedTuple):
    """Coordinates of the n knots about knot k, at m places."""

    k: int
    axes: tuple[FloatArray, ...]  # d coordinates, (n, m)
    pivots: tuple[IntArray, ...]  # (m,) the knot at which each coordinate is 1
    turn: FloatArray  # (m,) 1 where the three knots of a surface are counter-clockwise, else −1

    def terms(self, e: FloatArray, layers: FaceLayers) -> Terms:
        """Return terms at (n, m) logarithms of T relative to knot k, so scaled that the pivots' terms have slope 1."""
        logs = [e[pivot, np.arange(e.shape[1])] for pivot in self.pivots]
        pairs = combinations_with_replacement(range(len(self.axes)), 2)
        first = tuple(map(_weighted, [e] * len(self.axes), layers.first, logs, self.axes))
        second = [
            _weighted(e, members, logs[a] + logs[b], self.axes[a] * (self.axes[b] - (a == b)))
            for members, (a, b) in zip(layers.second, pairs, strict=True)
        ]
        return Terms(_weighted(e, layers.point, 0.0, 1.0), first, tuple(second))


def neighbourhoods(
    shape: Domain, log_weights: FloatArray, location: Location, work_arrays: int
) -> Iterator[tuple[IntArray, Local, FloatArray, FaceLayers]]:
    """Yield columns of a location led by one knot, with coordinates about it, (n, m) logarithms of T, and layers."""
    face, n = location.face, len(shape.knots)
    layers = face_layers(shape, face)
    knots = location.knots
    if not face.is_interior:
        knots = np.zeros((n, 0)) if face.is_corner else shape.along(face.index, shape.knots)[:, None]
    step = max(64, block_length(n) // work_arrays)
    for begin in range(0, location.s.shape[1], step):
        e = exponents(knots, log_weights, location.s[:, begin : begin + step])
        for k, here in groups(np.where(layers.point[:, None], e, -np.inf).argmax(axis=0)):
            about = e[:, here] - e[k, here]
            yield begin + here, local_coordinates(shape, k, about, layers), about, layers


def local_coordinates(shape: Domain, k: int, e: FloatArray, layers: FaceLayers) -> Local:
    """Return coordinates about the knot k with the largest T, for (n, m) logarithms of T."""
    # The other knots are chosen like pivots, so that the triangle has neither little weight nor a small angle.
    columns = np.arange(e.shape[1])
    if shape.dimension == 1:
        steps = cleared(shape.knots - shape.knots[k], knot_tolerance(shape.knots))
        one = _pivot(e, steps, layers.first[0])
        return Local(k, (steps / steps[one, 0],), (one,), np.ones(len(columns)))
    about = Differences(shape, k)
    one = _pivot(e, about.lengths[:, None], layers.first[0])
    eta = about.across(one)
    other = _pivot(e, eta, layers.first[1])
    xi, turn = about.across(other), np.sign(eta[other, columns])
    return Local(k, (xi / xi[one, columns], eta / eta[other, columns]), (one, other), turn)


def _pivot(e: FloatArray, extents: FloatArray, members: BoolArray) -> IntArray:
    with np.errstate(divide="ignore"):
        return np.asarray(np.where(members[:, None], e + 2 * np.log(np.abs(extents)), -np.inf).argmax(axis=0))


def _weighted(e: FloatArray, members: BoolArray, shift: FloatArray | float, factor: FloatArray | float) -> FloatArray:
    """Return factor · T up to exp(shift) for members, 0 for others, (n, m); exact zeros are kept."""
    x = np.exp(np.clip(e - shift, UNDERFLOW_EXPONENT, -UNDERFLOW_EXPONENT)) * factor
    x[~members] = 0.0
    return np.asarray(x)
