"""Unit normals of a surface, tangents of a curve, with limits on the boundary; where none is told so: `corners`.

With respect to the torus coordinates, ``∂P/∂s = Σ_i T_i (b_i − P)(a_i − μ)ᵀ``: covariances of the control points with
any two coordinates of the knots. If a few knots hold nearly all of T, these are differences of nearly equal numbers,
unless the coordinates are exactly 0 for those knots; therefore the coordinates depend on the place.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, cross, groups
from gtb_cli.errors import DomainError
from gtb_cli.knots.about_a_knot import PARALLEL_SINE, Differences, cleared, coordinate_rounding, offsets_from
from gtb_cli.knots.domain import layers
from gtb_cli.knots.face import Face
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.moment.torus import covariance, exponents, shares
from gtb_cli.theory.basis import Location
from gtb_cli.theory.corners import limits_of_normals
from gtb_cli.theory.local_coordinates import face_layers
from gtb_cli.theory.rational_basis import Blend
from gtb_cli.vocabulary import Parametrization


def normals_at(patch: Blend, locations: Iterable[Location], count: int) -> FloatArray:
    """Return unit normals of a surface along ∂P/∂u_0 × ∂P/∂u_1, (count, 3), at locations; NaN where it has none.

    Inside, moments are taken about the nearest corner, in heights over its two edges, which are exact zeros for the
    knots that dominate near the boundary. If this still loses digits (a heavy knot inside, large exponents), they are
    taken about the knot with the largest T_i, along and across the direction to the second. For limits on the boundary
    see `Patch.normals`. `DomainError` is raised for a curve.
    """
    if patch.rational_basis.domain.dimension == 1:
        raise DomainError("normals: a curve has none")
    result = np.empty((count, 3))
    for location in locations:
        if location.face.is_interior:
            e = exponents(location.knots, patch.rational_basis.log_weights, location.s)
            normals, doubtful = _about_corners(patch, shares(e))
            if doubtful.any():
                normals[doubtful] = _about_leaders(patch, e[:, doubtful])
            result[location.rows] = normals
        elif location.face.is_corner:
            result[location.rows] = _at_corner(patch, location.face)
        else:
            result[location.rows] = on_edge([patch], location.face.index, location.s)[0]
    return result


def _about_corners(patch: Blend, t: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return normals at (n, m) values of the rational basis, (m, 3), and mark normals that may have lost digits."""
    cancelled = 1e-3  # three digits are lost in a derivative so much smaller than its summands, or in such an angle
    cut_off_sum = 1e-280  # smaller sums may consist only of exponentials cut off at `UNDERFLOW_EXPONENT`
    shape = patch.rational_basis.domain
    heights = shape.heights.T @ t
    r, columns = len(shape.vertices), np.arange(heights.shape[1])
    distance = heights / shape.normal_lengths[:, None]
    edge = shape.nearest_edge(heights)
    corner = np.where(distance[(edge + 1) % r, columns] < distance[edge - 1, columns], (edge + 1) % r, edge)
    points = patch.control_points - (patch.control_points.min(axis=0) + patch.control_points.max(axis=0)) / 2
    extent = np.abs(points).max()
    result = np.empty((heights.shape[1], 3))
    doubtful = np.empty(heights.shape[1], dtype=bool)
    for k, here in groups(corner):
        eta = shape.heights[:, [k - 1, k]] / shape.size
        part = t[:, here]
        mean, middle = points.T @ part, eta.T @ part
        first, second = ((points * eta[:, [axis]]).T @ part - mean * middle[axis] for axis in (0, 1))
        result[here], sine = _unit_cross(first, second)
        doubtful[here] = ~((sine > cancelled) & (middle > cut_off_sum).all(axis=0))
        for derivative, summed in zip((first, second), middle, strict=True):
            doubtful[here] |= np.abs(derivative).max(axis=0) < cancelled * extent * summed
    return result, doubtful


def _about_leaders(patch: Blend, e: FloatArray) -> FloatArray:
    result = np.empty((e.shape[1], 3))
    for k, here in groups(e.argmax(axis=0)):
        about, part = Differences(patch.rational_basis.domain, k), e[:, here]
        deltas = offsets_from(patch.control_points, k)
        mean = deltas.T @ shares(part)
        second = np.where(about.lengths[:, None] > 0, part, -np.inf).argmax(axis=0)
        axes = about.along(second), about.across(second)
        result[here], _ = _unit_cross(*(covariance(part, axis, deltas, mean) for axis in axes))
    return result


