"""What two meshes with the same cells hold, compared: normals, texture coordinates, attributes and groups."""

import math
from collections.abc import Collection
from functools import reduce
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, cross, unit
from gtb_cli.meshes.coincident import numbered_places
from gtb_cli.meshes.correspondence import Slots, by_nearness, common_faces
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.mesh import ABSENT, FACETS, GROUPS, NORMALS, OTHER, TEXTURE, KnownMesh, Mesh, Values, are_marks
from gtb_cli.meshes.nearest import NearestCells, middles

NORMALS_TOLERANCE = 0.01  # degrees: a thousand roundings of 32-bit numbers, and less than anybody sees
VALUES_TOLERANCE = 1e-6  # of the largest value: ten roundings of 32-bit numbers; integers have none

Keys: TypeAlias = list[list[IntArray]]  # numbers of corners of both meshes, as `_numbers` returns them


def unlike_values(
    a: KnownMesh, b: KnownMesh, slots: Slots | float, left_out: Collection[str] = (), place: str = "", one: bool = False
) -> tuple[tuple[str, ...], str]:
    """Tell which values differ at corners that belong together, if any do, and where most; normals of facets are none.

    What only one of the meshes has is told if both are files of one format: others cannot hold the same. Where faces
    are others (no slots, but how far places are apart), they are compared in faces that both meshes have, and else at
    places of vertices that both have: what differs there begins with `place`. If both are `one` surface, what only one
    has is compared with the faces of the other; else half of the places of one have to be common. Also tells where
    values were compared.
    """
    doubtful = {*a.doubtful, *b.doubtful} if isinstance(slots, float) else set[str]()
    skipped = {FACETS, *left_out, *doubtful}
    here, there = ({name: held for name, held in each.values().items() if name not in skipped} for each in (a, b))
    keys, where = Keys(), "vertices in the same place"
    nowhere = f", {', '.join(sorted(doubtful))} nowhere" if doubtful else ""
    remarks = _remarks(a, b, here, there, slots, keys, place)
    if keys:
        many, is_there = int(keys[1][0].max()) + 1, np.bincount(keys[1][1]) > 0
        met, fewest = int(is_there[:many].sum()), min(many, int(is_there.sum()))
        reach = slots if one and isinstance(slots, float) else -1.0
        rest = None if reach < 0 else _beside_vertices((a.mesh, b.mesh), (here, there), keys[1], reach)
        if rest is not None:
            return remarks or (*rest,), f"vertices{nowhere}"
        where = where if met == fewest else f"{met} of {fewest} places"
        return remarks + (f"values were compared at {where}",) * (0 < 2 * met < fewest), where + nowhere
    if not remarks or isinstance(slots, float):
        return remarks, where + nowhere
    cells = numbered_places(a.mesh.vertices)[1][a.mesh.cells]  # faces that are there twice may share no vertices
    return _remarks(a, b, here, there, _paired_by_values(cells, here, there, slots), [], place), where


def _remarks(
    a: KnownMesh, b: KnownMesh, here: Values, there: Values, slots: Slots | float, keys: Keys, place: str
) -> tuple[str, ...]:
    old, new = (sorted({name for name, _, _ in each.mesh.groups}) for each in (a, b))
    remarks, on_request = [], {NORMALS: {"obj", "ply"}, TEXTURE: {"obj", "ply", "glb", "3mf"}}
    for name in sorted({*here, *there}):
        if name == GROUPS and old != new:
            if a.format == b.format:
                for which, names in (("first", {*old} - {*new}), ("second", {*new} - {*old})):
                    rest = f" and {len(names) - 5} more" if len(names) > 5 else ""
                    remarks += [f"{name}: {', '.join(sorted(names)[:5])}{rest} only in the {which}"] if names else []
        elif name in here and name in there:
            (rows, of), (others, others_of) = here[name], there[name]
            if name.startswith(OTHER):
                pairs = zip(rows[of[0, 0]], others[others_of[0, 0]], strict=False)  # doubles have a further mark
                remarks += [f"{name}: not the same"] if any(one != other for one, other in pairs) else []
                continue
            step = 1
            if isinstance(slots, float):
                keys += [] if keys else _numbers(a.mesh, b.mesh, slots)
                one, other = _met(keys, (rows, of.ravel()), (others, others_of.ravel()))
            else:
                step = a.mesh.cells.shape[1] if all((each == each[:, :1]).all() for each in (of, others_of)) else 1
                one, other = (each[::step] for each in slots)
            held, others_held = rows[of.ravel()[one]], others[others_of.ravel()[other]]
            remarks += [] if len(one) else [f"{name}: cannot be compared, as no vertices are in the same place"]
            found = _unlike(name, held, others_held, a.mesh.cells.ravel()[one], step == 1) if len(one) else []
            remarks += [f"{place}{each}" for each in found]
        elif a.format == b.format or (name in on_request and on_request[name] >= {a.format, b.format}):
            remarks.append(f"{name}: only in the {'first' if name in here else 'second'}")
    return tuple(remarks)


