"""What two meshes with the same cells hold, compared: normals, texture coordinates, attributes and groups."""

import math
from collections.abc import Collection
from itertools import pairwise

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, cross
from gtb_cli.meshes.coincident import numbered_places
from gtb_cli.meshes.correspondence import Slots, by_nearness
from gtb_cli.meshes.mesh import ABSENT, FACETS, GROUPS, NORMALS, OTHER, KnownMesh, Mesh, Values, are_marks

NORMALS_TOLERANCE = 0.01  # degrees: a thousand roundings of 32-bit numbers, and less than anybody sees
VALUES_TOLERANCE = 1e-6  # of the largest value: ten roundings of 32-bit numbers; integers have none


def unlike_values(a: KnownMesh, b: KnownMesh, slots: Slots | float, left_out: Collection[str] = ()) -> tuple[str, ...]:
    """Tell which values differ at corners that belong together, if any do, and where most; normals of facets are none.

    What only one of the meshes has is told if both are files of one format: others cannot hold the same. Where faces
    are others (no slots, but how far places are apart at most), values are compared where both meshes have vertices.
    """
    skipped = {FACETS, *left_out}
    here, there = ({name: held for name, held in each.values().items() if name not in skipped} for each in (a, b))
    remarks = _remarks(a, b, here, there, slots)
    if not remarks or isinstance(slots, float):
        return remarks
    places = numbered_places(a.mesh.vertices)[1]  # as faces that are there twice may share no vertices
    cells = places[a.mesh.cells]
    return _remarks(a, b, here, there, _paired_by_values(cells, here, there, slots))


def _remarks(a: KnownMesh, b: KnownMesh, here: Values, there: Values, slots: Slots | float) -> tuple[str, ...]:
    old, new = (sorted({name for name, _, _ in each.mesh.groups}) for each in (a, b))
    remarks, keys = [], list[Slots]()
    for name in sorted({*here, *there}):
        if name == GROUPS and old != new:
            if a.format == b.format and (a.format != "stl" or (old and new)):  # a binary one has no solids
                lone = (("first", {*old} - {*new}), ("second", {*new} - {*old}))
                remarks += [f"{name}: {_listed(sorted(names))} only in the {which}" for which, names in lone if names]
        elif name in here and name in there:
            (rows, of), (others, others_of) = here[name], there[name]
            if name.startswith(OTHER):
                remarks += [f"{name}: not the same"] if (rows[of[0, 0]] != others[others_of[0, 0]]).any() else []
                continue
            if isinstance(slots, float):
                keys = keys or _places(a.mesh, b.mesh, slots)
                one, other = _met(keys, (rows, others), (of, others_of))
            else:
                step = a.mesh.cells.shape[1] if all((each == each[:, :1]).all() for each in (of, others_of)) else 1
                one, other = (each[::step] for each in slots)
            if len(one):
                held, vertex = (rows[of.ravel()[one]], others[others_of.ravel()[other]]), a.mesh.cells.ravel()[one]
                remarks += _unlike(name, *held, vertex, len(keys) > 0)
            else:
                remarks.append(f"{name}: cannot be compared, as no vertices are in the same place")
        elif a.format == b.format:
            remarks.append(f"{name}: only in the {'first' if name in here else 'second'}")
    return tuple(remarks)


def _places(a: Mesh, b: Mesh, reach: float) -> list[Slots]:
    """Number the corners of two meshes by places; first also by directions, which faces keep that are cut otherwise."""
    found = by_nearness(a, b, reach)[:2]
    spans = np.concatenate([np.diff(mesh.vertices[mesh.cells], axis=1) for mesh in (a, b)])
    with np.errstate(all="ignore"):
        along = spans[:, 0] if a.is_curve else cross(spans[:, 0], spans[:, 1])
        along /= np.linalg.norm(along, axis=1, keepdims=True)
    _, number = numbered_places(np.nan_to_num(along.round(4)))
    numbers = np.split(number.astype(np.int64)[:, None], [len(a.cells)])
    by_direction = [cells * (int(number.max()) + 1) + own for cells, own in zip(found, numbers, strict=True)]
    return [(each[0].ravel(), each[1].ravel()) for each in (by_direction, found)]


