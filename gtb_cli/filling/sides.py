"""Sides of a hole: rational Bézier curves, homogeneous, the field across each that spans its planes, and their loop."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, compress

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.bezier.pieces import bezier_degree
from gtb_cli.errors import DomainError
from gtb_cli.models.openings import above
from gtb_cli.theory.basis import Location
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

MAX_DEGREE = 20  # of a side after gaps between its knots are filled: its coefficients span six digits
STEP_TOLERANCE = 1e-9  # of a curve's length: knots typed or computed rounded are off equal steps
MAX_GAP = 1e-5  # between neighbouring sides, of the loop's size: files with six decimals count as closed
NEAR = 0.02  # of the loop's size: ends that are farther apart were not meant to meet
POINT_SIZE = 1e-9  # of the loop's size: a side as small is a point


@frozen
class HoleSide:
    """One side of a hole: (m + 1, 4) Bézier points (ω x, ω y, ω z, ω), with ω positive and 1 at both ends.

    `across` has (96, 3) directions into the hole at the parameters `stations`; they and the tangent span the planes
    that the patch is to touch. `bend` has the (96,) normal curvatures of the neighbour across the side there, with
    tangent × across as the normal; NaN where there is none. None: these are not known. `strip` has the
    derivative across of a polynomial neighbour along a polynomial side, as Bézier points (m + 1, 3).
    `spline` is the B-spline of which it is a piece. Fields with normal components below `rounding` are in the planes.
    Ends that are up to `weld` apart are moved together.
    """

    name: str
    curve: FloatArray
    across: FloatArray | None = None
    bend: FloatArray | None = None
    strip: FloatArray | None = None
    spline: str | None = None
    rounding: float = 1e-13  # of sums of some dozen terms
    weld: float = 0.0

    @property
    def degree(self) -> int:
        """Degree of the curve."""
        return len(self.curve) - 1

    @property
    def points(self) -> FloatArray:
        """(m + 1, 3) Bézier points."""
        return np.asarray(self.curve[:, :3] / self.curve[:, 3:])

    @property
    def ends(self) -> FloatArray:
        """(2, 3) first and last point."""
        return self.points[[0, -1]]

    @property
    def multiplier(self) -> FloatArray:
        """(k + 1,) Bernstein coefficients of the polynomial by which the curve is multiplied when its degree is raised.

        A rational curve is multiplied by its own weights: its points stay at the same fractions of the linear
        parametrisation, so that it is joined with the edges of patches that have it. Others keep these anyway.
        """
        polynomial_spread = 1e-12  # rounding of the weights of a polynomial side
        weights = self.curve[:, 3]
        return weights if np.ptp(weights) > polynomial_spread * weights.max() else np.ones(2)

    def met_with(self, continuity: str) -> "HoleSide":
        """Leave out what a patch need not meet: the curvature with g1, and the planes with g0.

        Raises `DomainError` if it is to be met and is not known: with g2.
        """
        if continuity == "g2":
            if self.bend is None:
                one = "a ribbon2 (.gbp: degree 5; parts: all sides, to a CAD file)"
                needed = "a ribbon and a ribbon2" if self.across is None else one
                raise DomainError(f"{self.name}: its neighbour's curvature is not known: continuity g2 needs {needed}")
            if not np.isfinite(self.bend).all():
                place = stations()[int(np.flatnonzero(~np.isfinite(self.bend))[0])]
                where = f"near t = {place:.3f}: take continuity g1"
                raise DomainError(f"{self.name}: its neighbour has no finite curvature {where}")
            return self
        return replace(self, bend=None, across=None if continuity == "g0" else self.across)

    def in_units(self, middle: FloatArray, size: float) -> "HoleSide":
        """Write the side in units of a size, from a middle; directions across stay."""
        return replace(
            self,
            curve=np.hstack([(self.curve[:, :3] - self.curve[:, 3:] * middle) / size, self.curve[:, 3:]]),
            bend=None if self.bend is None else self.bend * size,
            strip=None if self.strip is None else self.strip / size,
            weld=self.weld / size,
        )

    def reversed(self) -> "HoleSide":
        """Run through the side from its other end; the hole stays on the same side of it."""
        return replace(
            self,
            curve=self.curve[::-1],
            across=None if self.across is None else self.across[::-1],
            bend=None if self.bend is None else -self.bend[::-1],
            strip=None if self.strip is None else self.strip[::-1],
        )


def stations() -> FloatArray:
    """Return (96,) parameters inside (0, 1), symmetric and dense near the ends.

    These are more than the degree of any product of polynomials that is set to zero there: that of a normal, up to 30,
    and a row.
    """
    return np.asarray((1 - np.cos(np.pi * (np.arange(96) + 0.5) / 96)) / 2)


def bernstein(degree: int, t: FloatArray) -> FloatArray:
    """Return (m, degree + 1) values of the Bernstein polynomials."""
    j = np.arange(degree + 1)
    return np.asarray(binomials(degree) * t[:, None] ** j * (1 - t[:, None]) ** (degree - j))


def binomials(degree: int) -> FloatArray:
    """Return the (degree + 1,) binomial coefficients of a degree."""
    return np.array([float(math.comb(degree, j)) for j in range(degree + 1)])


def raised(points: FloatArray, times: int, multiplier: FloatArray | None = None) -> FloatArray:
    """Return the Bézier points of a polynomial times a power of another; by default of 1, which raises the degree."""
    factor = np.ones(2) if multiplier is None else multiplier
    for _ in range(times):
        i, j = np.arange(len(factor)), np.arange(len(points))
        total = len(i) + len(j) - 2
        shares = np.outer(binomials(len(i) - 1), binomials(len(j) - 1)) / binomials(total)[i[:, None] + j]
        found = np.zeros((total + 1, points.shape[1]))
        np.add.at(found, i[:, None] + j, (shares * factor[:, None])[:, :, None] * points)
        points = found
    return points


def points_and_tangents(curve: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (m, 3) points of a rational Bézier curve, and its derivatives up to a positive factor."""
    degree = len(curve) - 1
    position, rate = bernstein(degree, t) @ curve, bernstein(degree - 1, t) @ np.diff(curve, axis=0)
    points = position[:, :3] / position[:, 3:]
    return points, np.asarray(rate[:, :3] - points * rate[:, 3:])


