"""Holes: closed rings of open edges, and those of a model as sides with the tangent planes of its patches."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, point_text
from gtb_cli.errors import DomainError
from gtb_cli.filling.osculation import patch_bend
from gtb_cli.filling.sides import MAX_GAP, HoleSide, bezier_form, edge_normals, points_and_tangents, stations
from gtb_cli.language.keys_and_values import suggestion
from gtb_cli.models.model import Model
from gtb_cli.theory.edges import EdgeRef, edge_name


class Ring(NamedTuple):
    """The edges around a hole: their numbers, their names, and (m, 3) points, where they begin and others."""

    edges: tuple[int, ...]
    names: tuple[str, ...]
    corners: FloatArray


def closed_rings(rows: Sequence[FloatArray], names: Sequence[str], gap: float) -> list[Ring]:
    """Find the closed rings of edges, each within a gap of the next; others lead nowhere.

    Edges are rows of points. No ring passes a point twice, and an edge with points between its ends may be one alone.
    """
    left, found, owners = dict(enumerate(rows)), [], [name.rpartition(" edge ")[0] for name in names]
    while left:
        chain, end = list[int](), next(iter(left.values()))[0]
        while following := [edge for edge, row in left.items() if np.linalg.norm(row[0] - end) <= gap]:
            # Where several edges begin, the next edge of the same patch or face belongs to another hole.
            last = owners[chain[-1]] if chain else ""
            chain.append(min(following, key=lambda edge: bool(chain) and owners[edge] == last))
            end = left.pop(chain[-1])[-1]
            least = 1 if len(rows[chain[-1]]) > 2 else 2
            if back := [k for k in range(len(chain) - least + 1) if np.linalg.norm(rows[chain[k]][0] - end) <= gap]:
                edges = tuple(chain[back[-1] :])
                corners = np.concatenate([rows[edge][:-1] for edge in edges])
                found.append(Ring(edges, tuple(names[edge] for edge in edges), corners))
                del chain[back[-1] :]
            if not chain:
                break
    return found


def one_ring(found: Sequence[Ring], asked: str | None, where: str) -> Ring:
    """Return the ring that is asked for by an edge, a patch or face, or a point near it; or else the only ring.

    An edge is named such as ``wall-0 edge 2``, a point ``10, 0, 2.5``. Raises `DomainError` if there is not one.
    """
    if not found:
        raise DomainError(f"hole: the {where} has no closed ring of open edges")
    known = "; ".join(ring_texts(found))
    fitting = [ring for ring in found if asked is None or asked in ring.names]
    fitting = fitting or [ring for ring in found if asked in [name.rpartition(" edge ")[0] for name in ring.names]]
    if not fitting and asked is not None:
        point = np.empty(0)
        with suppress(ValueError):
            point = np.array([float(word) for word in asked.split(",")])
        if point.shape != (3,) or not np.isfinite(point).all():
            raise DomainError(f"hole: no open ring has an edge {asked!r}, and it is not a point; rings: {known}")
        fitting = [min(found, key=lambda ring: float(np.linalg.norm(ring.corners.mean(axis=0) - point)))]
    if len(fitting) > 1:
        raise DomainError(f"hole: the {where} has {len(fitting)}, `hole` names one of: {known}")
    return fitting[0]


def ring_texts(found: Sequence[Ring]) -> list[str]:
    """Describe rings: the first edge, the number of sides, and where they are."""
    places = [point_text(ring.corners.mean(axis=0), ring.corners) for ring in found]
    return [f"{ring.names[0]} (of {len(ring.edges)} edges, near {at})" for ring, at in zip(found, places, strict=True)]


def model_rings(model: Model) -> list[Ring]:
    """Find the closed rings of a surface model's open edges; the numbers are places in ``model.joints.open``."""
    joints = model.joints
    points = np.concatenate([patch.control_points for patch in model.patches])
    ends = []
    for index, edge in joints.open:
        knots = model.patches[index].domain.edge_knots(edge)[[0, -1]]
        ends.append(model.patches[index].control_points[knots if joints.flipped[index] else knots[::-1]])
    names = [edge_name(model.patches, ref) for ref in joints.open]
    return closed_rings(ends, names, max(MAX_GAP * float(np.ptp(points, axis=0).max()), model.weld or 0.0))


def hole_edges(model: Model, asked: str | None, own: float = math.inf) -> list[EdgeRef]:
    """Return the edges of a hole, or say in a `DomainError` why a name is none; patches from `own` on fill holes."""
    edges, rings = [edge_name(model.patches, ref) for ref in model.joints.open], model_rings(model)
    owners = {name.rpartition(" edge ")[0] for name in edges}
    if asked is None or asked in edges or asked in owners or asked.count(",") == 2:  # a point
        return [model.joints.open[edge] for edge in one_ring(rings, asked, "model").edges]
    known = owners | {name for name in edges if name.rpartition(" ")[2] == asked.rpartition(" ")[2]}
    why, meant = "no open edge has this name", suggestion(asked, known)
    for pair in ([joint.first, joint.second] for joint in model.joints.shared):
        if asked in (names := [edge_name(model.patches, ref) for ref in pair]):
            other = asked == names[0]
            how = "its hole is filled already, and it is" if pair[other][0] >= own else "it is not open, but"
            why, meant = f"{how} joined with {names[other]}", ""
    raise DomainError(f"hole: {why}; holes: {'; '.join(ring_texts(rings)) or 'none'}{meant}")


def ring_sides(model: Model, refs: Sequence[EdgeRef]) -> list[HoleSide]:
    """Return the sides of a hole with these edges, in the direction that gives its patch its neighbours' orientation.

    They have their patches' tangent planes and curvatures, if these have normals all along them. Raises `DomainError`
    if an edge is not a rational Bézier curve.
    """
    sides = []
    for patch_index, edge in refs:
        patch = model.patches[patch_index]
        name = edge_name(model.patches, (patch_index, edge))
        (curve,) = bezier_form(patch.boundary(edge), (), name)
        side, normals = HoleSide(name, curve), edge_normals(patch, edge, stations())
        if np.isfinite(normals).all():
            points, tangents = points_and_tangents(curve, stations())
            far = 30 * EPS * float(np.abs(points).max() / np.ptp(points, axis=0).max())  # what normals are off there
            bend = patch_bend(patch, edge, curve, -normals)
            side = HoleSide(name, curve, np.cross(tangents, normals), bend, rounding=max(side.rounding, far))
        # The hole's boundary runs in the opposite direction to that of the patch.
        sides.append(side if model.joints.flipped[patch_index] else side.reversed())
    return [replace(side, weld=model.weld or 0.0) for side in sides]
