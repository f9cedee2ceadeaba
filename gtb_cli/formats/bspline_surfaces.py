"""Patches as rational B-spline surfaces for CAD: exact Bézier rectangles if possible, otherwise fitted surfaces."""

import math
from collections.abc import Callable
from functools import partial
from itertools import chain
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.bezier.pieces import MAX_DEGREE, bezier_pieces
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.knots.lattice import binomial_coefficients, lattice_of
from gtb_cli.models.joints import Joint
from gtb_cli.models.model import Model
from gtb_cli.theory.edges import EdgeRef
from gtb_cli.theory.patch import Patch


class SplineSurface(NamedTuple):
    """A rational B-spline surface that becomes one face of its patch: clamped knots, (m, n, 4) points and weights."""

    name: str
    degrees: tuple[int, int]
    knots: tuple[FloatArray, FloatArray]
    net: FloatArray


class SplineSurfaces(NamedTuple):
    """Surfaces for CAD, in the order of the patches, and how good the `fitted` ones are, at sample points.

    `error` is their largest distance from the patches; `bend` the largest angle in degrees between the tangent planes
    of two of one patch along their common edge. `reasons` are the names of fitted patches, and why they are fitted.
    """

    surfaces: tuple[SplineSurface, ...]
    fitted: int
    error: float
    bend: float
    reasons: tuple[tuple[str, str], ...]


class HalfEdge(NamedTuple):
    """Half of an edge, as an adjacent fitted surface takes it over.

    Its (D + 1, 4) control points and weights, which are 1 at both ends, start at a corner; the fractions are their
    places along the whole edge. If it is not exact, only these places are taken over. `own` turns these fractions into
    those of the fitted surface's edge, from the same corner.
    """

    rows: FloatArray
    fractions: FloatArray
    is_exact: bool = True
    own: Callable[[FloatArray], FloatArray] | None = None

    def at(self, t: FloatArray) -> tuple[FloatArray | None, FloatArray, FloatArray]:
        """Return (k, 3) points at (k,) parameters in [0, 1], their weights, and places as fractions of this half."""
        degree = len(self.rows) - 1
        k = np.arange(degree + 1)
        shares = np.array([math.comb(degree, j) for j in k]) * t[:, None] ** k * (1 - t[:, None]) ** (degree - k)
        shares = shares * self.rows[:, 3]
        weights = shares.sum(axis=1)
        points = shares @ self.rows[:, :3] / weights[:, None] if self.is_exact else None
        if self.own is None:
            return points, weights, shares @ self.fractions / (weights * self.end)
        return points, weights, self.own(shares @ self.fractions / weights) / self.end

    @property
    def end(self) -> float:
        """The end of this half, as a fraction of the edge."""
        return float(self.fractions[-1] if self.own is None else self.own(self.fractions[-1:])[0])


def spline_surfaces(spec: Patch | Model, tolerance: float | None = None) -> SplineSurfaces:
    """Return the surfaces of a patch or model as rational B-splines.

    A patch with Bézier pieces becomes these: one for a tensor product patch, r for a patch with r corners. Any other
    patch is fitted by r surfaces between the corners, places inside the edges and the centroid of Δ, in the linear
    parametrisation. An edge shared by fitted patches is the same spline in both; an edge shared with an exact patch is
    the exact curve, to rounding.

    A `DomainError` refuses curves; a `ToleranceError` says that even 128 spans in each direction do not reach the
    tolerance, in model units; without one it is 1e-4 of the largest extent of all control points.
    """
    spans = (8, 16, 32, 64, 128)  # in each direction of a fitted surface, tried in turn
    patches = spec.patches
    if patches[0].dimension == 1:
        raise DomainError("is a curve, and CAD files are made of surfaces")
    exact: dict[int, list[SplineSurface]] = {}
    reasons: dict[int, str] = {}
    for index, patch in enumerate(patches):
        try:
            exact[index] = [_balanced(surface) for surface in exact_surfaces(patch, index)]
        except DomainError as fault:
            reasons[index] = str(fault)
    if not reasons:
        return SplineSurfaces(tuple(chain.from_iterable(exact.values())), 0, 0.0, 0.0, ())
    edges = _exact_edges(spec, exact, reasons) if isinstance(spec, Model) else {}
    degree = max([3, *(len(half.rows) - 1 for halves in edges.values() for half in halves)])
    points = np.concatenate([patch.control_points for patch in patches])
    size = float(np.ptp(points, axis=0).max())
    allowed = 1e-4 * size if tolerance is None else tolerance
    for segments in spans:
        fitted = {index: _fitted(patches[index], index, segments, degree, edges) for index in reasons}
        error = max(found for _, found in fitted.values())
        if error <= allowed:
            surfaces = [exact[index] if index in exact else fitted[index][0] for index in range(len(patches))]
            names = tuple((_name(patches[index], index), why) for index, why in sorted(reasons.items()))
            count = sum(len(found) for found, _ in fitted.values())
            bend = max(_bend(found) for found, _ in fitted.values())
            return SplineSurfaces(tuple(chain.from_iterable(surfaces)), count, error, bend, names)
    raise ToleranceError(
        f"fitted surfaces of {spans[-1]} × {spans[-1]} spans are still {error:.3g} off, more than {allowed:.3g}"
    )


