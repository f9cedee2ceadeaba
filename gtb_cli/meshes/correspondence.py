"""Which vertices and faces of two meshes belong together, and what differs where all are in the same place."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import TypeAlias

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, cross, dot, index_type, paired, taken
from gtb_cli.meshes.coincident import numbered_places
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.measures import measure
from gtb_cli.meshes.mesh import KnownMesh, Mesh
from gtb_cli.meshes.nearest import NearestCells, middles
from gtb_cli.meshes.topology import are_proper, are_used, component_count, components_of, sides_of

Slots: TypeAlias = tuple[IntArray, IntArray]


@dataclass(frozen=True)
class Matching:
    """Vertices (m,) of two meshes with the same cells that belong together, and (m,) their distances."""

    vertices: IntArray
    others: IntArray
    distances: FloatArray
    turned: int  # faces that are turned over
    remarks: tuple[str, ...]  # how else the cells differ: in the vertices that they share
    slots: Slots  # corners, counted through all cells, that belong together
    cells: tuple[IntArray, IntArray]  # of both meshes, in common numbers

    @property
    def turned_in_mirror(self) -> int:
        """How many faces are turned over in a mirror image."""
        return _faces(*self.cells).turned(-1)


def matching(a: KnownMesh, b: KnownMesh, tolerance: float) -> Matching | None:
    """Match vertices so that all cells are the same, in any order, and vertices within the tolerance if that can be.

    Vertices are matched by their numbers; by the order in which cells use their places, as in STL files, where the
    places may also be those in 32-bit numbers; or by nearness. The first of these ways that leaves none farther apart
    than the tolerance is taken, without turned faces if there is one; otherwise the first that finds the same cells,
    whatever the distances, but by their order only where it is likely.
    """
    if a.mesh.cells.shape != b.mesh.cells.shape:
        return None
    first = turned = None
    are_short = not {a.format, b.format} <= {"obj", "spec"}  # numbers of 32 bits
    for cells, other_cells, is_certain in _numberings(a.mesh, b.mesh, tolerance, are_short):
        is_own = cells is a.mesh.cells  # which an STL file has not
        found = _matched(a, b, cells, other_cells) if a.has_indices == b.has_indices or not is_own else None
        if found is None:
            continue
        if found.distances.max() <= tolerance:
            if not found.turned:
                return found
            turned = turned or found  # faces that are there twice may look to both sides
            continue
        is_named = is_own and a.has_indices
        if is_certain and first is None and (is_named or _is_likely(a.mesh, b.mesh, found, tolerance)):
            first = found
        here, there = (np.sort(each.mesh.used, axis=0) for each in (a, b))
        if is_certain and len(here) == len(there) and np.abs(here - there).max() > tolerance:
            break  # no vertices can be near all their own ones
    return turned or first


def _is_likely(a: Mesh, b: Mesh, found: Matching, tolerance: float) -> bool:
    """Tell whether cells that are used in the same order may be the same."""
    # Where equal parts stand in another order, many vertices are far from their own ones, and few places are new.
    count = len(found.vertices)
    _, label = numbered_places(np.concatenate([a.vertices[found.vertices], b.vertices[found.others]]))
    return bool((found.distances > tolerance).sum() <= 2 * (~np.isin(label[:count], label[count:])).sum())


def _numberings(a: Mesh, b: Mesh, tolerance: float, are_short: bool) -> Iterator[tuple[IntArray, IntArray, bool]]:
    """Yield the cells of both meshes in common numbers of places, and whether distance is no reason for doubt."""
    if len(a.vertices) == len(b.vertices):
        yield a.cells, b.cells, True
    own = _places(a), _places(b)
    if np.array_equal(own[0][1], own[1][1]):
        yield own[0][1], own[1][1], True
    with np.errstate(over="ignore", under="ignore"):
        are_short &= any((mesh.vertices.astype(np.float32) != mesh.vertices).any() for mesh in (a, b))
        if are_short:  # 32-bit numbers of one file may coincide, those of the other not
            (_, cells), (_, others) = (_places(mesh, np.float32) for mesh in (a, b))
        if are_short and np.array_equal(cells, others):
            yield cells, others, False
    cells, others, are_all = by_nearness(a, b, tolerance, own)
    if are_all:
        yield cells, others, False


def _places(mesh: Mesh, kind: type = np.float64) -> tuple[IntArray, IntArray]:
    """The index of one vertex at each place in use, in the order of cells, and the cells as numbers of these places."""
    _, place = numbered_places(mesh.vertices.astype(kind, copy=False))
    corners, cells = mesh.cells.ravel(), taken(place, mesh.cells)
    first = np.full(int(place.max(initial=-1)) + 1, len(corners))
    np.minimum.at(first, cells.ravel(), np.arange(len(corners)))
    used = np.argsort(first)[: np.count_nonzero(first < len(corners))]
    labels = np.empty(len(first), dtype=place.dtype)
    labels[used] = np.arange(len(used))
    return corners[first[used]], taken(labels, cells)


def by_nearness(
    a: Mesh, b: Mesh, tolerance: float, own: Sequence[tuple[IntArray, IntArray]] = ()
) -> tuple[IntArray, IntArray, bool]:
    """Cells in numbers of places of `a`, and further ones for places of `b`; whether there are no further.

    These are those that are near none within the tolerance, or beside which another place is nearer to the same one.
    """
    from scipy.spatial import cKDTree

    (first, cells), (second, others) = own or (_places(a), _places(b))
    frame = Frame.around(a.vertices[first])
    points, targets = frame.inside(a.vertices[first]), frame.inside(b.vertices[second])
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    apart, place = map(np.asarray, tree.query(targets, distance_upper_bound=float(frame.length(tolerance, -1))))
    order = np.lexsort((apart, place))
    order = order[(np.diff(place[order], prepend=-1) != 0) & (place[order] < len(first))]
    numbers = np.arange(len(first), len(first) + len(place), dtype=index_type(len(first) + len(place)))
    numbers[order] = place[order]
    return cells, taken(numbers, others), len(order) == len(first) == len(second)


@dataclass(frozen=True)
class _Faces:
    """Faces of two meshes in common numbers."""

    numbers: Slots  # (k,)
    sides: Slots  # (k,) to which they look, 1 or −1; 0 if nowhere
    here: IntArray  # (f,) how often each occurs
    there: IntArray

    def turned(self, usual: int = 1) -> int:
        """How many of the faces that both have equally often are turned over; −1 says that the usual ones are."""
        one, other = (np.bincount(*each, len(self.here)) for each in zip(self.numbers, self.sides, strict=True))
        return int(np.abs(one - usual * other)[self.here == self.there].sum()) // 2


def _faces(cells: IntArray, others: IntArray) -> _Faces:
    count, rows = len(cells), np.concatenate([cells, others])
    low, high = reduce(np.minimum, rows.T), reduce(np.maximum, rows.T)
    _, labels = numbered_places(np.stack([low, reduce(np.bitwise_xor, rows.T) ^ low ^ high, high], axis=1))
    side = np.zeros(len(rows), dtype=np.int8)  # segments, and faces with a corner twice, look nowhere
    if rows.shape[1] == 3:
        a, b, c = rows.T
        side = np.where((a < b) ^ (b < c) ^ (c < a), np.int8(-1), np.int8(1)) * are_proper(rows)
    numbers = labels[:count], labels[count:]
    here, there = (np.bincount(part, minlength=int(labels.max()) + 1) for part in numbers)
    return _Faces(numbers, (side[:count], side[count:]), here, there)


def common_faces(cells: IntArray, others: IntArray) -> Slots:
    """Pair corners, counted through all cells, of the faces that both meshes have once; cells in common numbers."""
    faces, slots = _faces(cells, others), list[IntArray]()
    is_common = (faces.here == 1) & (faces.there == 1)
    for rows, number in zip((cells, others), faces.numbers, strict=True):
        chosen = np.flatnonzero(is_common[number])
        chosen = chosen[np.argsort(number[chosen])]
        slots.append((np.argsort(rows[chosen], axis=1, kind="stable") + chosen[:, None] * rows.shape[1]).ravel())
    return slots[0], slots[1]


def _matched(a: KnownMesh, b: KnownMesh, cells: IntArray, others: IntArray) -> Matching | None:
    """Match the vertices of the same faces, if there are no others."""
    corners, other_corners = a.mesh.cells, b.mesh.cells
    turned = 0
    slots = np.arange(cells.size), np.arange(cells.size)
    if not np.array_equal(cells, others):
        faces = _faces(cells, others)
        if not np.array_equal(faces.here, faces.there):
            return None
        turned = faces.turned()
        starts = np.arange(0, cells.size, cells.shape[1])[:, None]
        both = zip((a.mesh, b.mesh), (cells, others), faces.numbers, faces.sides, strict=True)
        one, other = (
            (np.argsort(places, axis=1, kind="stable") + starts)[_order(mesh, face, side < 0)]
            for mesh, places, face, side in both
        )
        corners, other_corners = corners.ravel()[one], other_corners.ravel()[other]
        slots = one.ravel(), other.ravel()
    used, others_used = (len(each.mesh.used) for each in (a, b))
    if np.array_equal(corners, other_corners):
        vertices = there = np.flatnonzero(are_used(corners, len(a.mesh.vertices)))
    else:
        count = len(b.mesh.vertices)
        vertices, there = np.divmod(np.unique(paired(corners, other_corners, count)), count)
    is_other = a.has_indices and b.has_indices and not used == others_used == len(vertices)
    remarks = (f"faces share vertices in another way: {used} against {others_used} vertices",) * is_other
    apart = a.mesh.vertices[vertices] - b.mesh.vertices[there]
    return Matching(vertices, there, np.asarray(reduce(np.hypot, apart.T)), turned, remarks, slots, (cells, others))


def _order(mesh: Mesh, face: IntArray, odd: BoolArray) -> IntArray:
    """(k,) the order of faces by number, and of equal ones by the parts of the mesh, first those turned alike."""
    if len(face) == int(face.max()) + 1:  # none is there twice
        return np.argsort(face, kind="stable")
    _, part = np.unique(components_of(mesh.cells, len(mesh.vertices))[mesh.cells[:, 0]], return_inverse=True)
    marks = np.random.default_rng(0).integers(1 << 30, size=(int(face.max()) + 1, 2))  # sums of 8 million are exact
    sums = [np.bincount(part, marks[face, 0]), np.bincount(part, marks[face, 1] * odd)]
    rank = np.empty(len(sums[0]), dtype=np.int64)
    rank[np.lexsort(sums[::-1])] = np.arange(len(rank))
    return np.lexsort((odd, rank[part], face))


def nearest_cells(mesh: Mesh, other: Mesh, tolerance: float = 0.0) -> tuple[IntArray, BoolArray]:
    """Return the nearest cell of another mesh to each, (k,), and which faces are turned over, (k,).

    These have no face of the other mesh that looks to their side within the tolerance of their middle, or not much
    farther than the nearest one: of surfaces in one place, cut otherwise, one may be nearer than another.
    """
    from scipy.spatial import cKDTree

    candidates, much = 16, 3  # faces of the other mesh with the nearest centres, and times as far
    frame = Frame.around(mesh.vertices, other.used)
    here, there = (frame.inside(each.vertices)[each.cells] for each in (mesh, other))
    tree, points = NearestCells(there), middles(here)
    distances, nearest = tree.nearest(points)
    if mesh.is_curve or other.is_curve:
        return nearest, np.zeros(len(nearest), dtype=bool)
    normals, others = (cross(each[:, 1] - each[:, 0], each[:, 2] - each[:, 0]) for each in (here, there))
    turned = np.asarray(dot(normals, others[nearest]) < 0)
    away = np.flatnonzero(turned)
    within = np.maximum(much * distances[away], float(frame.length(tolerance, -1))) * (1 + 1e-9)
    near = np.asarray(cKDTree(middles(there)).query(points[away], k=[*range(1, min(candidates, len(there)) + 1)])[1]).T
    for cells in near:
        turned[away] &= (dot(normals[away], others[cells]) <= 0) | (tree.distances(points[away], cells) > within)
    return nearest, turned


@dataclass(frozen=True)
class Lone:
    """Faces that only one of two meshes has, or has more often, where it has all faces of the other one."""

    is_first: bool  # whether the first mesh has them
    absent: IntArray  # numbers of cells that the other one has not
    turned: int  # how many of the others look to the other side
    doubled: int  # how many others are there twice in it, and once in the other one
    repeated: int  # how many more there are of the rest


def lone_faces(a: Mesh, b: Mesh, tolerance: float) -> Lone | None:
    """Find the faces in which two meshes differ if all faces of one are faces of the other, within the tolerance."""
    if a.is_curve != b.is_curve or len(a.cells) == len(b.cells):
        return None
    cells, others = a.cells, b.cells
    if a.vertices.shape != b.vertices.shape or np.abs(a.vertices - b.vertices).max() > tolerance:
        cells, others, _ = by_nearness(a, b, tolerance)
    faces = _faces(cells, others)
    if (faces.there < faces.here).any() and (faces.here < faces.there).any():
        return None
    is_first = len(cells) > len(others)
    number, other = faces.numbers
    absent = np.flatnonzero(faces.there[number] == 0 if is_first else faces.here[other] == 0)
    extra = np.abs(faces.here - faces.there)
    doubled = int(((np.minimum(faces.here, faces.there) == 1) & (extra == 1)).sum())
    repeated = int(extra.sum()) - len(absent) - doubled
    return Lone(is_first, absent, faces.turned(), doubled, repeated)


def unlike(
    a: KnownMesh, b: KnownMesh, tolerance: float, close: float, have_others: bool = True
) -> tuple[int, tuple[str, ...], bool]:
    """Tell in what two surfaces, or curves, in the same place differ; common faces have corners that are `close`.

    If both have others, these, too, look to a side.

    Returns the number of faces of one that look to the other side than those of the other there, remarks on other
    parts, holes, and faces that are missing, there twice or without area, and whether all faces are counted.
    """
    first, second = measure(a.mesh), measure(b.mesh)
    rows, some = [("parts", first.components, second.components)], list[tuple[str, int, int]]()
    rows.append(("for vertices − edges + faces", first.euler_characteristic, second.euler_characteristic))
    if a.has_indices and b.has_indices:
        one, other = (component_count(each.mesh.cells, len(each.mesh.vertices)) for each in (a, b))
        rows.append(("parts that share no vertex", one, other))
        one, other = (len(each.mesh.used) - len(_places(each.mesh)[0]) for each in (a, b))
        some.append(("further vertices at the places of others", one, other))
    cell, side = ("segment", "end") if first.is_curve else ("face", "edge")
    what = ("ends", "segments at a vertex") if first.is_curve else ("edges with one face", "faces at an edge")
    some.append((f"open {what[0]}", first.open_edges, second.open_edges))
    some.append((f"places with more than two {what[1]}", first.crowded_edges, second.crowded_edges))
    one, other = (int(_without_extent(each.mesh).sum()) for each in (a, b))  # not those that polygons are cut into
    some += [] if a.has_polygons or b.has_polygons else [("cells without extent", one, other)]
    rows += [row for row in some if 0 in row[1:]]  # how many there are need not be the same
    told = [f"{one} against {other} {what}" for what, one, other in rows if one != other]
    extent, others_extent = (each.length or each.area or 0.0 for each in (first, second))
    reach = sum(float(np.ptp(each.mesh.vertices[each.mesh.cells], axis=1).sum()) for each in (a, b))
    most = 2 * tolerance * (len(a.mesh.cells) if first.is_curve else reach)
    if not math.isclose(extent, others_extent, rel_tol=0, abs_tol=most):  # both may be infinite
        told.append(f"{extent:.9g} against {others_extent:.9g} in {'length' if first.is_curve else 'area'}")
    cells, others, *_ = by_nearness(a.mesh, b.mesh, close)
    faces = _faces(cells, others)
    only, others_only = faces.there[faces.numbers[0]] == 0, faces.here[faces.numbers[1]] == 0
    if only.any() != others_only.any():
        told.append(f"{int(only.sum())} against {int(others_only.sum())} {cell}s that the other has not")
    sides = sides_of(np.concatenate([cells, others]))
    parts = np.split(sides.edge, [len(cells)])
    here, there = (np.bincount(part.ravel(), minlength=len(sides.edges)) for part in parts)
    is_common = np.isin(np.arange(len(here)), parts[0][~only])
    # Other cuts of flat faces make no edges without length, and leave the parity of edges that are there before.
    is_odd = (((here > 0) & (there > 0)) | ~sides.is_proper) & ((here - there) % 2 == 1)
    other = int((is_odd | (is_common & (here != there))).sum())
    told += [f"further {cell}s in one of them only at {other} of the common {side}s"] if other else []
    if a.has_indices and b.has_indices:
        pairs = ((sides_of(each.mesh.cells).first, part) for each, part in zip((a, b), parts, strict=True))
        held, others_held = (np.bincount(part.ravel()[first], minlength=len(here)) for first, part in pairs)
        apart = int(((here == there) & (held != others_held)).sum())
        told += [f"the {cell}s at {apart} of the common {side}s share vertices in another way"] if apart else []
    thin, others_thin = (_without_extent(each.mesh, close) for each in (a, b))
    turned, rest, others_rest, are_all = faces.turned(), ~thin & only, ~others_thin & others_only, True
    if have_others and not first.is_curve and not thin.all() and not others_thin.all():
        ways = (a.mesh, rest, b.mesh, ~others_thin), (b.mesh, others_rest, a.mesh, ~thin)
        chosen = [(Mesh(one.vertices, one.cells[k]), Mesh(two.vertices, two.cells[m])) for one, k, two, m in ways]
        are_all = all(len(one.cells) <= NearestCells(two.vertices[two.cells]).most_points for one, two in chosen)
        turned += max(int(nearest_cells(*pair, tolerance)[1].sum()) for pair in chosen) if are_all else 0
    return turned, (f"in the same place, but {', '.join(told)}",) if told else (), are_all


def _without_extent(mesh: Mesh, close: float = 0.0) -> BoolArray:
    """(k,) true for segments without length and triangles without area, to rounding, or no higher than `close`."""
    least, frame = 1e-14, Frame.around(mesh.bounds)  # area, as a fraction of the square of the longest side
    corners = frame.inside(mesh.vertices)[mesh.cells]
    sides = corners - np.roll(corners, 1, axis=1)
    squares = np.einsum("kcx,kcx->kc", sides, sides).max(axis=1)
    if mesh.is_curve:
        return np.asarray(squares == 0)
    normals = cross(sides[:, 1], sides[:, 2])
    return np.asarray(dot(normals, normals) <= np.maximum(least**2 * squares, frame.length(close, -1) ** 2) * squares)
