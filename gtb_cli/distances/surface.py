"""Surfaces as sets of strata, the interiors of the faces of their domains, with points all over them.

On each stratum ``P(s) = Σ_i T_i(s) b_i`` with ``T_i(s) = softmax_i(<a_i, s> + log(c_i ω_i))``, the sums over the knots
on the face, s in all of R², R¹ or R⁰.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.knots.face import INTERIOR, Face
from gtb_cli.moment.torus import scaled_exponentials
from gtb_cli.tessellation.complex import Complex
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen


class Places(NamedTuple):
    """Points given by their strata and torus coordinates.

    Attributes
    ----------
    stratum : (m,) int
    s : (m, 2) float
        Along an edge the second coordinate does not count, at a corner none does.
    """

    stratum: IntArray
    s: FloatArray


class Derivatives(NamedTuple):
    """(3, m) points, (2, 3, m) first derivatives, and (3, 3, m) second ones: by both coordinates twice, and mixed."""

    points: FloatArray
    first: FloatArray
    second: FloatArray


@frozen
class Strata:
    """Faces of one or many patches, in columns that are filled up to one number of knots.

    Attributes
    ----------
    knots : (2, n, k) float
        About their middle, in units of their extents; 0 where a face has fewer dimensions.
    log_weights : (n, k) float
        log(c_i ω_i).
    control_points : (3, n, k) float
    """

    knots: FloatArray
    log_weights: FloatArray
    control_points: FloatArray

    @staticmethod
    def of(faces: Sequence[tuple[FloatArray, FloatArray, FloatArray]]) -> Strata:
        """Fill up the (n, 0 to 2) knots, (n,) logarithms of weights and (n, 3) control points of k faces."""
        absent = -1e6  # the logarithm of a weight that is 0 beside all others
        shape = max(len(logs) for _, logs, _ in faces), len(faces)
        knots, log_weights, control_points = np.zeros((2, *shape)), np.full(shape, absent), np.zeros((3, *shape))
        for k, (a, logs, b) in enumerate(faces):
            knots[: a.shape[1], : len(a), k] = a.T
            log_weights[: len(a), k] = logs - logs.max()
            control_points[:, : len(a), k] = b.T
        return Strata(knots, log_weights, control_points)

    @staticmethod
    def joined(parts: Sequence[Strata]) -> Strata:
        """All strata of several surfaces, one surface after another."""
        return Strata.of([face for part in parts for face in part.faces])

    @property
    def faces(self) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """What `of` takes."""
        columns = (np.moveaxis(table, -1, 0) for table in (self.knots, self.log_weights, self.control_points))
        return [(a.T, logs, b.T) for a, logs, b in zip(*columns, strict=True)]

    def chosen(self, stratum: IntArray) -> Strata:
        """A column for each of (m,) points."""
        return Strata(*(table[..., stratum] for table in (self.knots, self.log_weights, self.control_points)))

    def shares(self, s: FloatArray) -> FloatArray:
        """(n, m) values T_i, one point with (2, m) coordinates in each column."""
        e = scaled_exponentials(self.knots[0] * s[0] + self.knots[1] * s[1] + self.log_weights)
        return np.asarray(e / e.sum(axis=0))

    def points(self, s: FloatArray) -> FloatArray:
        """(3, m) points, one in each column."""
        return _sums(self.control_points, self.shares(s))

    def derivatives(self, s: FloatArray) -> Derivatives:
        """Points and derivatives by s, one point in each column."""
        shares = self.shares(s)
        points = _sums(self.control_points, shares)
        about = self.control_points - points[:, None]
        x, y = (a - (shares * a).sum(axis=0) for a in self.knots)
        sx, sy = shares * x, shares * y
        first = np.stack([_sums(about, sx), _sums(about, sy)])
        second = np.stack([_sums(about, weights) for weights in (sx * x, sy * y, sx * y)])
        return Derivatives(points, first, second)


def _sums(values: FloatArray, weights: FloatArray) -> FloatArray:
    """(3, m) sums of (3, n, m) values with (n, m) weights."""
    return np.asarray(np.einsum("xnm,nm->xm", values, weights))


@frozen
class Surface:
    """The strata of a patch, a model or a curve, and points all over it.

    Attributes
    ----------
    strata : Strata
    places : Places
        Of (v,) points.
    points : (v, 3) float
        These points.
    region : (v,) int
        Parts of the domain, by number, for points inside it; -1 on edges and at corners.
    cells : (k, c) int
        Points that are near each other.
    """

    strata: Strata
    places: Places
    points: FloatArray
    region: IntArray
    cells: IntArray

    def moved(self, origin: FloatArray, exponent: int) -> Surface:
        """The surface about another origin, in units of 2^`exponent`."""
        b = np.ldexp(self.strata.control_points - origin[:, None, None], -exponent)
        strata = Strata(self.strata.knots, self.strata.log_weights, b)
        return Surface(strata, self.places, np.ldexp(self.points - origin, -exponent), self.region, self.cells)


def surface_of(patches: Sequence[Patch], mosaic: Complex, inside: Sequence[FloatArray] | None = None) -> Surface:
    """Take the vertices of a complex and the middles of its cells as the points of a surface.

    Parameters
    ----------
    patches : sequence of Patch
    mosaic : Complex
        Over the domains of these patches.
    inside : sequence of (q, d) float, optional
        Further parameters inside each patch; the knots where they are left out.
    """
    blocks = 4  # along each axis of a domain; nearest points are searched for in the nearest ones
    knots = [patch.knots[~patch.domain.incidence.any(axis=1)] for patch in patches] if inside is None else inside
    count, own = len(mosaic.patch), np.repeat(np.arange(len(patches)), [len(each) for each in knots])
    patch = np.concatenate([mosaic.patch, mosaic.cell_patch, own])
    parameters = np.concatenate([mosaic.parameters, mosaic.corners.mean(axis=1), *knots])
    face = np.full(len(patch), INTERIOR)
    face[:count] = mosaic.face
    sampler = Sampler(patches, "linear", False)
    strata: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    stratum, s, region = np.zeros(len(patch), dtype=np.int64), np.zeros((len(patch), 2)), np.full(len(patch), -1)
    sufficient = 1e-6  # accuracy of the parameters: whatever they are, the points lie on the surface
    for index, rows in groups(patch):
        low, high = patches[index].domain.vertices.min(axis=0), patches[index].domain.vertices.max(axis=0)
        block = (blocks * (parameters[rows] - low) / (high - low)).astype(np.int64).clip(0, blocks - 1)
        number = blocks * blocks * index + block @ [blocks, 1][: block.shape[1]]
        region[rows] = np.where(face[rows] == INTERIOR, number, -1)
        for location in sampler.locations(index, parameters[rows], face[rows], sufficient):
            there = rows[location.rows]
            extents = np.ptp(location.knots, axis=0)
            strata.append(_stratum(patches[index], location.face, location.knots, extents))
            stratum[there], s[there] = len(strata) - 1, 0.0
            s[there, : len(extents)] = (location.s * extents[:, None]).T
    table = Strata.of(strata)
    points = table.chosen(stratum).points(s.T).T
    middles = count + np.arange(len(mosaic.cells))
    return Surface(table, Places(stratum, s), points, region, np.column_stack([mosaic.cells, middles]))


def _stratum(
    patch: Patch, face: Face, knots: FloatArray, extents: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    unit = (knots - knots.min(axis=0)) / extents - 0.5
    return unit, patch.log_products[face.knots], patch.control_points[face.knots]
