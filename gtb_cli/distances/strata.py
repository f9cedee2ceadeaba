"""Surfaces as sets of strata, the interiors of the faces of their domains, with points all over them.

On each stratum ``P(s) = Σ_i T_i(s) b_i`` with ``T_i(s) = softmax_i(<a_i, s> + log(c_i ω_i))``, the sums over the knots
on the face, s in all of R², R¹ or R⁰.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.frame import Frame
from gtb_cli.moment.torus import scaled_exponentials
from gtb_cli.tessellation.complexes import Complex
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen


class StratumPlaces(NamedTuple):
    """Points given by their strata and torus coordinates."""

    stratum: IntArray  # (m,)
    s: FloatArray  # (m, 2) along an edge the second coordinate does not count, at a corner none does


@frozen
class Strata:
    """Faces of one or many patches, in columns that are filled up to one number of knots."""

    knots: FloatArray  # (2, n, k) about their middle, in units of their extents; 0 where a face has fewer dimensions
    log_weights: FloatArray  # (n, k) log(c_i ω_i)
    control_points: FloatArray  # (3, n, k)

    @staticmethod
    def joined(parts: Sequence[Strata]) -> Strata:
        """Return the strata of several parts, one part after another, filled up with knots that do not count."""
        absent = -1e6  # the logarithm of a weight that is 0 beside all others
        count = max(len(part.log_weights) for part in parts)

        def filled(table: FloatArray, value: float) -> FloatArray:
            widths = [(0, 0)] * (table.ndim - 2) + [(0, count - table.shape[-2]), (0, 0)]
            return np.pad(table, widths, constant_values=value)

        tables = [(filled(p.knots, 0.0), filled(p.log_weights, absent), filled(p.control_points, 0.0)) for p in parts]
        return Strata(*(np.concatenate(column, axis=-1) for column in zip(*tables, strict=True)))

    def chosen(self, stratum: IntArray) -> Strata:
        """Return strata with a column for each of (m,) points."""
        return Strata(*(table[..., stratum] for table in (self.knots, self.log_weights, self.control_points)))

    def shares(self, s: FloatArray) -> FloatArray:
        """Return the values T_i, (n, m), at (2, m) torus coordinates, one point in each column."""
        e = scaled_exponentials(self.knots[0] * s[0] + self.knots[1] * s[1] + self.log_weights)
        return np.asarray(e / e.sum(axis=0))

    def points(self, places: StratumPlaces) -> FloatArray:
        """Return the points at places, (m, 3)."""
        there = self.chosen(places.stratum)
        return np.asarray(np.einsum("xnm,nm->xm", there.control_points, there.shares(places.s.T))).T

    def derivatives(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return points, (3, m), first derivatives, (2, 3, m), and second derivatives, (3, 3, m): xx, yy and xy."""
        shares = self.shares(s)
        points = np.einsum("xnm,nm->xm", self.control_points, shares)
        about = self.control_points - points[:, None]
        x, y = (a - (shares * a).sum(axis=0) for a in self.knots)
        sx, sy = shares * x, shares * y
        sums = np.einsum("xnm,wnm->wxm", about, np.array([sx, sy, sx * x, sy * y, sx * y]))
        return points, sums[:2], sums[2:]


@frozen
class Surface:
    """The strata of a patch, a model or a curve, and (v,) points all over it."""

    strata: Strata
    places: StratumPlaces  # of the points
    points: FloatArray  # (v, 3)
    cells: IntArray  # (k, c) points that are near each other

    def seen_from(self, frame: Frame) -> Surface:
        """Return the surface in coordinates of a frame."""
        strata = replace(self.strata, control_points=np.ascontiguousarray(frame.inside(self.strata.control_points.T).T))
        return replace(self, strata=strata, points=frame.inside(self.points))


def surface_of(patches: Sequence[Patch], mosaic: Complex) -> Surface:
    """Take the vertices of a complex over the domains of some patches, the middles of its cells, and inner knots."""
    knots = [patch.knots[~patch.domain.incidence.any(axis=1)] for patch in patches]
    own = np.repeat(np.arange(len(patches)), [len(each) for each in knots])
    parameters = np.concatenate([mosaic.parameters, mosaic.corners.mean(axis=1), *knots])
    face = np.full(len(parameters), INTERIOR)
    face[: len(mosaic.face)] = mosaic.face
    patch = np.concatenate([mosaic.patch, mosaic.cell_patch, own])
    strata, places = _located(patches, patch, parameters, face)
    middles = len(mosaic.patch) + np.arange(len(mosaic.cells))
    return Surface(strata, places, strata.points(places), np.column_stack([mosaic.cells, middles]))


def _located(
    patches: Sequence[Patch], patch: IntArray, parameters: FloatArray, face: IntArray
) -> tuple[Strata, StratumPlaces]:
    """Solve for (m, d) parameters of some patches."""
    sufficient = 1e-6  # accuracy of the parameters: whatever they are, the points lie on the surface
    parts: list[Strata] = []
    stratum, s = np.zeros(len(patch), dtype=np.int64), np.zeros((len(patch), 2))
    for index, rows in groups(patch):
        each = patches[index]
        for location in each.rational_basis.linear.locations(parameters[rows], face[rows], sufficient):
            there, on = rows[location.rows], location.face.knots
            extents = np.ptp(location.knots, axis=0)
            knots = np.zeros((2, int(on.sum()), 1))
            knots[: len(extents)] = ((location.knots - location.knots.min(axis=0)) / extents - 0.5).T[..., None]
            logs = each.log_products[on]
            parts.append(Strata(knots, (logs - logs.max())[:, None], each.control_points[on].T[..., None]))
            stratum[there] = len(parts) - 1
            s[there, : len(extents)] = (location.s * extents[:, None]).T
    return Strata.joined(parts), StratumPlaces(stratum, s)