def _met(keys: list[Slots], values: Slots, of: Slots) -> Slots:
    """Pair corners with the same number: each value with the nearest one that the other mesh has there.

    At places where no corners of both meshes look into the same direction, all are paired.
    """
    from scipy.spatial import cKDTree

    width = max(rows.shape[1] for rows in values)
    if width > min(rows.shape[1] for rows in values):
        return np.zeros(1, np.int64), np.zeros(1, np.int64)
    far = 8.0 * width  # between places; values are within 3 of each other in each of their numbers
    tops = [np.where(np.isfinite(rows), np.abs(rows), 0).max(axis=0, initial=0) for rows in values]
    size = np.maximum(*tops) + (np.maximum(*tops) == 0)
    found = []
    for slots in keys:
        corners, points = list[IntArray](), list[FloatArray]()
        for key, rows, at in zip(slots, values, of, strict=True):
            corners.append(np.unique(key.astype(np.int64) * len(rows) + at.ravel(), return_index=True)[1])
            numbers = rows[at.ravel()[corners[-1]]] / size
            points.append(np.column_stack([far * key[corners[-1]], np.where(np.isfinite(numbers), numbers, 2.0)]))
        for k in (0, 1):
            tree = cKDTree(points[1 - k], balanced_tree=False, compact_nodes=False)
            nearest = np.asarray(tree.query(points[k], distance_upper_bound=far)[1])
            is_met = nearest < len(corners[1 - k])
            pair = corners[k][is_met], corners[1 - k][nearest[is_met]]
            found.append(pair if k == 0 else pair[::-1])
    one, other = (np.concatenate(each) for each in zip(*found, strict=True))
    start, place = sum(len(each) for each, _ in found[:2]), keys[1][0][one]
    kept = (np.arange(len(one)) < start) | ~np.isin(place, place[:start])
    return one[kept], other[kept]


def _listed(names: list[str]) -> str:
    most = 5
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + rest


def _paired_by_values(cells: IntArray, here: Values, there: Values, slots: Slots) -> Slots:
    """Pair faces in the same places that look to the same side by all that they hold, not by their order."""
    one, other = (each.reshape(cells.shape).copy() for each in slots)
    _, face = numbered_places(np.sort(cells.ravel()[one], axis=1)[:, [0, 1, -1]].astype(np.float64))
    again = np.flatnonzero(np.bincount(face)[face] > 1)
    if not len(again):
        return slots
    turn = np.argsort(cells.ravel()[one[again]], axis=1, kind="stable")
    names = [name for name in sorted({*here} & {*there}) if here[name][0].shape[1:] == there[name][0].shape[1:]]
    orders = []
    for values, slot in ((here, one), (there, other)):
        slot[again] = corners = np.take_along_axis(slot[again], turn, axis=1)
        held = [rows[of.ravel()[corners]].reshape(len(again), -1) for rows, of in (values[name] for name in names)]
        keys = np.column_stack([face[again], (corners[:, 1] - corners[:, 0]) % cells.shape[1] == 1, *held])
        orders.append(again[np.lexsort(keys.T[::-1])])
    other[orders[0]] = other[orders[1]]
    return one.ravel(), other.ravel()


def _unlike(name: str, rows: FloatArray, others: FloatArray, vertex: IntArray, at_places: bool) -> list[str]:
    if rows.shape != others.shape:
        return [f"{name}: {rows.shape[1]} against {others.shape[1]} numbers at a corner"]
    if are_marks(name):
        moved = np.flatnonzero(~np.isclose(rows, others, rtol=0, atol=VALUES_TOLERANCE, equal_nan=True).all(axis=1))
        one, many = ("vertex has", "vertices have") if at_places else ("cell has", "cells have")
        count = len(np.unique(vertex[moved])) if at_places else len(moved)
        told = f"{count} {one if count == 1 else many} another one, first at vertex"
        return [f"{name}: {told} {vertex[moved[0]]}"] if len(moved) else []
    if name == NORMALS:
        with np.errstate(invalid="ignore", divide="ignore"):
            rows, others = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (rows, others))
    gone = np.logical_xor(*((each == ABSENT) | np.isnan(each) for each in (rows, others))).any(axis=1)
    if gone.any():
        return [f"{name}: at {gone.sum()} corners in one of them only, first at vertex {vertex[np.argmax(gone)]}"]
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.where((rows == others) | np.isnan(rows), 0.0, np.abs(rows - others))
    if name == NORMALS:
        chords = np.linalg.norm(apart, axis=1)
        most = int(chords.argmax())
        angle = math.degrees(2 * math.asin(min(chords[most] / 2, 1.0)))
        told = f"up to {angle:.3g} degrees apart (tolerance {NORMALS_TOLERANCE:g})"
        return [f"{name}: {told}, most at vertex {vertex[most]}"] if angle > NORMALS_TOLERANCE else []
    size = np.where(np.isnan(rows), 0.0, np.maximum(np.abs(rows), np.abs(others)))
    sizes = [*np.unique(size[np.isfinite(size)])[:-5:-1], 0.0]
    far = 100  # times as large as all others, a value stands for none, as -9999 and 1e30 do
    allowed = VALUES_TOLERANCE * next((one for one, less in pairwise(sizes) if not 0 < far * less < one), 0.0)
    allowed = max(allowed, 1e-15 * min(sizes[0], 1e6))  # rounding beside a value that stands for itself
    if rows.dtype.kind == others.dtype.kind == "i":
        allowed = 0.0
    with np.errstate(invalid="ignore"):
        beyond = apart - np.maximum(allowed, VALUES_TOLERANCE * size * (allowed > 0))
    beyond = np.where(np.isnan(beyond), np.inf, beyond).max(axis=1)
    most = int(beyond.argmax())
    told = f"up to {apart[most].max():.3g} apart (tolerance {allowed:.3g})"
    return [f"{name}: {told}, most at vertex {vertex[most]}"] if beyond[most] > 0 else []
