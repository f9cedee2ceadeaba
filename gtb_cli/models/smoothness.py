"""Seams of a model: how smoothly patches meet along the edges that they share."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, angles_between
from gtb_cli.models.joints import Joints
from gtb_cli.moment.torus import block_length
from gtb_cli.theory.basis import Location
from gtb_cli.theory.curvature import curvatures_at
from gtb_cli.theory.edges import EdgeRef, edge_name
from gtb_cli.theory.normals import on_edge
from gtb_cli.theory.patch import Patch
from gtb_cli.theory.rational_basis import LinearParametrization
from gtb_cli.values import frozen, grouped

SEAM_PLACES = 49  # along each seam, denser near its ends, which are left out: corners have normals of their own
CORNERS = 0.02  # part of a seam at each end where curvatures are not compared: at a corner they may be infinite
MAX_CREASE_DEGREES = 1.0  # angle up to which curvatures across a seam are compared; beyond it the seam is a crease


class _SeamRim(NamedTuple):
    """The rim of one of two patches at places along a seam, with −1 as sign of a flipped patch."""

    patch: Patch
    sign: float
    place: Location


@frozen
class Seam:
    """An edge that two patches share.

    Attributes
    ----------
    first, second : EdgeRef
    angle : float
        Largest angle between the normals of the two patches, in degrees; NaN if one patch has no normals.
    """

    first: EdgeRef
    second: EdgeRef
    angle: float
    _worst: int = field(repr=False)
    _smooth: BoolArray = field(repr=False)
    _rims: tuple[_SeamRim, _SeamRim] = field(repr=False)

    @cached_property
    def place(self) -> FloatArray:
        """The point with the largest angle, (3,)."""
        return self._point(self._worst)

    @property
    def is_crease(self) -> bool:
        """True if the patches meet at more than `MAX_CREASE_DEGREES` everywhere, and are not folded onto each other."""
        return not self._smooth.any() and MAX_CREASE_DEGREES < self.angle < 180 - MAX_CREASE_DEGREES

    def _point(self, k: int) -> FloatArray:
        rim = self._rims[0]
        at = rim.place._replace(rows=slice(0, 1), s=rim.place.s[:, [k]])
        return np.asarray(rim.patch.points_at([at], 1)[0])

    @cached_property
    def bend(self) -> float:
        """Largest difference of the normal curvatures across the seam, in units of 1 / length.

        Taken over places away from corners where both are finite and the angle is at most a degree; NaN without any.
        """
        return self._most_bent[0]

    @cached_property
    def bend_place(self) -> FloatArray:
        """The point with the largest difference `bend`, (3,), or NaN."""
        bend, k = self._most_bent
        return np.full(3, math.nan) if math.isnan(bend) else self._point(k)

    @cached_property
    def _most_bent(self) -> tuple[float, int]:
        return bends([self])[0]

    def name(self, model: Iterable[Patch]) -> str:
        """Return the names of both edges, for messages."""
        patches = tuple(model)
        return " and ".join(edge_name(patches, ref) for ref in (self.first, self.second))


def seams_of(patches: Sequence[Patch], joints: Joints) -> tuple[Seam, ...]:
    """Measure how smoothly surfaces meet at each of their joints.

    The angle is computed by formula, not by differences: if the tangent planes agree, it is rounding. In this case the
    normal curvatures along the seam agree as well; by Euler's theorem the normal curvatures across it then differ by
    twice the difference of the mean curvatures.
    """
    t = (1 - np.cos(np.pi * (np.arange(SEAM_PLACES) + 0.5) / SEAM_PLACES)) / 2
    uses = [use for joint in joints.shared for use in ((joint.first, t), (joint.second, joint.across(patches, t)))]
    rims, normals = _rims(patches, joints.flipped, uses)
    angles = angles_between(normals[::2], normals[1::2])
    worst = np.where(np.isfinite(angles), angles, -1.0).argmax(axis=1)
    smooth = (angles <= MAX_CREASE_DEGREES) & (np.abs(t - 0.5) <= 0.5 - CORNERS)
    return tuple(
        Seam(joint.first, joint.second, float(angles[i, k]), k, smooth[i], (rims[2 * i], rims[2 * i + 1]))
        for i, (joint, k) in enumerate(zip(joints.shared, worst.tolist(), strict=True))
    )


def bends(seams: Sequence[Seam]) -> list[tuple[float, int]]:
    """Return `Seam.bend` of each seam, and the number of its place; rims at the same places of one basis together."""
    smooth = (rim for seam in seams if seam._smooth.any() for rim in seam._rims)
    alike = grouped(((rim.patch.rational_basis, rim.place.face, rim.place.s.tobytes()), rim) for rim in smooth)
    mean: dict[int, FloatArray] = {}
    for rims in alike.values():
        step = max(1, block_length(len(rims[0].patch.knots)) // SEAM_PLACES)
        for begin in range(0, len(rims), step):
            part = rims[begin : begin + step]
            found = curvatures_at([rim.patch for rim in part], [part[0].place], SEAM_PLACES).mean
            mean |= {id(rim): rim.sign * values for rim, values in zip(part, found, strict=True)}

    def bend(seam: Seam) -> tuple[float, int]:
        ours, theirs = (mean.get(id(rim), np.array(math.nan)) for rim in seam._rims)
        across = np.where(seam._smooth, 2 * np.abs(ours - theirs), math.nan)
        if not np.isfinite(across).any():
            return math.nan, 0
        k = int(np.where(np.isfinite(across), across, -1.0).argmax())
        return float(across[k]), k

    return [bend(seam) for seam in seams]


def _rims(
    patches: Sequence[Patch], flipped: Sequence[bool], uses: Sequence[tuple[EdgeRef, FloatArray]]
) -> tuple[dict[int, _SeamRim], FloatArray]:
    """Return rims at fractions of edges, and (q, m, 3) unit normals there; found together on one edge of a domain."""
    alike = grouped(((patches[p].domain, edge), number) for number, ((p, edge), _) in enumerate(uses))
    rims, normals = {}, np.empty((len(uses), SEAM_PLACES, 3))
    for (shape, edge), numbers in alike.items():
        face, first, last = shape.faces.edge(edge), shape.vertices[edge], shape.vertices[edge + 1 - len(shape.vertices)]
        step = max(1, block_length(len(shape.knots)) // SEAM_PLACES)
        for begin in range(0, len(numbers), step):
            some = numbers[begin : begin + step]
            indices = [uses[number][0][0] for number in some]
            part = [patches[index] for index in indices]
            t = np.concatenate([uses[number][1] for number in some])[:, None]
            linear = LinearParametrization(shape, np.array([patch.log_products for patch in part]))
            which = np.repeat(np.arange(len(part)), SEAM_PLACES)
            (whole,) = linear.locations(first + t * (last - first), np.full(len(t), face.number), numbers=which)
            s = whole.s.reshape(len(part), SEAM_PLACES)
            signs = np.array([-1.0 if flipped[index] else 1.0 for index in indices])
            normals[some] = signs[:, None, None] * on_edge(part, edge, s)
            for number, patch, sign, row in zip(some, part, signs.tolist(), s, strict=True):
                rims[number] = _SeamRim(patch, sign, Location(slice(0, SEAM_PLACES), face, whole.knots, row[None]))
    return rims, normals
