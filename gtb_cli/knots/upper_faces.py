"""Upper faces of lifted knots: their exact hull, in integers, with simplices joined that rounding had split."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import combinations, pairwise
from operator import mul

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import EPS, FloatArray, finite, one_for_each, planar_cross
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import SIZES, domain
from gtb_cli.knots.hull import border_of, convex_hull, depth_in, knot_tolerance
from gtb_cli.values import grouped

POINT_BELOW = -1  # index of the point at infinity below the lifted knots, which makes the lower hull one vertical prism

Simplex = tuple[int, ...]  # indices of knots: ascending places on a line, counter-clockwise in the plane
Plane = tuple[int, ...]  # (n, c) with <n, (a, λ)> = c, and n_λ > 0 for an upper simplex


@dataclass(frozen=True)
class Lifted:
    """Lifted knots as floats, and as integers in units of 2^-bits: floats are binary fractions."""

    points: FloatArray
    heights: FloatArray
    exact: list[tuple[int, ...]]  # per knot: d coordinates, then the lifting
    bits: int
    places: list[int]  # the knot that stands for all at the same place: the highest, then the first
    tolerance: float  # of places and collinearity
    floor: float  # gap tolerated everywhere
    rounding: list[float]  # per axis of `exact`: possible error of a value

    @property
    def dimension(self) -> int:
        """1 or 2."""
        return int(self.points.shape[1])


def lifted_knots(knots: ArrayLike, lifting: ArrayLike) -> Lifted:
    """Lift knots; see `gtb_cli.knots.decomposition.regular_decomposition` for arguments and errors."""
    # Knots lie on a face within this fraction of the lifting's range, a thousand times above the rounding of ordinary
    # input. Affine parts do not count: the lifting is taken without its best affine fit.
    gap_tolerance = 1e-12
    rounding_ulps = 2  # by which a coordinate or lifting may be off, too: two operations of the caller
    _, largest = SIZES  # so that gradients are floats, however near to each other knots are
    points = domain(knots).knots
    heights = one_for_each("lifting", finite("lifting", lifting), len(points), "knot")
    if (size := np.abs(heights).max()) > largest:
        raise DomainError(f"lifting: values beyond {largest:g} are not supported, got {size:g}")
    tolerance = knot_tolerance(points)
    if points.shape[1] == 1 and not np.ptp(points) > tolerance:
        raise DomainError(f"knots: a curve needs two different knots, all are {points[0, 0]:g} to rounding")

    rows = np.column_stack([points, heights])
    ratios = [[value.as_integer_ratio() for value in row] for row in rows.tolist()]
    bits = max(denominator for row in ratios for _, denominator in row).bit_length() - 1
    design = np.column_stack([np.ones(len(points)), (points - points[0]) / np.ptp(points, axis=0).max()])
    residual = heights - design @ np.linalg.lstsq(design, heights, rcond=None)[0]
    sizes = np.abs(rows).max(axis=0)
    # Numbers that are all multiples of 2^-32 of the largest are exact: rounded results are not such by chance.
    scaled = np.ldexp(rows, 32 - np.frexp(sizes)[1])
    inexact = (scaled != np.rint(scaled)).any(axis=0).tolist()
    exact = [tuple((numerator << bits) // denominator for numerator, denominator in row) for row in ratios]
    floor = gap_tolerance * float(np.ptp(residual)) if any(inexact) else 0.0
    rounding = [rounding_ulps * EPS * size * off for size, off in zip(sizes.tolist(), inexact, strict=True)]
    return Lifted(points, heights, exact, bits, _places(points, heights, tolerance), tolerance, floor, rounding)


def _places(points: FloatArray, heights: FloatArray, tolerance: float) -> list[int]:
    places = np.full(len(points), -1)
    for i in np.lexsort([np.arange(len(points)), -heights]).tolist():
        if places[i] < 0:
            places[(np.abs(points - points[i]).max(axis=1) <= tolerance) & (places < 0)] = i
    return [int(i) for i in places]


def _upper_chain(at: list[tuple[int, ...]], indices: list[int]) -> dict[Simplex, Plane]:
    """Return the segments of the upper hull of points at distinct places on a line, each as long as possible."""

    def line(i: int, j: int) -> Plane:
        run, rise = at[j][0] - at[i][0], at[j][1] - at[i][1]
        return -rise, run, run * at[i][1] - rise * at[i][0]

    chain: list[int] = []
    for i in sorted(indices, key=at.__getitem__):
        while len(chain) > 1 and _height(line(chain[-2], chain[-1]), at[i]) >= 0:
            chain.pop()
        chain.append(i)
    return {pair: line(*pair) for pair in pairwise(chain)}


def _height(plane: Plane, point: tuple[int, ...]) -> int:
    """Return a height above the plane, in a unit of the plane's own."""
    return int(sum(map(mul, plane, point)) - plane[-1])


