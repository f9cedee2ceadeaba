"""Seams of a model: how smoothly patches meet along the edges that they share."""

import math
from collections.abc import Callable, Sequence
from dataclasses import field
from functools import cached_property

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, cross
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import Domain
from gtb_cli.moment.torus import block_length
from gtb_cli.theory.basis import Location
from gtb_cli.theory.curvature import curvatures_at
from gtb_cli.theory.edges import EdgeRef, edge_name
from gtb_cli.theory.joints import Joint
from gtb_cli.theory.model import Model
from gtb_cli.theory.normals import NormalField, on_edge
from gtb_cli.theory.parametrization import LinearParametrization, RationalBasis
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

SEAM_PLACES = 49  # along each seam, denser near its ends, which are left out: corners have normals of their own
MAX_CREASE_DEGREES = 1.0  # angle up to which curvatures across a seam are compared; beyond it the seam is a crease


@frozen
class _Rim:
    """The rim of one of two patches, at places along a seam."""

    patch: Patch
    edge: int
    place: Location
    is_flipped: bool


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
    _rims: tuple[_Rim, _Rim] = field(repr=False)

    @cached_property
    def place(self) -> FloatArray:
        """(3,) point with the largest angle."""
        rim = self._rims[0]
        at = rim.place._replace(rows=slice(0, 1), s=rim.place.s[:, [self._worst]])
        return np.asarray(rim.patch.points_at([at], 1)[0])

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
    shared = model.joints.shared
    rims = _rims(model, [use for joint in shared for use in _uses(model, joint, t)])
    normals = _normals(rims)
    ours, theirs = normals[::2], normals[1::2]
    sines = np.linalg.norm(cross(ours.reshape(-1, 3), theirs.reshape(-1, 3)), axis=1).reshape(ours.shape[:2])
    angles = np.degrees(np.arctan2(sines, (ours * theirs).sum(axis=2)))
    worst = np.where(np.isfinite(angles), angles, -1.0).argmax(axis=1)
    return tuple(
        Seam(joint.first, joint.second, float(row[k]), int(k), row <= MAX_CREASE_DEGREES, (one, other))
        for joint, row, k, one, other in zip(shared, angles, worst, rims[::2], rims[1::2], strict=True)
    )


def _uses(model: Model, joint: Joint, t: FloatArray) -> list[tuple[EdgeRef, FloatArray]]:
    """Return both edges of a joint with their fractions at the same points."""
    return [(joint.first, t), (joint.second, joint.across(model.patches, t))]


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
    """Mean curvatures of sides: those at the same places of one basis are computed together."""
    alike: dict[int, list[_Rim]] = {}
    for side in dict.fromkeys(sides):
        alike.setdefault(id(side.place), []).append(side)
    result: dict[_Rim, FloatArray] = {}
    for group in alike.values():
        step = max(1, block_length(len(group[0].patch.knots)) // SEAM_PLACES)
        for begin in range(0, len(group), step):
            part = group[begin : begin + step]
            found = function([side.patch for side in part], [part[0].place])
            result |= {side: -values if side.is_flipped else values for side, values in zip(part, found, strict=True)}
    return result


def _rims(model: Model, uses: Sequence[tuple[EdgeRef, FloatArray]]) -> list[_Rim]:
    """Locate the fractions of edges, all of those of one domain together; equal ones of one basis share a location."""
    keys = [(model.patches[patch].rational_basis, edge, t.tobytes()) for (patch, edge), t in uses]
    alike: dict[tuple[Domain, int], dict[tuple[RationalBasis, int, bytes], FloatArray]] = {}
    for key, (_, t) in zip(keys, uses, strict=True):
        alike.setdefault((key[0].domain, key[1]), {})[key] = t
    places: dict[tuple[RationalBasis, int, bytes], Location] = {}
    for (shape, edge), found in alike.items():
        face, t = shape.faces.edge(edge), np.concatenate(list(found.values()))[:, None]
        first, last = shape.vertices[edge], shape.vertices[(edge + 1) % len(shape.vertices)]
        linear = LinearParametrization(shape, np.array([basis.log_weights for basis, _, _ in found]))
        numbers = np.repeat(np.arange(len(found)), SEAM_PLACES)
        (whole,) = linear.locations(first + t * (last - first), np.full(len(t), face.number), numbers=numbers)
        for key, s in zip(found, np.split(whole.s, len(found), axis=1), strict=True):
            places[key] = Location(slice(0, SEAM_PLACES), face, whole.knots, s)
    flipped = model.joints.flipped
    return [
        _Rim(model.patches[patch], edge, places[key], flipped[patch])
        for ((patch, edge), _), key in zip(uses, keys, strict=True)
    ]


def _normals(rims: Sequence[_Rim]) -> FloatArray:
    """(q, m, 3) unit normals of rims, those on one edge of one domain together."""
    alike: dict[tuple[Domain, int], list[int]] = {}
    for number, rim in enumerate(rims):
        alike.setdefault((rim.patch.domain, rim.edge), []).append(number)
    result = np.empty((len(rims), SEAM_PLACES, 3))
    for (shape, edge), numbers in alike.items():
        step = max(1, block_length(len(shape.knots)) // SEAM_PLACES)
        for begin in range(0, len(numbers), step):
            some = numbers[begin : begin + step]
            part = [rims[number] for number in some]
            fields = [NormalField(shape, rim.patch.log_products, rim.patch.control_points) for rim in part]
            signs = np.array([-1.0 if rim.is_flipped else 1.0 for rim in part])[:, None, None]
            result[some] = signs * on_edge(fields, edge, np.concatenate([rim.place.s for rim in part]))
    return result