def _about_point(patch: Blend, edge: int, s: FloatArray) -> FloatArray:
    """Return the limits of normals, (m, 3), at (m,) torus coordinates on a collapsed edge.

    Of each triple one knot is on the edge. Areas are affine in its place, so that its mean stands for all of them, and
    the sum is over pairs of the other knots.
    """
    block = 1 << 20  # pairs of knots times places on the edge, which bounds the memory
    shape, log_weights = patch.rational_basis.domain, patch.rational_basis.log_weights
    along, height, members = shape.along(edge, shape.knots), shape.heights[:, edge], shape.incidence[:, edge]
    place = along[members] @ shares(exponents(along[members, None], log_weights[members], s[None]))
    j, k, crosses = _pairs(offsets_from(patch.control_points, int(members.argmax())), height)
    sums = height[j] + height[k]
    result = np.full((len(s), 3), np.nan)
    todo = np.arange(len(s))
    for group in layers(sums) if len(sums) else ():
        b, c = j[group, None], k[group, None]
        for rows in np.array_split(todo, 1 + len(group) * len(todo) // block):
            logarithms = (along[b] + along[c]) * s[rows] + (log_weights[b] + log_weights[c])
            first, second = ((along[x] - place[rows]) * height[y] for x, y in ((b, c), (c, b)))
            weights = shares(logarithms)
            size = np.sqrt((crosses[group] ** 2).sum(axis=1)) @ (weights * (np.abs(first) + np.abs(second)))
            total = crosses[group].T @ (weights * (first - second))
            length = np.sqrt((total**2).sum(axis=0))
            good = length > PARALLEL_SINE * size  # else rounding beside the sum of lengths
            result[rows] = np.where(good, total / np.where(good, length, 1.0), np.nan).T
        todo = todo[np.isnan(result[todo, 0])]
        if not len(todo):
            break
    return result


def _pairs(deltas: FloatArray, distance: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return (p,) knots j and k, and their (p, 3) products ``(b_j − b_i) × (b_k − b_i)`` that are not zero.

    Normals have the direction of ``Σ T_i T_j T_k [a_i, a_j, a_k] (b_j − b_i) × (b_k − b_i)`` over all triples. Knot i
    lies on a collapsed edge, whose control points are equal, so that pairs of other knots remain: they lead unless T
    cancels. Products that are zero to rounding are left out, however large their T.
    """
    nearest = 1024  # to the collapsed edge: half a million pairs of knots take 60 MB
    near = np.sort(np.argsort(distance, kind="stable")[:nearest])
    near = near[deltas[near].any(axis=1)]
    j, k = near[np.array(np.triu_indices(len(near), 1))]
    lengths = np.sqrt((deltas**2).sum(axis=1))
    crosses = cross(deltas[j], deltas[k])
    kept = np.abs(crosses).max(axis=1) > PARALLEL_SINE * lengths[j] * lengths[k]
    return j[kept], k[kept], crosses[kept]


def _at_corner(patch: Blend, face: Face) -> FloatArray:
    """Return the limit of normals at a corner, (3,); NaN if there is none, or there are several."""
    # Mostly it is the cross product of the ways to the next knots along both edges, but knots inside may be lower.
    shape, log_weights = patch.rational_basis.domain, patch.rational_basis.log_weights
    before, after, at_corner = face.index - 1, face.index, np.flatnonzero(face.knots)
    deltas = offsets_from(patch.control_points, int(at_corner[0]))
    if not face_layers(shape, face).slow.any():
        edges = (after, before), (before, after)
        rises = [np.where(shape.incidence[:, edge], shape.heights[:, other], 0.0) for edge, other in edges]
        ends = [next(layers(rise)) for rise in rises]
        middle, *ways = (_mean(deltas, log_weights, knots) for knots in (at_corner, *ends))
        rounding = coordinate_rounding(patch.control_points)
        normal = _unit_cross(*(cleared(way - middle, rounding) for way in ways))[0][0]
        if np.isfinite(normal[0]):
            return np.asarray(normal)
    return limits_of_normals(patch, face.index).normal


def on_edge(patches: Sequence[Blend], edge: int, s: FloatArray) -> FloatArray:
    """Return normals on an edge of q surfaces with one domain, (q, m, 3), at (q, m) torus coordinates; NaN if none."""
    shape = patches[0].rational_basis.domain
    members = np.flatnonzero(shape.incidence[:, edge])
    along = shape.along(edge, shape.knots)
    log_weights = np.array([patch.rational_basis.log_weights for patch in patches])
    rounding = np.array([coordinate_rounding(patch.control_points) for patch in patches])[:, None, None]
    points = np.array([patch.control_points for patch in patches])

    def logarithms(knots: IntArray, columns: IntArray) -> FloatArray:
        return np.asarray(along[knots, None] * s[:, None, columns] + log_weights[:, knots, None])

    leader = logarithms(members, np.arange(s.shape[1])).argmax(axis=1)
    result = np.full((*s.shape, 3), np.nan)
    for k in range(len(members)):
        led = leader == k
        rows = np.flatnonzero(led.any(axis=0))
        deltas = cleared(points - points[:, [members[k]]], rounding)
        e, own = logarithms(members, rows), deltas[:, members]
        position = own.swapaxes(1, 2) @ shares(e)
        step = cleared(along[members] - along[members[k]], knot_tolerance(shape.knots))
        tangent = covariance(e, step[:, None], own, position)
        for layer in layers(shape.heights[:, edge]):
            if not len(rows):
                break
            towards = cleared(deltas[:, layer].swapaxes(1, 2) @ shares(logarithms(layer, rows)) - position, rounding)
            found = result[:, rows]
            result[:, rows] = np.where(led[:, rows, None] & np.isnan(found), _unit_cross(tangent, towards)[0], found)
            todo = (np.isnan(result[:, rows, 0]) & led[:, rows]).any(axis=0)
            rows, tangent, position = rows[todo], tangent[:, :, todo], position[:, :, todo]
    for patch, normals, coordinates in zip(patches, result, s, strict=True):
        lost = np.flatnonzero(np.isnan(normals[:, 0]))
        if len(lost) and not offsets_from(patch.control_points, int(members[0]))[members].any():
            normals[lost] = _about_point(patch, edge, coordinates[lost])
    return result


def _unit_cross(first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return unit cross products of (…, 3, m) vectors, (…, m, 3), NaN if parallel or zero; and sines of angles."""
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (_unit_columns(v) for v in (first, second))
        normal = cross(first, second, -2)
        sine = np.sqrt((normal**2).sum(axis=-2))
        across = sine[..., None, :]
        return np.where(across > PARALLEL_SINE, normal / across, np.nan).swapaxes(-1, -2), sine


def _unit_columns(vectors: FloatArray) -> FloatArray:
    """Scale (…, 3, m) columns to length 1, by their largest entries first, so that squares do not underflow."""
    scaled = vectors / np.abs(vectors).max(axis=-2, keepdims=True)
    return np.asarray(scaled / np.sqrt((scaled**2).sum(axis=-2, keepdims=True)))


def tangents(patch: Blend, t: ArrayLike, parametrization: Parametrization = "toric") -> FloatArray:
    """Return unit tangents of a curve at parameters, (…) or (…, 1) → (…, 3); see `Patch.tangents`."""
    shape = patch.rational_basis.domain
    if shape.dimension != 1:
        raise DomainError("tangents: a surface has many at a point, expected a curve")
    columns, grid = shape.grid(t)
    result = np.empty((len(columns), 3))
    for location in patch.rational_basis.locations(columns, parametrization):
        if location.face.is_corner:
            result[location.rows] = _tangent_at_end(patch, location.face.index)
        else:
            result[location.rows] = _tangents_inside(patch, location)
    return result.reshape(*grid, 3)


def _tangents_inside(patch: Blend, location: Location) -> FloatArray:
    """Normalise ``Σ_i T_i (a_i − μ)(b_i − P)``, taken about the knot with the largest T to keep digits at the ends."""
    knots = patch.rational_basis.domain.knots
    e = exponents(location.knots, patch.rational_basis.log_weights, location.s)
    result = np.empty((e.shape[1], 3))
    for k, rows in groups(e.argmax(axis=0)):
        deltas = offsets_from(patch.control_points, k)
        step, part = cleared(knots - knots[k], knot_tolerance(knots)), e[:, rows]
        derivative = covariance(part, step, deltas, deltas.T @ shares(part))
        known = np.abs(derivative).max(axis=0) > PARALLEL_SINE * np.abs(step).max() * np.abs(deltas).max()
        result[rows] = _unit_columns(np.where(known, derivative, np.nan)).T
    return result


def _tangent_at_end(patch: Blend, end: int) -> FloatArray:
    basis = patch.rational_basis
    heights = basis.domain.heights[:, end]
    at_end = np.flatnonzero(heights == 0)
    deltas = offsets_from(patch.control_points, int(at_end[0]))
    place, *places = (_mean(deltas, basis.log_weights, knots) for knots in (at_end, *layers(heights)))
    for step in (other - place for other in places):
        if np.abs(step).max() > coordinate_rounding(patch.control_points):
            return np.asarray(_unit_columns(step)[:, 0] * (1.0 if end == 0 else -1.0))
    return np.full(3, np.nan)


def _mean(deltas: FloatArray, log_weights: FloatArray, knots: IntArray) -> FloatArray:
    """Return the mean of some knots' (n, 3) points under their weights, (3, 1)."""
    return np.asarray(deltas[knots].T @ shares(log_weights[knots, None]))
