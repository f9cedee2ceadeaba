"""Seams of a model: how smoothly patches meet along the edges that they share."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.theory.curvature import curvature_at
from gtb_cli.theory.joints import EdgeRef, edge_name
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

SEAM_PLACES = 49
"""Places along each seam, denser near its ends. The ends are left out: corners have normals of their own."""

MAX_CREASE_DEGREES = 1.0
"""Angle in degrees up to which curvatures across a seam are compared; a seam with a larger one is a crease."""


@dataclass(frozen=True, eq=False)
class Seam:
    """An edge that two patches share.

    Attributes
    ----------
    first, second : EdgeRef
    angle : float
        Largest angle between the normals of the two patches, in degrees; NaN if one patch has no normals.
    place : (3,) float
        The point with this angle.
    bend : float
        Largest difference of the normal curvatures across the seam, in units of 1 / length, over the places where both
        are finite and the angle is at most `MAX_CREASE_DEGREES`; NaN if there is no such place.
    """

    first: EdgeRef
    second: EdgeRef
    angle: float
    place: FloatArray
    bend: float

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
    flipped = model.joints.flipped
    t = (1 - np.cos(np.pi * (np.arange(SEAM_PLACES) + 0.5) / SEAM_PLACES)) / 2
    found = []
    for joint in model.joints.shared:
        (p, e), (q, f) = joint.first, joint.second
        ours = _beside(model.patches[p], e, t, flipped[p])
        theirs = _beside(model.patches[q], f, 1 - t if joint.opposite else t, flipped[q])
        sine = np.linalg.norm(np.cross(ours[1], theirs[1]), axis=1)
        angles = np.degrees(np.arctan2(sine, (ours[1] * theirs[1]).sum(axis=1)))
        known: BoolArray = np.isfinite(angles)
        worst = int(np.where(known, angles, -1.0).argmax())
        across = 2 * np.abs(ours[2] - theirs[2])[known & (angles <= MAX_CREASE_DEGREES)]
        across = across[np.isfinite(across)]
        bend = float(across.max()) if len(across) else math.nan
        found.append(Seam(joint.first, joint.second, float(angles[worst]), ours[0][worst], bend))
    return tuple(found)


def _beside(patch: Patch, edge: int, t: FloatArray, flipped: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points, normals and mean curvatures of a patch at fractions of an edge."""
    v = patch.domain.vertices
    faces = np.full(len(t), patch.domain.faces.edge(edge).number)
    p = v[edge] + t[:, None] * (v[(edge + 1) % len(v)] - v[edge])
    where = list(patch.rational_basis.locations(p, "linear", faces))
    sign = -1.0 if flipped else 1.0
    normals = sign * patch.normals_at(where, len(t))
    return patch.points_at(where, len(t)), normals, sign * curvature_at(patch, where, len(t)).mean