def side_normals(side: HoleSide) -> FloatArray:
    """Return (96, 3) unit normals tangent × across of a side with a field across.

    Raises `DomainError` if the tangent vanishes, or the field across is parallel to it.
    """
    parallel_sine = 1e-10  # tangent and field do not span a plane below this
    assert side.across is not None
    directions = []
    _, tangents = points_and_tangents(side.curve, stations())
    for what, vectors in (("the tangent", tangents), ("the ribbon's distance from the curve", side.across)):
        vectors = vectors / (np.abs(vectors).max() or 1.0)  # their squares must not underflow
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        if not (length > POINT_SIZE * length.max()).all():
            raise DomainError(f"{side.name}: {what} vanishes on it, near t = {stations()[int(length.argmin())]:.3f}")
        directions.append(vectors / length)
    cross = np.cross(*directions)
    sine = np.linalg.norm(cross, axis=1, keepdims=True)
    if not (sine > parallel_sine).all():
        place = stations()[int(sine.argmin())]
        raise DomainError(f"{side.name}: the ribbon is parallel to the curve near t = {place:.3f}, and spans no plane")
    return np.asarray(cross / sine)


def bezier_form(curve: Patch, rows: Sequence[FloatArray] = (), name: str = "curve") -> tuple[FloatArray, ...]:
    """Write a curve patch, and (n, 3) rows of further points with its weights, as rational Bézier points.

    Return (m + 1, 4) homogeneous points of the curve, then of each row. If the knots are whole multiples of a step with
    some left out, a higher degree fills the gaps. Raises `DomainError`, with the name, if the knots have no common
    step, or the degree would be beyond `MAX_DEGREE`.
    """
    knots = curve.knots[:, 0]
    order = np.argsort(knots, kind="stable")
    length = float(np.ptp(knots))
    place = (knots[order] - knots.min()) / length
    degree = bezier_degree(place, STEP_TOLERANCE)
    if degree is None or degree > MAX_DEGREE:
        raise DomainError(
            f"{name}: its knots are not multiples of a common step (up to {MAX_DEGREE} of them), so that it is not a "
            "rational Bézier curve: gtb fit makes one near it"
        )
    index = np.rint(place * degree).astype(np.int64)
    logs = curve.log_products[order]
    # A factor exp(σ a) only reparametrises, and gives both ends the weight 1.
    logs = logs - (1 - place) * _end_log(logs, index == 0) - place * _end_log(logs, index == degree)
    found = []
    for points in (curve.control_points, *rows):
        table = np.zeros((degree + 1, 4))
        np.add.at(table, index, np.exp(logs)[:, None] * np.column_stack([points[order], np.ones(len(order))]))
        found.append(table)
    # Without binomials here: the polynomials are multiplied by 1 + z until no knot is missing.
    while not (found[0][:, 3] > 0).all():
        found = [np.vstack([table, table[:1] * 0]) + np.vstack([table[:1] * 0, table]) for table in found]
        if len(found[0]) - 1 > MAX_DEGREE:
            raise DomainError(f"{name}: its degree is more than {MAX_DEGREE} with the gaps between its knots filled")
    factors = binomials(len(found[0]) - 1)[:, None]
    return tuple(table / factors for table in found)


def edge_places(patch: Patch, edge: int, t: FloatArray) -> Location:
    """Locate (m,) Bézier parameters in (0, 1) of a surface's edge, for its normals and curvatures there.

    The torus coordinate is log(t / (1 − t)), divided by the step of the knots, up to the factor that gives both ends of
    the Bézier form the weight 1.
    """
    shape, face = patch.domain, patch.domain.faces.edge(edge)
    along = shape.face_knots(face)[:, 0]
    length, logs = float(np.ptp(along)), patch.log_products[face.knots]
    steps = bezier_degree(along - along.min(), STEP_TOLERANCE * length)
    assert steps is not None, "the edge has a Bézier form"
    tilt = _end_log(logs, along == along.max()) - _end_log(logs, along == along.min())
    s = ((np.log(t / (1 - t)) * steps - tilt) / length)[None]
    return Location(np.arange(len(t)), face, along[:, None], s)