def _exact_edges(
    model: Model, exact: dict[int, list[SplineSurface]], reasons: dict[int, str]
) -> dict[EdgeRef, list[HalfEdge]]:
    """Return the halves of the edges that fitted patches share, from the start and from the end of each edge.

    An edge is shared with an exact patch, or with another fitted one at other fractions. An exact patch whose edges
    have too high a degree for its neighbours becomes a fitted one.
    """
    # Edges of one pillow in several degrees agree to 3e-7 up to degree 16, and not at all at 25.
    most = 16
    even = HalfEdge(np.array([[0.0, 0.0, 0.0, 1.0]] * 2), np.array([0.0, 0.5]), False)  # by equal fractions
    groups: dict[EdgeRef, list[Joint]] = {}
    for joint in model.joints.shared:
        groups.setdefault(joint.first, [Joint(joint.first, joint.first, False)]).append(joint)
    while True:
        found: dict[EdgeRef, list[HalfEdge]] = {}
        for uses in groups.values():
            whole = [use for use in uses if use.second[0] in exact]
            fitted = [use for use in uses if use.second[0] in reasons]
            if not whole:
                found |= {use.second: _carried([even] * 2, model, uses[0], use) for use in fitted if use.match}
            if not whole or not fitted:
                continue
            index, edge = whole[0].second
            halves = _halves(model[index], edge)
            if len(halves[0].rows) - 1 > most:
                del exact[index]
                reasons[index] = (
                    f"has exact pieces of a degree above {most} on its edge {edge}, which it shares with "
                    f"{_name(model[fitted[0].second[0]], fitted[0].second[0])}, that has none"
                )
                break
            found |= {use.second: _carried(halves, model, whole[0], use) for use in fitted}
        else:
            return found


def _carried(halves: list[HalfEdge], model: Model, one: Joint, other: Joint) -> list[HalfEdge]:
    """Return the halves of an edge for another one, both joined with the same first edge."""
    turned = one.opposite != other.opposite
    if one.match or other.match:

        def own(fractions: FloatArray, is_last: int) -> FloatArray:
            first = one.back(model.patches, 1 - fractions if is_last else fractions)
            found = other.across(model.patches, first)
            return 1 - found if is_last != turned else found

        halves = [half._replace(own=partial(own, is_last=k)) for k, half in enumerate(halves)]
    return halves[::-1] if turned else halves


def _halves(patch: Patch, edge: int) -> list[HalfEdge]:
    """Return the exact halves of an edge, each starting at its own end of the edge."""
    curve = patch.boundary(edge)
    places = np.zeros((len(curve.knots), 3))
    places[:, 0] = curve.knots[:, 0] / curve.knots[:, 0].max()
    halves = []
    pairs = zip(bezier_pieces(curve), bezier_pieces(curve.replace(control_points=places)), strict=True)
    for side, (half, placed) in enumerate(pairs):
        way = slice(None, None, -1) if side else slice(None)
        rows, fractions = homogeneous_points(half)[way], placed.control_points[way, 0]
        degree = len(rows) - 1
        powers = np.log(rows[:, 3])
        rows[:, 3] = np.exp(powers - powers[0] + (powers[0] - powers[-1]) * np.arange(degree + 1) / degree)
        halves.append(HalfEdge(rows, 1 - fractions if side else fractions))
    return halves


