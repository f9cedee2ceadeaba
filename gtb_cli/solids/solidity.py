"""Faults of surfaces: where they turn back on themselves, cross themselves, or look into the solid they bound."""

from collections.abc import Callable

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, bounds_of, cross, distinct, dot, merged, point_text, unit
from gtb_cli.errors import one_of_alike
from gtb_cli.meshes.coincident import numbered_places
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import adjacent, are_proper
from gtb_cli.solids.crossings import CROSSING_DEPTH, crossing_pairs, facing_of

AS_IF = "as if"  # what follows is a probable mistake in a patch, from which other faults follow
CROSSES = "the solid passes through itself"


def folded_pairs(vertices: FloatArray, cells: IntArray) -> IntArray:
    """(k, 2) triangles, consistently oriented, between which the surface turns by more than a right angle.

    A triangle that is a line takes a neighbour's normal, so that a fold along a row of them is found as well.
    """
    normals, pairs = facing_of(vertices[cells]), adjacent(cells)[0]
    looks = np.asarray(normals.any(axis=1))
    while len(rows := pairs[looks[pairs].sum(axis=1) == 1]):
        rows = np.where(looks[rows[:, :1]], rows, rows[:, ::-1])  # from a triangle with a normal to one without
        normals[rows[:, 1]] = normals[rows[:, 0]]
        looks[rows[:, 1]] = True
    return np.asarray(pairs[dot(*normals[pairs.T]) < 0])


def folded_places(mesh: Mesh, order: Callable[[int, bool], str]) -> list[str]:
    """Say in which patches a mesh turns back on itself, and where it first does.

    Of such a patch, `order` says what is wrong with its control points, by its number and whether it is certain.
    """
    if mesh.is_curve:
        return []
    few, lines = 2, []  # sides, which may fold because a mesh is coarse
    for number, (name, start, stop) in enumerate(mesh.groups or ((mesh.name, 0, len(mesh.cells)),)):
        if len(cells := folded_pairs(mesh.vertices, mesh.cells[start:stop])[:, 0]):
            first = point_text(mesh.vertices[mesh.cells[start + cells[0]]].mean(axis=0), mesh.bounds)
            found = order(number, 10 * len(cells) > stop - start) if len(cells) > few else ""
            hint = f", {AS_IF} {found}" if found else ""
            line = f"{name} turns back on itself at {len(cells)} sides of faces, the first near {first}{hint}"
            lines.append(((len(cells), hint), line))
    return one_of_alike(lines)  # of copies, one


def crossing_remarks(mesh: Mesh) -> list[str]:
    """Say where triangles of a mesh pass through others or lie upon them, and whether all were compared."""
    crossing, is_complete = crossing_pairs(mesh.vertices, mesh.faces)
    remarks = []
    if len(crossing):
        one, other = np.moveaxis(mesh.vertices[mesh.faces[crossing]], 1, 0)
        heights = np.einsum("pcx,px->pc", other - one[:, :1], unit(cross(one[:, 1] - one[:, 0], one[:, 2] - one[:, 0])))
        passes = np.abs(heights).max() > CROSSING_DEPTH * np.ptp(mesh.bounds, axis=0).max()
        what = CROSSES if passes else f"the solid lies upon itself, to {CROSSING_DEPTH:g} of its size"
        pair = crossing[crossing[:, 0].argmin()]
        names = dict.fromkeys(name for cell in pair for name, start, stop in mesh.groups if start <= cell < stop)
        of = f", between {' and '.join(names)}" if len(names) > 1 else ""
        remarks.append(f"{what}: {where(mesh, distinct(crossing.ravel()))}{of}")
    if not is_complete:
        remarks.append("not checked: whether more distant parts of the solid meet, too many faces are near each other")
    return remarks


def where(mesh: Mesh, cells: IntArray) -> str:
    """Say how many cells there are, and where the first of them is."""
    what = "segments" if mesh.is_curve else "faces"
    first = mesh.vertices[mesh.cells[cells[0]]].mean(axis=0)
    return f"{len(cells)} of {len(mesh.cells)} {what}, the first near {point_text(first, mesh.bounds)}"


def inward_faces(mesh: Mesh) -> IntArray:
    """Faces of a closed mesh that look into the solid, or out of a hollow in it, ascending.

    The mesh is closed, consistently oriented, and does not cross itself. Its winding number is then constant on each
    side of a connected part, and must be 1 inside and 0 outside. That of other parts is the sum of their triangles'
    solid angles, by 4π (A. Van Oosterom, J. Strackee, The solid angle of a plane triangle, 1983).
    """
    first, places = numbered_places(mesh.vertices)
    cells = places[mesh.faces]
    proper = are_proper(cells)
    part = merged(len(cells), adjacent(cells)[0])
    corners = Frame.around(mesh.vertices).inside(mesh.vertices[first])[cells]
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    members = [np.flatnonzero((part == number) & proper) for number in distinct(part[proper])]
    boxes = [bounds_of(corners[rows].reshape(-1, 3)) for rows in members]
    found = np.zeros(len(cells), dtype=bool)
    for index, rows in enumerate(members):
        point = corners[rows[dot(normals[rows], normals[rows]).argmax()]].mean(axis=0)
        winding = 0
        for other, (others, (below, above)) in enumerate(zip(members, boxes, strict=True)):
            if other != index and ((below <= point) & (point <= above)).all():
                a, b, c = (corners[others] - point).transpose(1, 0, 2)
                one, two, three = (np.sqrt(dot(x, x)) for x in (a, b, c))
                cosine = one * two * three + dot(a, b) * three + dot(b, c) * one + dot(c, a) * two
                winding += round(float(np.arctan2(dot(a, cross(b, c)), cosine).sum()) / (2 * np.pi))
        found[rows] = winding != (dot(corners[rows, 0], normals[rows]).sum() < 0)  # its volume
    return np.flatnonzero(found)
