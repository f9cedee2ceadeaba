"""The exact upper hull of lifted points, in integers: floats are binary fractions, so that nothing is rounded."""

from dataclasses import dataclass, field
from itertools import pairwise

from gtb_cli.arrays import FloatArray

POINT_BELOW = -1  # index of the point at infinity below the lifted knots, which makes the lower hull one vertical prism


@dataclass(frozen=True)
class UpperHull:
    """Exact upper hull: simplices counter-clockwise, planes <n, (a, λ)> = c with n_λ > 0, and adjacency."""

    simplices: list[tuple[int, ...]]
    planes: list[tuple[int, ...]]
    adjacent: list[list[int]]


def integers(column: FloatArray) -> tuple[list[int], int]:
    """Integers and an exponent e such that each value is exactly integer * 2**e."""
    ratios = [value.as_integer_ratio() for value in column.tolist()]
    bits = max(denominator for _, denominator in ratios).bit_length() - 1
    values = [(numerator << bits) // denominator for numerator, denominator in ratios]
    combined = 0
    for value in values:
        combined |= value
    spare = max((combined & -combined).bit_length() - 1, 0)
    return [value >> spare for value in values], spare - bits


def upper_hull(points: list[tuple[int, ...]], indices: list[int]) -> UpperHull:
    """The upper hull of the points with these indices: d = 1 or 2 coordinates and a height, at distinct places.

    Points on a facet that are not corners are left out; coplanar facets are not joined. Quickhull is used for d = 2,
    O(n log n) on average.
    """
    return _upper_chain(points, indices) if len(points[0]) == 2 else _upper_triangles(points, indices)


def _upper_chain(at: list[tuple[int, ...]], indices: list[int]) -> UpperHull:
    chain: list[int] = []
    for i in sorted(indices, key=at.__getitem__):
        while len(chain) > 1 and height(_line(at[chain[-2]], at[chain[-1]]), at[i]) >= 0:
            chain.pop()
        chain.append(i)
    simplices: list[tuple[int, ...]] = list(pairwise(chain))
    last = len(simplices) - 1
    return UpperHull(
        simplices=simplices,
        planes=[_line(at[a], at[b]) for a, b in simplices],
        adjacent=[[k for k in (f - 1, f + 1) if 0 <= k <= last] for f in range(last + 1)],
    )


def _line(a: tuple[int, ...], b: tuple[int, ...]) -> tuple[int, ...]:
    run, rise = b[0] - a[0], b[1] - a[1]
    return -rise, run, run * a[1] - rise * a[0]


def height(plane: tuple[int, ...], point: tuple[int, ...]) -> int:
    """Positive above the plane; comparable between points for one plane."""
    if len(point) == 2:
        return plane[0] * point[0] + plane[1] * point[1] - plane[2]
    return plane[0] * point[0] + plane[1] * point[1] + plane[2] * point[2] - plane[3]


@dataclass(eq=False)
class _Facet:
    """A facet of the growing hull: corners counter-clockwise from outside, plane, points strictly above it."""

    corners: tuple[int, int, int]
    plane: tuple[int, ...]
    above: list[int] = field(default_factory=list)

    @property
    def borders(self) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
        a, b, c = self.corners
        return (a, b), (b, c), (c, a)


def _upper_triangles(at: list[tuple[int, ...]], indices: list[int]) -> UpperHull:
    """Quickhull of the lifted knots and `POINT_BELOW`, in integers.

    Facets are visible only from strictly above, so that coplanar points never make a flat facet; vertical facets on Δ's
    boundary are dropped with the prism below.
    """
    facet_at: dict[tuple[int, int], _Facet] = {}

    def facet(corners: tuple[int, int, int]) -> _Facet:
        made = _Facet(corners, _plane(at, corners))
        facet_at.update(dict.fromkeys(made.borders, made))
        return made

    def assign(points: list[int], facets: list[_Facet]) -> None:
        for i in points:
            for candidate in facets:
                if height(candidate.plane, at[i]) > 0:
                    candidate.above.append(i)
                    break

    a, b, c = _first_triangle(at, indices)
    todo = [facet(corners) for corners in ((a, b, c), (b, a, POINT_BELOW), (c, b, POINT_BELOW), (a, c, POINT_BELOW))]
    assign([i for i in indices if i not in (a, b, c)], todo)
    while todo:
        start = todo.pop()
        if not start.above or facet_at.get(start.borders[0]) is not start:
            continue
        plane = start.plane
        apex = max(start.above, key=lambda i: height(plane, at[i]))
        visible, horizon = [start], []
        seen = {start}
        for current in visible:
            for u, v in current.borders:
                across = facet_at[v, u]
                if across in seen:
                    continue
                if height(across.plane, at[apex]) > 0:
                    seen.add(across)
                    visible.append(across)
                else:
                    horizon.append((u, v))
        for current in visible:
            for border in current.borders:
                del facet_at[border]
        made = [facet((u, v, apex)) for u, v in horizon]
        # A point outside the hull that saw a removed facet sees one of the new facets.
        assign([i for current in visible for i in current.above if i != apex], made)
        todo += made

    upper = [current for current in dict.fromkeys(facet_at.values()) if current.plane[2] > 0]
    index = {current: k for k, current in enumerate(upper)}
    return UpperHull(
        simplices=[current.corners for current in upper],
        planes=[current.plane for current in upper],
        adjacent=[[index[f] for f in (facet_at[v, u] for u, v in g.borders) if f in index] for g in upper],
    )


def _first_triangle(at: list[tuple[int, ...]], indices: list[int]) -> tuple[int, int, int]:
    a = min(indices, key=at.__getitem__)
    b = max(indices, key=at.__getitem__)
    run, rise = at[b][0] - at[a][0], at[b][1] - at[a][1]

    def left(i: int) -> int:
        return run * (at[i][1] - at[a][1]) - rise * (at[i][0] - at[a][0])

    c = max(indices, key=lambda i: abs(left(i)))
    return (a, b, c) if left(c) > 0 else (b, a, c)


def _plane(at: list[tuple[int, ...]], corners: tuple[int, int, int]) -> tuple[int, ...]:
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