def exact_surfaces(patch: Patch, index: int = 0) -> list[SplineSurface]:
    """Return the Bézier rectangles of a patch: the patch itself, if it is one, or its pieces.

    A `DomainError` says why there are none of a degree that CAD kernels accept.
    """
    name = _name(patch, index)
    lattice = lattice_of(patch.domain)
    if lattice is not None and len(lattice) == 2 and max(direction.degree for direction in lattice) <= MAX_DEGREE:
        first, second = lattice
        net = np.empty((first.degree + 1, second.degree + 1, 4))
        net[first.places[:, 1], second.places[:, 1]] = homogeneous_points(patch)
        return [_bezier(name, net)]
    surfaces = []
    for piece in bezier_pieces(patch, MAX_DEGREE):
        along, across = (int(degree) + 1 for degree in piece.knots.max(axis=0))
        surfaces.append(_bezier(name, homogeneous_points(piece).reshape(across, along, 4).transpose(1, 0, 2)))
    return surfaces


def _balanced(surface: SplineSurface) -> SplineSurface:
    """Multiply the weights by l^i m^j, so that their range is least: the image is the same, at other parameters."""
    ample = 1e3  # ratio of weights that kernels take as it is
    logs = np.log(surface.net[..., 3])
    if np.ptp(logs) < math.log(ample):
        return surface
    rows = np.column_stack([np.ones(logs.size), np.indices(logs.shape).reshape(2, -1).T])
    rest = logs - (rows @ np.linalg.lstsq(rows, logs.ravel())[0]).reshape(logs.shape)
    return surface._replace(net=np.dstack([surface.net[..., :3], np.exp(rest - rest.max())]))


def homogeneous_points(patch: Patch) -> FloatArray:
    """Return (n, 4) control points and Bézier weights: the products c ω divided by the binomials."""
    least = 1e-12  # relative to the largest weight: below it, a kernel's derivatives lose all digits
    logs = patch.log_products - np.log(binomial_coefficients(patch.domain))
    weights = np.exp(logs - logs.max())
    if weights.min() < least:
        raise DomainError(f"has weights in a range beyond {1 / least:g}, which programs for such surfaces do not take")
    return np.column_stack([patch.control_points, weights])


def _bezier(name: str, net: FloatArray) -> SplineSurface:
    m, n = net.shape[:2]
    knots = tuple(np.repeat([0.0, 1.0], count) for count in (m, n))
    return SplineSurface(name, (m - 1, n - 1), (knots[0], knots[1]), net)


def _name(patch: Patch, index: int) -> str:
    return patch.name or f"patch-{index}"


def _fitted(
    patch: Patch, index: int, segments: int, degree: int, edges: dict[EdgeRef, list[HalfEdge]]
) -> tuple[list[SplineSurface], float]:
    """Return interpolants of a patch's quarters, and their largest error between the points.

    Next to an exact edge they interpolate homogeneous points, with weights that are 1 where quarters meet.
    """
    from scipy.interpolate import make_interp_spline

    v = patch.domain.vertices
    r = len(v)
    halves = [edges.get((index, k), [None, None]) for k in range(r)]
    shares = np.array([0.5 if half is None else half.end for half, _ in halves])[:, None]
    middles = (1 - shares) * v + shares * np.roll(v, -1, axis=0)
    center = v.mean(axis=0)
    # Denser towards the edges of Δ, where a patch with real knots may have no second derivative: with 16 spans on eight
    # patches, the exponent 1 leaves up to 4e-4 of the size, 2 up to 3e-5.
    knots = np.pad(np.linspace(0.0, 1.0, segments + 1) ** 2.0, degree, mode="edge")
    # Greville's points: an interpolating spline of any degree does not oscillate between them.
    coarse = np.convolve(knots, np.full(degree, 1 / degree), "valid")[1:-1]
    coarse[-1] = 1.0
    fine = np.sort(np.concatenate([coarse, (coarse[1:] + coarse[:-1]) / 2]))
    surfaces, worst = [], 0.0
    for k in range(r):
        corners = np.array([[v[k], middles[k - 1]], [middles[k], center]])
        points, weights = _points(patch, k, corners, fine, halves[k][0], halves[k - 1][1])
        rows = np.concatenate([points * weights[..., None], weights[..., None]], axis=2)
        first = make_interp_spline(coarse, rows[::2, ::2], degree, t=knots, axis=0)
        second = make_interp_spline(coarse, first.c, degree, t=knots, axis=1)
        net = np.moveaxis(np.asarray(second.c), 0, 1)
        values = np.asarray(make_interp_spline(coarse, first(fine), degree, t=knots, axis=1)(fine))
        if min(net[..., 3].min(), values[..., 3].min()) <= 0:
            worst = np.inf
            continue
        worst = max(worst, float(np.sqrt(((values[..., :3] / values[..., 3:] - points) ** 2).sum(axis=2)).max()))
        net[..., :3] /= net[..., 3:]
        if (weights == 1).all():
            net[..., 3] = 1.0
        surfaces.append(SplineSurface(_name(patch, index), (degree, degree), (knots, knots), net))
    return surfaces, worst