@np.errstate(all="ignore")  # of cells without extent
def _beside_vertices(
    meshes: tuple[Mesh, Mesh], held: tuple[Values, Values], places: list[IntArray], reach: float
) -> list[str] | None:
    """Compare values at vertices that only one mesh has with those in cells of the other; None if that takes too long.

    Cells are looked for a little inside a corner's own one, as values may leap at its sides.
    """
    told, frame = dict[str, str](), Frame.around(*(mesh.used for mesh in meshes))
    points, close = [frame.inside(mesh.vertices)[mesh.cells] for mesh in meshes], frame.length(reach, -1)
    for k, which in ((0, "first"), (1, "second")):
        corners, tree = np.flatnonzero(~np.isin(places[k], places[1 - k])), NearestCells(points[1 - k])
        if len(corners) > tree.most_points:
            return None
        own, middle = points[k].reshape(-1, 3)[corners], middles(points[k][corners // points[k].shape[1]])
        distances, cell = tree.nearest(own + 1e-3 * (middle - own)) if len(corners) else (own[:, 0], corners)
        is_within = distances <= close
        corners, own, cell = corners[is_within], own[is_within], cell[is_within]
        spans = tree.corners[cell][:, 1:] - tree.corners[cell][:, :1]
        inverse = np.linalg.pinv(spans @ spans.swapaxes(1, 2))
        weights = np.einsum("kij,kjx,kx->ki", inverse, spans, own - tree.corners[cell][:, 0])
        weights = np.column_stack([1 - weights.sum(axis=1), weights])
        error = close * np.sqrt(np.abs(inverse).max(axis=(1, 2), initial=0.0))  # of weights
        for name in sorted(held[0].keys() & held[1].keys() - told.keys()) if len(cell) else ():
            (rows, of), (others, others_of) = held[k][name], held[1 - k][name]
            if name.startswith(OTHER) or rows.shape[1] != others.shape[1]:
                continue
            here, there = rows[of.ravel()[corners]], others[others_of[cell]].astype(np.float64)
            expected = there[np.arange(len(cell)), weights.argmax(axis=1)]
            if not are_marks(name):
                expected = np.einsum("kc,kcw->kw", weights, there)
                expected = unit(expected) if name == NORMALS else expected
                allowed = _rounding(rows, others) + error[:, None] * np.ptp(there, axis=1)
                allowed += VALUES_TOLERANCE * np.abs(expected)
                expected = np.where(np.abs(expected - here) <= allowed, here, expected)
            vertex = meshes[k].cells.ravel()[corners]
            for remark in _unlike(name, here, expected, vertex, True):
                told[name] = f"{remark} of the {which}, where the other has none"
    return [*told.values()]


def _rounding(rows: FloatArray, others: FloatArray) -> float:
    """Return how far a mean of values may be off where all have few decimals."""
    if all(each.dtype.kind == "i" or _are_whole(each) for each in (rows, others)):
        return 0.5
    values = np.concatenate([rows.ravel(), others.ravel()])
    values = values[np.isfinite(values)]
    return next((0.1**k for k in (4, 5, 6, 7) if np.allclose(values.round(k), values, rtol=1e-14, atol=0)), 0.0)


@np.errstate(all="ignore")  # of huge meshes
def _numbers(a: Mesh, b: Mesh, reach: float) -> Keys:
    """Number corners of two meshes by places and directions, which other triangles of a surface keep, and by places.

    Last come the corners of common faces, in pairs.
    """
    places, directions = by_nearness(a, b, reach)[:2], list[FloatArray]()
    for mesh in (a, b):
        spans = np.diff(mesh.vertices[mesh.cells], axis=1).swapaxes(0, 1)
        directions.append(unit(spans[0] if mesh.is_curve else cross(*spans)).round(4))
    direction, most = numbered_places(np.concatenate(directions))[1], int(places[1].max()) + len(a.vertices) + 1
    number = direction.astype(np.int64)[:, None] * most
    both = [place + each for place, each in zip(places, np.split(number, [len(a.cells)]), strict=True)]
    return [[each.ravel() for each in both], [each.ravel() for each in places], [*common_faces(*places)]]


def _met(keys: Keys, *values: tuple[FloatArray, IntArray]) -> Slots:
    """Pair corners of common faces, others with the same number: each value with the nearest there; at places last."""
    from scipy.spatial import cKDTree

    *numbers, common = keys
    width = min(rows.shape[1] for rows, _ in values)
    tops = [np.abs(np.where(np.isfinite(rows), rows, 0))[:, :width].max(axis=0) for rows, _ in values]
    rest = [np.delete(np.arange(len(place)), done) for place, done in zip(keys[1], common, strict=True)]
    pairs, far = [common], 8.0 * width
    for slots in numbers:
        corners, points = list[IntArray](), list[FloatArray]()
        for key, left, (rows, of) in zip(slots, rest, values, strict=True):
            each = left[np.unique(key[left].astype(np.int64) * len(rows) + of[left], return_index=True)[1]]
            held = rows[of[each], :width] / np.maximum(np.maximum(*tops), 1e-300)
            corners.append(each)
            points.append(np.column_stack([far * key[each], np.where(np.isfinite(held), held, 2.0)]))
        for k in (0, 1):
            nearest = np.asarray(cKDTree(points[1 - k]).query(points[k], distance_upper_bound=far)[1])
            is_met = nearest < len(corners[1 - k])
            pair = [corners[k][is_met], corners[1 - k][nearest[is_met]]]
            pairs.append(pair[::-1] if k else pair)
        met = keys[1][0][np.concatenate([one for one, _ in pairs])]
        rest = [left[~np.isin(place[left], met)] for place, left in zip(keys[1], rest, strict=True)]
    one, other = zip(*pairs, strict=True)
    return np.concatenate(one), np.concatenate(other)


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


@np.errstate(all="ignore")  # of huge numbers
def _unlike(name: str, rows: FloatArray, others: FloatArray, vertex: IntArray, at_vertices: bool) -> list[str]:
    if rows.shape != others.shape:
        return [f"{name}: {rows.shape[1]} against {others.shape[1]} numbers at a corner"]
    if are_marks(name):
        moved = np.flatnonzero(~np.isclose(rows, others, rtol=0, atol=VALUES_TOLERANCE, equal_nan=True).all(axis=1))
        one, many = ("vertex has", "vertices have") if at_vertices else ("cell has", "cells have")
        count = len(np.unique(vertex[moved])) if at_vertices else len(moved)
        told = f"{count} {one if count == 1 else many} another one, first at vertex"
        return [f"{name}: {told} {vertex[moved[0]]}"] if len(moved) else []
    if name == NORMALS:
        rows, others = (each / reduce(np.hypot, each.T)[:, None] for each in (rows, others))
    gone = np.logical_xor(*((each == ABSENT) | np.isnan(each) for each in (rows, others))).any(axis=1)
    if gone.any():
        corners = f"{gone.sum()} corner{'s' * int(gone.sum() > 1)}"
        return [f"{name}: at {corners} in one of them only, first at vertex {vertex[np.argmax(gone)]}"]
    apart = np.where((rows == others) | np.isnan(rows), 0.0, np.abs(rows - others))
    if name == NORMALS:
        chords = np.linalg.norm(apart, axis=1)
        most = int(chords.argmax())
        angle = math.degrees(2 * math.asin(min(chords[most] / 2, 1.0)))
        told = f"up to {angle:.3g} degrees apart (tolerance {NORMALS_TOLERANCE:g})"
        return [f"{name}: {told}, most at vertex {vertex[most]}"] if angle > NORMALS_TOLERANCE else []
    size = np.where(np.isnan(rows), 0.0, np.maximum(np.abs(rows), np.abs(others)))
    least = 1e-15 * min(size[np.isfinite(size)].max(initial=0.0), 1e6)  # rounding beside a value that stands for itself
    columns = [size] if name.startswith(("colour", "color", "tangent")) else size.T  # which may be of several kinds
    allowed = np.broadcast_to([max(_allowed(each), least) for each in columns], size.shape[1:])
    if all(each.dtype.kind == "i" or _are_whole(each) for each in (rows, others)):
        allowed = np.zeros_like(allowed)
    beyond = apart - np.maximum(allowed, VALUES_TOLERANCE * size * (allowed > 0))
    beyond = np.where(np.isnan(beyond), np.inf, beyond)
    row, column = np.unravel_index(int(beyond.argmax()), beyond.shape)
    told = f"up to {apart[row, column]:.3g} apart (tolerance {allowed[column]:.3g})"
    return [f"{name}: {told}, most at vertex {vertex[row]}"] if beyond[row, column] > 0 else []


def _allowed(size: FloatArray) -> float:
    """Return how far values of these sizes may be apart."""
    sizes = [*np.unique(size[np.isfinite(size)])[:-5:-1], 0.0]
    far = 100  # times as large as all others, a value stands for none, as -9999 and 1e30 do
    return VALUES_TOLERANCE * next((one for one, less in pairwise(sizes) if not 0 < far * less < one), 0.0)


def _are_whole(rows: FloatArray) -> bool:
    """Tell whether numbers are whole, floats of their size hold the next ones, too, and some could be others."""
    numbers = rows[np.isfinite(rows)]
    with np.errstate(over="ignore"):
        most = 1 << (24 if (numbers.astype(np.float32) == numbers).all() else 53)
    sizes = np.abs(numbers)
    return bool(sizes.max(initial=0) < most > 2 * sizes.min(initial=most) and (numbers == np.rint(numbers)).all())
