"""Open rings of a model: the edges around a hole, as sides with the tangent planes of the neighbouring patches."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.filling.osculation import patch_bend
from gtb_cli.filling.sides import MAX_GAP, HoleSide, bezier_form, edge_normals, points_and_tangents, stations
from gtb_cli.models.model import Model
from gtb_cli.theory.edges import EdgeRef, edge_name
from gtb_cli.theory.patch import Patch


def rings(model: Model) -> list[tuple[EdgeRef, ...]]:
    """Find the closed rings of a surface model's open edges; edges that lead nowhere are left out.

    None passes a point twice: where edges come back to one, they are a ring of their own.
    """
    joints = model.joints
    points = np.concatenate([patch.control_points for patch in model.patches])
    gap = MAX_GAP * float(np.ptp(points, axis=0).max())
    left = {ref: _ends(model, ref, joints.flipped[ref[0]]) for ref in joints.open}
    found = []
    while left:
        chain, begins, end = list[EdgeRef](), list[FloatArray](), next(iter(left.values()))[0]
        while following := [ref for ref, (begin, _) in left.items() if np.linalg.norm(begin - end) <= gap]:
            # Where several edges begin, the next edge of the same patch belongs to another hole.
            chain.append(min(following, key=lambda ref: bool(chain) and ref[0] == chain[-1][0]))
            begin, end = left.pop(chain[-1])
            begins.append(begin)
            back = [k for k, begin in enumerate(begins[:-1]) if np.linalg.norm(begin - end) <= gap]
            if back:
                found.append(tuple(chain[back[-1] :]))
                del chain[back[-1] :], begins[back[-1] :]
            if not chain:
                break
    return found


def ring_of(model: Model, edge: str | None) -> tuple[EdgeRef, ...]:
    """Return the ring that contains an edge, named such as ``wall-0 edge 2``; without a name, the only ring, if any."""
    found = rings(model)
    if not found:
        raise DomainError("hole: the model has no closed ring of open edges")
    known = "; ".join(f"{edge_name(model.patches, ring[0])} (of {len(ring)} sides)" for ring in found)
    if edge is not None:
        for ring in found:
            if edge in [edge_name(model.patches, ref) for ref in ring]:
                return ring
        raise DomainError(f"hole: no open ring has an edge {edge!r}; rings begin with: {known}")
    if len(found) > 1:
        raise DomainError(f"hole: the model has {len(found)}, `hole` names one of: {known}")
    return found[0]


def ring_sides(model: Model, ring: Sequence[EdgeRef]) -> list[HoleSide]:
    """Return the sides of a hole, in the direction that gives its patch the orientation of its neighbours.

    Raises `DomainError` if an edge is not a rational Bézier curve.
    """
    sides = []
    for patch_index, edge in ring:
        patch = model.patches[patch_index]
        name = edge_name(model.patches, (patch_index, edge))
        (curve,) = bezier_form(patch.boundary(edge), (), name)
        side = _outwards(patch, edge, HoleSide(name, curve))
        # The hole's boundary runs in the opposite direction to that of the patch.
        sides.append(side if model.joints.flipped[patch_index] else side.reversed())
    return sides


def _ends(model: Model, ref: EdgeRef, flipped: bool) -> tuple[FloatArray, FloatArray]:
    """Return the ends of an edge in the hole's direction."""
    patch, edge = model.patches[ref[0]], ref[1]
    points = patch.control_points[patch.domain.edge_knots(edge)]
    ends = points[0], points[-1]
    return ends if flipped else ends[::-1]


def _outwards(patch: Patch, edge: int, side: HoleSide) -> HoleSide:
    """Add the directions in a patch's tangent planes across an edge, out of it, and its curvature if it has normals."""
    normals = edge_normals(patch, edge, stations())
    if not np.isfinite(normals).all():
        return side
    _, tangents = points_and_tangents(side.curve, stations())
    return replace(side, across=np.cross(tangents, normals), bend=patch_bend(patch, edge, side.curve, -normals))
