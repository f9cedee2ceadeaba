"""Properties of a model: its joints, open edges and orientation."""

import math
from dataclasses import replace

import numpy as np

from gtb_cli.arrays import FloatArray, point_text
from gtb_cli.checks.report import Finding, at_most, not_applicable, number
from gtb_cli.models.model import Model
from gtb_cli.models.same_edges import FAR_ROUNDING
from gtb_cli.models.smoothness import bends
from gtb_cli.theory.edges import CURVE_TOLERANCE, edge_points_at
from gtb_cli.theory.patch import Patch


def joint_findings(model: Model) -> tuple[Finding, ...]:
    """Check that joined edges are one curve, and count what a closed body would not have."""
    points = np.concatenate([patch.control_points for patch in model])
    shared, size = model.joints, float(np.ptp(points, axis=0).max()) or 1.0
    what = "edges" if model.dimension == 2 else "ends"
    gap = max((distance for _, _, distance in shared.almost), default=0.0)
    found = {"joined edges": _joined(model, size)}
    welded = [joint.distance for joint in shared.shared if joint.distance]
    if welded:
        reason = f"largest distance of the {len(welded)} edges that were welded, of the model's size"
        found["welded edges"] = number(max(welded) / size, reason)
    near = f"the {len(shared.almost)} pairs of edges that nearly coincide"
    found |= {
        "open edges": number(len(shared.open), f"number of {what} with no neighbour"),
        "crowded edges": number(len(shared.crowded), f"number of curves that more than two {what} share"),
        "orientation": number(len(shared.one_sided), "number of joints at which orientations cannot agree"),
        "almost joined edges": number(gap / size, f"largest gap of {near}, of the model's size"),
    }
    seams = [seam for seam in model.seams if math.isfinite(seam.angle)]
    if seams:
        worst = max(seams, key=lambda seam: seam.angle)
        where = f"where {worst.name(model)} meet, near {point_text(worst.place, points)}"
        reason = f"degrees, the largest angle between normals, {where}"
        found["angle of joints"] = number(worst.angle, reason)
    bent = [(bend, seam) for seam, (bend, _) in zip(seams, bends(seams), strict=True) if math.isfinite(bend)]
    if bent:
        bend, most = max(bent, key=lambda pair: pair[0])
        where = f"where {most.name(model)} meet, near {point_text(most.bend_place, points)}"
        reason = f"1/length, the largest difference of normal curvatures across, away from corners, {where}"
        found["curvature across joints"] = number(bend, reason)
    # By this theorem an edge is the curve of its own knots.
    return tuple(replace(finding, name=name, reference="Thm 4.0") for name, finding in found.items())


def _joined(model: Model, size: float) -> Finding:
    tolerance = 8 * CURVE_TOLERANCE  # to which control points, knots and weights of joined edges may differ
    shared = [joint for joint in model.joints.shared if not joint.distance]
    if not shared:
        return not_applicable("no two edges carry the same curve")
    worst, even = 0.0, np.linspace(0.0, 1.0, 33)
    for joint in shared:
        first = _points(model.patches[joint.first[0]], joint.first[1], even)
        second = _points(model.patches[joint.second[0]], joint.second[1], joint.across(model.patches, even))
        worst = max(worst, float(np.sqrt(((first - second) ** 2).sum(axis=1)).max()))
    reason = f"largest distance at {len(shared)} joints, of the model's size"
    farthest = max(float(np.abs(patch.control_points).max()) for patch in model)
    return at_most(worst / size, tolerance + FAR_ROUNDING * farthest / size, reason)


def _points(patch: Patch, edge: int, fractions: FloatArray) -> FloatArray:
    """Return (m, 3) points at fractions of an edge; for a curve, the single point of its end."""
    if patch.dimension == 1:
        return patch.evaluate(patch.domain.vertices[[edge]])
    return edge_points_at(patch, edge, fractions)