def _bend(quarters: list[SplineSurface]) -> float:
    """Return the largest angle in degrees between the tangent planes of successive quarters along their seams.

    A quarter meets the next one where its first parameter is 1, and the one before where its second parameter is 1.
    """
    parts = 8  # of each span: between, angles are a hundredth larger at most, save beside an edge that is one point
    spans = np.unique(quarters[0].knots[0])
    places = np.interp(np.arange(parts * (len(spans) - 1) + 1) / parts, np.arange(len(spans)), spans)
    worst = 0.0
    for k, quarter in enumerate(quarters):
        one, other = _seam_normals(quarter, 0, places), _seam_normals(quarters[(k + 1) % len(quarters)], 1, places)
        sines, cosines = np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1)
        worst = max(worst, float(np.degrees(np.arctan2(sines, cosines)).max()))
    return worst


def _seam_normals(surface: SplineSurface, axis: int, places: FloatArray) -> FloatArray:
    """Return (k, 3) unit normals (0 where there is none) at (k,) places of the edge at the end of an axis."""
    from scipy.interpolate import BSpline

    rounding = 1e-9  # of the longest derivatives' product: below it, as on an edge without length, there is no normal
    rows = np.moveaxis(surface.net, axis, 0)[[-1, -2]]
    rows = np.concatenate([rows[..., :3] * rows[..., 3:], rows[..., 3:]], axis=2)
    edge = BSpline(surface.knots[1 - axis], rows[0], surface.degrees[1 - axis])
    values = edge(places)
    points = values[:, :3] / values[:, 3:]
    # Derivatives of rational points, but for a positive factor, which directions do not need.
    rates = [spline(places) for spline in (edge.derivative(), BSpline(edge.t, rows[0] - rows[1], edge.k))]
    along, across = (rate[:, :3] - points * rate[:, 3:] for rate in rates)
    normals = np.cross(across, along) if axis == 0 else np.cross(along, across)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    least = rounding * np.linalg.norm(along, axis=1).max() * np.linalg.norm(across, axis=1).max()
    return np.where(lengths > least, normals, 0.0) / np.where(lengths > 0, lengths, 1.0)


def _points(
    patch: Patch, corner: int, corners: FloatArray, places: FloatArray, along: HalfEdge | None, back: HalfEdge | None
) -> tuple[FloatArray, FloatArray]:
    """Return (k, k, 3) points on the quarter about a corner, and (k, k) weights; points of edges are exact.

    `along` and `back` are the halves of the edges after and before the corner, if these are exact. Places on the lines
    to the centroid do not depend on them, so that they are the same in the next quarter.
    """
    s, t = places[:, None], places[None, :]
    weights = np.ones((len(places), len(places)))
    exact: list[tuple[FloatArray, FloatArray | None]] = []
    for half, mine, other in ((along, s, t), (back, t, s)):
        if half is None:
            exact.append((mine, None))
            continue
        curve, factors, moved = half.at(places)
        weights = weights * (1 + (factors.reshape(mine.shape) - 1) * (1 - other))
        exact.append((mine + (moved.reshape(mine.shape) - mine) * (1 - other), curve))
    (s, first), (t, second) = exact
    s, t = s[..., None], t[..., None]
    p = (1 - s) * ((1 - t) * corners[0, 0] + t * corners[0, 1]) + s * ((1 - t) * corners[1, 0] + t * corners[1, 1])
    shape = patch.domain
    r = len(shape.vertices)
    faces = np.zeros(p.shape[:2], dtype=np.int64)
    faces[:, 0] = shape.faces.edge(corner).number
    faces[0, :] = shape.faces.edge((corner - 1) % r).number
    faces[0, 0] = shape.faces.corner(corner).number
    flat = p.reshape(-1, 2)
    locations = patch.rational_basis.locations(flat, "linear", faces.ravel())
    points = patch.points_at(locations, len(flat)).reshape(*p.shape[:2], 3)
    if first is not None:
        points[:, 0] = first
    if second is not None:
        points[0] = second
    return points, weights
