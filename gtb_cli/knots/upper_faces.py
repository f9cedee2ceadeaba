"""Upper faces of lifted knots: the simplices of their hull, joined again if rounding of the input split a face."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import EPS, BoolArray, FloatArray, finite, one_for_each, planar_cross, read_only
from gtb_cli.errors import DomainError
from gtb_cli.knots.hull import border_of, convex_hull, depth_in, knot_tolerance
from gtb_cli.knots.upper_hull import UpperHull, height, integers, upper_hull


@dataclass(frozen=True)
class Lifted:
    """Lifted knots as floats, and as exact integers, with a power of two as unit of each axis."""

    points: FloatArray
    heights: FloatArray
    exact: list[tuple[int, ...]]  # per knot: d coordinates, then the lifting
    exponents: tuple[int, ...]  # per axis: value = integer * 2**exponent
    scale: int  # gaps have the unit 2**scale, in which no lifting exceeds 1
    places: list[int]  # the knot that stands for all at the same place: the highest, then the first
    tolerance: float  # of places and collinearity
    floor: float  # gap tolerated everywhere
    rounding: tuple[float, ...]  # per axis of `exact`: possible error of a value

    @property
    def dimension(self) -> int:
        """1 or 2."""
        return int(self.points.shape[1])


def lifted_knots(knots: ArrayLike, lifting: ArrayLike) -> Lifted:
    """Lift knots; see `gtb_cli.knots.decomposition.regular_decomposition` for arguments and errors."""
    # A knot lies on a face if it is within this fraction of the lifting's range: a thousand times below the gaps to be
    # distinguished (1e-9), a thousand times above the rounding of ordinary input. The range is that of the lifting
    # without its best affine fit, so that affine parts do not count.
    gap_tolerance = 1e-12
    # Units in the last place of the largest value by which a knot's coordinate or lifting may be off: two operations of
    # the caller. This counts, besides that fraction, far from the origin and under large affine parts.
    rounding_ulps = 2
    points = finite("knots", knots)
    if points.ndim == 1:
        points = read_only(points[:, None])
    if points.ndim != 2 or points.shape[1] not in (1, 2):
        raise DomainError(f"knots: expected shape (n,), (n, 1) or (n, 2), got {points.shape}")
    heights = one_for_each("lifting", finite("lifting", lifting), len(points), "knot")
    n, d = points.shape
    if n <= d:
        raise DomainError(f"knots: expected at least {d + 1}, got {n}")
    tolerance = knot_tolerance(points)
    if d == 2:
        convex_hull(points)  # refuses a flat hull
    elif not np.ptp(points) > tolerance:
        raise DomainError(f"knots: a curve needs two different knots, all are {points[0, 0]:g}")

    columns = [*points.T, heights]
    exact = [integers(column) for column in columns]
    scale = math.frexp(float(np.abs(heights).max()))[1]
    inexact = [not _is_short(column) for column in columns]
    centered = (points - points[0]) / np.ptp(points, axis=0).max()
    design = np.column_stack([np.ones(n), centered])
    unit_heights = np.ldexp(heights, -scale)
    residual = unit_heights - design @ np.linalg.lstsq(design, unit_heights, rcond=None)[0]
    sizes = [*np.abs(points).max(axis=0).tolist(), float(np.abs(unit_heights).max())]
    return Lifted(
        points=points,
        heights=heights,
        exact=list(zip(*(values for values, _ in exact), strict=True)),
        exponents=tuple(exponent for _, exponent in exact),
        scale=scale,
        places=_places(points, heights, tolerance),
        tolerance=tolerance,
        floor=gap_tolerance * float(np.ptp(residual)) if any(inexact) else 0.0,
        rounding=tuple(rounding_ulps * EPS * size * off for size, off in zip(sizes, inexact, strict=True)),
    )


def _is_short(column: FloatArray) -> bool:
    # Numbers that are all multiples of 2^-32 of the largest are taken as exact, since rounded results do not look like
    # that by chance; if knots and lifting are such numbers (integers, say), gaps have no tolerance
    exact_bits = 32
    exponent = math.frexp(float(np.abs(column).max()))[1]
    scaled = np.ldexp(column, exact_bits - exponent)
    return bool((scaled == np.rint(scaled)).all())


def _places(points: FloatArray, heights: FloatArray, tolerance: float) -> list[int]:
    """For each knot the highest one at its place, itself where it is alone."""
    places = np.full(len(points), -1)
    across = np.argsort(points[:, 0], kind="stable")
    first = points[across, 0]
    starts = np.searchsorted(first, points[:, 0] - 2 * tolerance, "left")
    ends = np.searchsorted(first, points[:, 0] + 2 * tolerance, "right")
    for i in np.lexsort([np.arange(len(points)), -heights]).tolist():
        if places[i] < 0:
            near = across[starts[i] : ends[i]]
            near = near[(np.abs(points[near] - points[i]).max(axis=1) <= tolerance) & (places[near] < 0)]
            places[near] = i
    return [int(i) for i in places]


class UpperFace:
    """The plane of one simplex of the hull, and the simplices joined to it."""

    def __init__(self, lifted: Lifted, simplex: tuple[int, ...], plane: tuple[int, ...]) -> None:
        self.knots = set(simplex)
        self.polygon: list[int] = list(simplex)
        self._lifted = lifted
        self._plane = plane
        design = np.column_stack([np.ones(len(simplex)), lifted.points[list(simplex)] - lifted.points[simplex[0]]])
        # Columns in units of the simplex's extent, so that the inverse exists at any scale.
        self._origin = lifted.points[simplex[0]]
        self._extent = float(np.ptp(lifted.points[list(simplex)], axis=0).max())
        design[:, 1:] /= self._extent
        self._inverse = np.linalg.inv(design)
        *coordinates, vertical = lifted.rounding
        self._rounding = vertical + sum(
            abs(_quotient(n, plane[-2], lifted.exponents[-1] - lifted.scale - exponent)) * off
            for n, exponent, off in zip(plane, lifted.exponents, coordinates, strict=False)
            if off
        )

    def holds(self, knot: int) -> bool:
        """Whether a knot is on the plane, within the tolerance."""
        lifted = self._lifted
        drop = -height(self._plane, lifted.exact[knot])
        if drop <= 0:
            return True
        allowed = lifted.floor
        if self._rounding:
            place = (lifted.points[knot] - self._origin) / self._extent
            weights = self._inverse[0] + place @ self._inverse[1:]
            allowed += self._rounding * (1.0 + float(np.abs(weights).sum()))
        return allowed > 0 and _quotient(drop, self._plane[-2], lifted.exponents[-1] - lifted.scale) <= allowed

    def holds_exactly(self, knot: int) -> bool:
        """Whether a knot is exactly on the plane."""
        return height(self._plane, self._lifted.exact[knot]) == 0

    def affine(self) -> tuple[list[float], float]:
        """Gradient and offset of the plane, each rounded once."""
        *normal, vertical, constant = self._plane
        *exponents, exponent = self._lifted.exponents
        gradient = [_quotient(-n, vertical, exponent - e) for n, e in zip(normal, exponents, strict=True)]
        return gradient, _quotient(constant, vertical, exponent)


def _quotient(numerator: int, denominator: int, exponent: int) -> float:
    """numerator / denominator * 2**exponent, rounded once."""
    if exponent >= 0:
        return (numerator << exponent) / denominator
    return numerator / (denominator << -exponent)


def upper_faces(lifted: Lifted) -> list[UpperFace]:
    """The upper faces, in lexicographic order of their knots; their polygons tile Δ and meet edge to edge."""
    faces = _joined(lifted, upper_hull(lifted.exact, sorted(set(lifted.places))))
    _share_knots(lifted, faces)
    return sorted(faces, key=lambda face: sorted(face.knots))


def _joined(lifted: Lifted, hull: UpperHull) -> list[UpperFace]:
    """Join the simplices of each face, the largest first; slivers that belong to no face are dropped."""
    faces: list[UpperFace] = []
    taken: set[int] = set()
    proper = _proper(lifted, hull.simplices)
    for seed in sorted(range(len(hull.simplices)), key=lambda f: (-hull.planes[f][-2], hull.simplices[f])):
        if seed in taken or not proper[seed]:
            continue
        face = UpperFace(lifted, hull.simplices[seed], hull.planes[seed])
        # The seed alone is always convex.
        for holds in (face.holds, face.holds_exactly, face.knots.__contains__):
            region = _region(hull, seed, taken, holds)
            polygon = _outline(lifted, [hull.simplices[f] for f in region])
            if polygon is not None:
                face.polygon = polygon
                face.knots.update(i for f in region for i in hull.simplices[f])
                break
        taken.update(region)
        faces.append(face)
    if not faces:
        raise DomainError(f"knots: all {len(lifted.points)} lie on one line to rounding, their hull is flat")
    return faces


def _region(hull: UpperHull, seed: int, taken: set[int], holds: Callable[[int], bool]) -> list[int]:
    """Simplices connected with a seed that are not taken yet and whose knots a face holds."""
    region, reached = [seed], {*taken, seed}
    for current in region:
        for other in hull.adjacent[current]:
            if other not in reached and all(map(holds, hull.simplices[other])):
                reached.add(other)
                region.append(other)
    return region


def _proper(lifted: Lifted, simplices: list[tuple[int, ...]]) -> BoolArray:
    """(m,) whether each simplex is thicker than rounding."""
    # Width, in units of `knot_tolerance`, below which a triangle is due to rounding of knots meant to be collinear
    sliver_width = 2.0
    if lifted.dimension == 1:
        return np.ones(len(simplices), dtype=bool)
    corners = (lifted.points - lifted.points[0])[np.array(simplices)]
    sides = np.roll(corners, -1, axis=1) - corners
    longest = np.hypot(sides[..., 0], sides[..., 1]).max(axis=1)
    return np.asarray(np.abs(planar_cross(sides[:, 0], sides[:, 1])) > sliver_width * lifted.tolerance * longest)


def _outline(lifted: Lifted, simplices: list[tuple[int, ...]]) -> list[int] | None:
    """Corners of the union of simplices if it is convex, otherwise None."""
    # Distance, in units of `knot_tolerance`, by which the outline of joined triangles may fall short of their convex
    # hull
    outline_gap = 4.0
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
