"""Seams of a model: how smoothly patches meet along the edges that they share."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import field
from functools import cached_property

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, cross
from gtb_cli.errors import DomainError
from gtb_cli.moment.torus import block_length
from gtb_cli.theory.basis import Location
from gtb_cli.theory.curvature import curvatures_at
from gtb_cli.theory.edges import EdgeRef, edge_name
from gtb_cli.theory.model import Model
from gtb_cli.theory.normals import NormalField, on_edge
from gtb_cli.theory.parametrization import RationalBasis
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

SEAM_PLACES = 49  # along each seam, denser near its ends, which are left out: corners have normals of their own
MAX_CREASE_DEGREES = 1.0  # angle up to which curvatures across a seam are compared; beyond it the seam is a crease


@frozen
class _Rim:
    """The rim of one of two patches, at places along a seam."""

    patch: Patch
    places: Sequence[Location]
    is_flipped: bool

    def points(self) -> FloatArray:
        """(m, 3) places in space."""
        return self.patch.points_at(self.places, SEAM_PLACES)


@frozen
class Seam:
    """An edge that two patches share.

    Attributes
    ----------
    first, second : EdgeRef
    angle : float
        Largest angle between the normals of the two patches, in degrees; NaN if one patch has no normals.
    place : (3,) float
        The point with this angle.
    """

    first: EdgeRef
    second: EdgeRef
    angle: float
    place: FloatArray
    _smooth: BoolArray = field(repr=False)
    _rims: tuple[_Rim, _Rim] = field(repr=False)

    @cached_property
    def bend(self) -> float:
        """Largest difference of the normal curvatures across the seam, in units of 1 / length.

        It is taken over the places where both are finite and the angle is at most `MAX_CREASE_DEGREES`; NaN if there is
        no such place. It is computed when asked for, which takes longer than the angle.
        """
        return bends([self])[0]

    def name(self, model: Model) -> str:
        """The names of both edges, for messages."""
        return " and ".join(edge_name(model.patches, ref) for ref in (self.first, self.second))


def joints(model: Model) -> tuple[Seam, ...]:
    """Measure each joint of a model of surfaces; a model of curves has none.

    Raises
    ------
    DomainError
        The argument is not a model.

    Notes
    -----
    The angle is computed by formula, not by differences: if the tangent planes agree, it is rounding. In this case the
    normal curvatures along the seam agree as well; by Euler's theorem the normal curvatures across it then differ by
    twice the difference of the mean curvatures.
    """
    if not isinstance(model, Model):
        raise DomainError(f"joints: expected a Model, got {type(model).__name__}")
    if model.dimension == 1:
        return ()
    t = (1 - np.cos(np.pi * (np.arange(SEAM_PLACES) + 0.5) / SEAM_PLACES)) / 2
    places: dict[tuple[RationalBasis, int, bytes], list[Location]] = {}

    def rim(ref: EdgeRef, fractions: FloatArray) -> _Rim:
        patch = model.patches[ref[0]]
        key = (patch.rational_basis, ref[1], fractions.tobytes())  # patches with the same basis share the places
        if key not in places:
            places[key] = _places(patch, ref[1], fractions)
        return _Rim(patch, places[key], model.joints.flipped[ref[0]])

    pairs = [(rim(joint.first, t), rim(joint.second, joint.across(model.patches, t))) for joint in model.joints.shared]
    normals = _together([one for pair in pairs for one in pair], _normals)
    found = []
    for joint, sides in zip(model.joints.shared, pairs, strict=True):
        ours, theirs = (normals[one] for one in sides)
        sine = np.linalg.norm(cross(ours, theirs), axis=1)
        angles = np.degrees(np.arctan2(sine, (ours * theirs).sum(axis=1)))
        worst = int(np.where(np.isfinite(angles), angles, -1.0).argmax())
        smooth = angles <= MAX_CREASE_DEGREES
        found.append(Seam(joint.first, joint.second, float(angles[worst]), sides[0].points()[worst], smooth, sides))
    return tuple(found)


def bends(seams: Sequence[Seam]) -> list[float]:
    """`Seam.bend` of each seam, sooner than one by one."""
    sides = [rim for seam in seams if seam._smooth.any() for rim in seam._rims]
    mean = _together(sides, lambda patches, places: curvatures_at(patches, places, SEAM_PLACES).mean)

    def bend(seam: Seam) -> float:
        if not seam._smooth.any():
            return math.nan
        ours, theirs = (mean[rim] for rim in seam._rims)
        across = 2 * np.abs(ours - theirs)[seam._smooth]
        return float(across[np.isfinite(across)].max()) if np.isfinite(across).any() else math.nan

    return [bend(seam) for seam in seams]


def _together(
    sides: Sequence[_Rim], function: Callable[[Sequence[Patch], Sequence[Location]], FloatArray]
) -> dict[_Rim, FloatArray]:
    """Normals or mean curvatures of sides: those at the same places of one basis are computed together."""
    alike: dict[int, list[_Rim]] = {}
    for side in dict.fromkeys(sides):
        alike.setdefault(id(side.places), []).append(side)
    result: dict[_Rim, FloatArray] = {}
    for group in alike.values():
        step = max(1, block_length(len(group[0].patch.knots)) // SEAM_PLACES)
        for begin in range(0, len(group), step):
            part = group[begin : begin + step]
            found = function([side.patch for side in part], part[0].places)
            result |= {side: -values if side.is_flipped else values for side, values in zip(part, found, strict=True)}
    return result


def _normals(patches: Sequence[Patch], places: Sequence[Location]) -> FloatArray:
    """(q, m, 3) unit normals of patches with one basis."""
    fields = [NormalField(patch.domain, patch.log_products, patch.control_points) for patch in patches]
    result = np.empty((len(patches), SEAM_PLACES, 3))
    for location in places:
        result[:, location.rows] = on_edge(fields, location)
    return result


def _places(patch: Patch, edge: int, t: FloatArray) -> list[Location]:
    """Locations at fractions of an edge."""
    v = patch.domain.vertices
    faces = np.full(len(t), patch.domain.faces.edge(edge).number)
    p = v[edge] + t[:, None] * (v[(edge + 1) % len(v)] - v[edge])
    return list(patch.rational_basis.locations(p, "linear", faces))