def _upper_triangles(at: list[tuple[int, ...]], indices: list[int]) -> dict[Simplex, Plane]:
    """Quickhull of the lifted knots and `POINT_BELOW`, O(n log n) on average.

    Facets, counter-clockwise from outside, are visible only from strictly above, so that coplanar points never make a
    flat facet; vertical facets on Δ's boundary are dropped with the prism below.
    """
    planes: dict[Simplex, Plane] = {}
    above: dict[Simplex, list[int]] = {}  # each point under the first facet that it is strictly above
    facet_at: dict[tuple[int, int], Simplex] = {}

    def add(facets: list[Simplex], points: Iterable[int]) -> None:
        for facet in facets:
            planes[facet], above[facet] = _plane(at, facet), []
            facet_at.update(dict.fromkeys(border_of(facet), facet))
        for i in points:
            for facet in facets:
                if _height(planes[facet], at[i]) > 0:
                    above[facet].append(i)
                    break

    a, b = min(indices, key=at.__getitem__), max(indices, key=at.__getitem__)
    c = max(indices, key=lambda i: abs(_plane(at, (a, b, i))[2]))  # farthest from their line
    a, b = (a, b) if _plane(at, (a, b, c))[2] > 0 else (b, a)
    todo: list[Simplex] = [(a, b, c), (b, a, POINT_BELOW), (c, b, POINT_BELOW), (a, c, POINT_BELOW)]
    add(todo, (i for i in indices if i not in (a, b, c)))
    while todo:
        start = todo.pop()
        if not above.get(start):
            continue
        plane = planes[start]
        apex = max(above[start], key=lambda i: _height(plane, at[i]))
        visible, horizon, seen = [start], [], {start}
        for facet in visible:
            for u, v in border_of(facet):
                across = facet_at[v, u]
                if across not in seen and _height(planes[across], at[apex]) <= 0:
                    horizon.append((u, v))
                elif across not in seen:
                    seen.add(across)
                    visible.append(across)
        # A point outside the hull that saw a removed facet sees one of the new facets.
        outside = [i for facet in visible for i in above.pop(facet) if i != apex]
        for facet in visible:
            del planes[facet]
        made: list[Simplex] = [(u, v, apex) for u, v in horizon]
        add(made, outside)
        todo += made
    return {facet: plane for facet, plane in planes.items() if plane[2] > 0}


def _plane(at: list[tuple[int, ...]], corners: Simplex) -> Plane:
    a, b, c = corners
    while POINT_BELOW in (a, b):
        a, b, c = b, c, a
    (ax, ay, az), (bx, by, bz) = at[a], at[b]
    ux, uy, uz = bx - ax, by - ay, bz - az
    if c == POINT_BELOW:
        return -uy, ux, 0, ux * ay - uy * ax
    vx, vy, vz = at[c][0] - ax, at[c][1] - ay, at[c][2] - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return nx, ny, nz, nx * ax + ny * ay + nz * az


class UpperFace:
    """The plane of one simplex of the hull, and the simplices joined to it."""

    def __init__(self, lifted: Lifted, simplex: Simplex, plane: Plane) -> None:
        self.knots, self.polygon = set(simplex), list(simplex)
        self._lifted, self._plane = lifted, plane
        corners = lifted.points[self.polygon]
        # Columns in units of the simplex's extent, so that the inverse exists at any scale
        self._origin, self._extent = corners[0], float(np.ptp(corners, axis=0).max())
        self._inverse = np.linalg.inv(np.insert((corners - self._origin) / self._extent, 0, 1.0, axis=1))
        slopes = [abs(normal / plane[-2]) for normal in plane[:-1]]
        self._rounding = sum(slope * off for slope, off in zip(slopes, lifted.rounding, strict=True))

    def holds(self, knot: int) -> bool:
        """Tell whether a knot is on the plane, within the tolerance."""
        lifted = self._lifted
        drop = -_height(self._plane, lifted.exact[knot])
        if drop <= 0:
            return True
        allowed = lifted.floor
        if self._rounding:
            place = np.insert((lifted.points[knot] - self._origin) / self._extent, 0, 1.0)
            allowed += self._rounding * (1.0 + float(np.abs(place @ self._inverse).sum()))
        return allowed > 0 and drop / (self._plane[-2] << lifted.bits) <= allowed

    def affine(self) -> tuple[list[float], float]:
        """Return the gradient and the offset of the plane, each rounded once."""
        *normal, vertical, constant = self._plane
        return [-n / vertical for n in normal], constant / (vertical << self._lifted.bits)