def _end_log(logs: FloatArray, members: FloatArray | IntArray) -> float:
    return float(np.logaddexp.reduce(logs[np.asarray(members, dtype=bool)]))


def edge_normals(patch: Patch, edge: int, t: FloatArray) -> FloatArray:
    """Return (m, 3) unit normals of a surface at (m,) Bézier parameters in (0, 1) of an edge; NaN where it has none."""
    return patch.normals_at([edge_places(patch, edge, t)], len(t))


def loop(sides: Sequence[HoleSide]) -> tuple[tuple[HoleSide, ...], list[str]]:
    """Put sides in order, so that each begins where the one before ends, and close gaps due to rounding or in the weld.

    Return them without those that are points, and remarks that say so. Raises `DomainError` if they do not close, lie
    on one line, or are fewer than three.
    """
    size = float(np.ptp(np.concatenate([side.points for side in sides]), axis=0).max()) if sides else 0.0
    if not size > 0:
        raise DomainError("loop: has no extent")
    most = max(MAX_GAP * size, *(side.weld for side in sides))
    long = [bool(np.ptp(side.points, axis=0).max() > POINT_SIZE * size) for side in sides]
    remarks = [f"{side.name} is a point and is left out" for side, kept in zip(sides, long, strict=True) if not kept]
    left = list(compress(sides, long))
    if len(left) < 3:
        count = f"{len(left)} sides that are not points" if remarks else f"{len(left)} sides"
        raise DomainError(f"loop: has {count}, at least 3 are needed (a side may be cut in two)")
    chain, turned = [left.pop(0)], []
    while left:
        gaps = np.array([np.linalg.norm(side.ends - chain[-1].ends[1], axis=1) for side in left])
        k, flip = (0, 0) if gaps[0, 0] <= most else divmod(int(gaps.argmin()), 2)
        if gaps.min() > most >= np.linalg.norm(chain[0].ends[0] - chain[-1].ends[1]):
            names = ", ".join(side.name for side in left)
            raise DomainError(f"loop: is closed without {names}: islands and guides inside a hole are not taken")
        _check_gap(float(gaps[k, flip]), most, size, chain[-1], left[k])
        side = left.pop(k)
        if flip:
            turned.append(side.name)
        chain.append(side.reversed() if flip else side)
    if turned:
        remarks.append(f"{', '.join(turned)}: run through from the other end")
    _check_gap(float(np.linalg.norm(chain[0].ends[0] - chain[-1].ends[1])), most, size, chain[-1], chain[0])
    for (i, side), (j, other) in combinations(enumerate(chain), 2):
        if np.linalg.norm(side.ends[0] - other.ends[0]) <= MAX_GAP * size and 1 < j - i < len(chain) - 1:
            at = ", ".join(f"{x:.6g}" for x in side.ends[0])
            raise DomainError(f"loop: passes ({at}) twice, before {side.name} and {other.name}: fill each part alone")
    points = np.concatenate([side.points for side in chain])
    if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] <= POINT_SIZE * size:
        raise DomainError("loop: all its sides lie on one line: there is no area between them to be filled")
    starts, ends = np.moveaxis(np.array([side.ends for side in chain]), 1, 0)
    corners = (starts + np.roll(ends, 1, axis=0)) / 2
    worst = 2 * float(np.abs(corners - starts).max())
    far = worst > MAX_GAP * size
    met = [_moved(*each, far) for each in zip(chain, corners, np.roll(corners, -1, axis=0), strict=True)]
    if worst > POINT_SIZE * size:
        remarks.append(f"ends of sides are moved by up to {worst / 2:.2g}, so that they meet")
    if far and (pairs := [pair for pair in zip(chain, met, strict=True) if pair[0].across is not None]):
        sine = max(np.linalg.norm(np.cross(side_normals(a), side_normals(b)), axis=1).max() for a, b in pairs)
        remarks[-1] += f", which turns the planes along them by up to {np.degrees(np.arcsin(min(sine, 1.0))):.2g}°"
    return tuple(met), remarks


def _moved(side: HoleSide, start: FloatArray, end: FloatArray, evenly: bool) -> HoleSide:
    """Return a side with other ends; all its points go with them, less and less, if they are moved `evenly`."""
    curve, fade = side.curve.copy(), np.linspace(1, 0, len(side.curve))[:, None]
    if evenly:
        curve[:, :3] += curve[:, 3:] * (fade * (start - side.ends[0]) + fade[::-1] * (end - side.ends[1]))
    curve[0, :3], curve[-1, :3] = start, end
    return replace(side, curve=curve)


def _check_gap(gap: float, most: float, size: float, side: HoleSide, other: HoleSide) -> None:
    if gap > most:
        near = f", `weld` {above(gap)} joins them" if gap <= NEAR * size else ""
        raise DomainError(f"loop: is not closed, {side.name} ends {gap:.3g} from the nearest end, {other.name}'s{near}")