def upper_faces(lifted: Lifted) -> list[UpperFace]:
    """Return the upper faces in lexicographic order of their knots; their polygons tile Δ and meet edge to edge."""
    hull_of = _upper_chain if lifted.dimension == 1 else _upper_triangles
    faces = _joined(lifted, hull_of(lifted.exact, sorted(set(lifted.places))))
    _share_knots(lifted, faces)
    return sorted(faces, key=lambda face: sorted(face.knots))


def _joined(lifted: Lifted, hull: dict[Simplex, Plane]) -> list[UpperFace]:
    """Join the simplices of each face, the largest first; slivers that belong to no face are dropped."""
    faces: list[UpperFace] = []
    taken: set[Simplex] = set()
    sides = ((side, each) for each in hull for side in combinations(sorted(each), lifted.dimension))
    beside: dict[Simplex, list[Simplex]] = grouped(sides)

    def region(seed: Simplex, holds: Callable[[int], bool]) -> list[Simplex]:
        found, reached = [seed], {*taken, seed}
        for current in found:
            for side in combinations(sorted(current), lifted.dimension):
                for other in beside[side]:
                    if other not in reached and all(map(holds, other)):
                        reached.add(other)
                        found.append(other)
        return found

    def is_sliver(simplex: Simplex) -> bool:
        """Tell whether a sliver comes from rounding knots that were meant to be collinear; n_λ is twice its area."""
        if lifted.dimension == 1:
            return False
        extent = np.hypot(*np.ptp(lifted.points[list(simplex)], axis=0))
        return bool(hull[simplex][-2] / 4**lifted.bits <= 2.0 * lifted.tolerance * extent)

    for seed in sorted(hull, key=lambda simplex: (-hull[simplex][-2], simplex)):
        if seed in taken or is_sliver(seed):
            continue
        face = UpperFace(lifted, seed, hull[seed])
        for holds in (face.holds, face.knots.__contains__):  # the seed and simplices of its knots are always convex
            joined = region(seed, holds)
            if polygon := _outline(lifted, joined):
                face.polygon = polygon
                break
        face.knots.update(i for simplex in joined for i in simplex)
        taken.update(joined)
        faces.append(face)
    if not faces:
        raise DomainError(f"knots: all {len(lifted.points)} lie on one line to rounding, their hull is flat")
    return faces


def _outline(lifted: Lifted, simplices: list[Simplex]) -> list[int] | None:
    """Return the corners of the union of simplices if it is convex, otherwise None."""
    outline_gap = 4.0  # times the tolerance: the outline may fall short of the convex hull by this
    knots = sorted({i for simplex in simplices for i in simplex})
    points = lifted.points[knots]
    if lifted.dimension == 1:
        return [knots[int(points.argmin())], knots[int(points.argmax())]]
    if len(simplices) == 1:
        start = min(range(3), key=lambda k: lifted.points[simplices[0][k], ::-1].tolist())
        return [*simplices[0][start:], *simplices[0][:start]]
    polygon = convex_hull(points)
    borders = {(u, v) for simplex in simplices for u, v in border_of(simplex)}
    outer = np.array([(u, v) for u, v in sorted(borders) if (v, u) not in borders])
    centered = lifted.points - points[0]
    if (depth_in(points[polygon] - points[0], centered[outer].mean(axis=1)) > outline_gap * lifted.tolerance).any():
        return None
    return [knots[k] for k in polygon.tolist()]


def _share_knots(lifted: Lifted, faces: list[UpperFace]) -> None:
    """Give each face all knots on it, and neighbours the same knots and corners on their common border."""
    points = lifted.points - lifted.points[0]
    depths = [depth_in(points[face.polygon], points) for face in faces]
    within = [np.flatnonzero(depth >= -lifted.tolerance).tolist() for depth in depths]
    for face, candidates in zip(faces, within, strict=True):
        face.knots.update(i for i in candidates if face.holds(i))
    present = {i for face in faces for i in face.knots}
    corners = {i for face in faces for i in face.polygon}
    for face, candidates, depth in zip(faces, within, depths, strict=True):
        face.knots.update(present.intersection(candidates))
        for corner in sorted(corners.intersection(candidates).difference(face.polygon)):
            if abs(depth[corner]) <= lifted.tolerance and lifted.dimension == 2:
                _insert_corner(points, face.polygon, corner)


def _insert_corner(points: FloatArray, polygon: list[int], corner: int) -> None:
    """Insert a neighbour's corner into the side of a polygon on which it lies, to rounding."""
    start, sides = points[polygon], np.roll(points[polygon], -1, axis=0) - points[polygon]
    offsets = points[corner] - start
    lengths = np.hypot(sides[:, 0], sides[:, 1])
    distance = np.abs(planar_cross(sides, offsets)) / lengths
    along = (offsets * sides).sum(axis=1) / lengths
    distance[(along <= 0) | (along >= lengths)] = np.inf
    if np.isfinite(distance).any():
        polygon.insert(int(distance.argmin()) + 1, corner)
