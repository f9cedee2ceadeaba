"""Gaussian and mean curvature of a surface, with their limits on the boundary.

Derivatives with respect to the torus coordinates are moments under T: ``∂P = Σ_i T_i b_i (a_i − μ)`` and ``∂²P = Σ_i
T_i (b_i − P)(a_i − μ)(a_i − μ)ᵀ``. Curvatures do not depend on the coordinates. In the product of ∂²P with the normal,
any quadratic function of a_i with the same Hessian may replace (a_i − μ)(a_i − μ)ᵀ, since moments with affine functions
are tangents. We take coordinates ξ, η that are 0 and 1 at the three knots with most of T, and the quadratic functions
ξ(ξ − 1), ξη and η(η − 1). These vanish at all three knots, so that no digits are lost near an edge or a corner. The
limit there keeps only the knots whose T vanishes last.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import EPS, BoolArray, FloatArray, cross_of_columns, groups
from gtb_cli.errors import DomainError
from gtb_cli.knots.differences import PARALLEL_SINE, Differences, cleared, coordinate_rounding
from gtb_cli.knots.layers import LAYER_TOLERANCE
from gtb_cli.moment.torus import UNDERFLOW_EXPONENT, block_length, exponents
from gtb_cli.theory.basis import Location
from gtb_cli.theory.parametrization import Parametrization
from gtb_cli.theory.patch import Patch


class Curvature(NamedTuple):
    """(m,) curvatures of a surface at points; NaN without a finite limit.

    K = κ₁ κ₂ is in units of 1 / length², H = (κ₁ + κ₂) / 2 in units of 1 / length. H is positive if the surface bends
    away from its normal: 1 / R for a sphere with outward normals.
    """

    gaussian: FloatArray
    mean: FloatArray


def curvature(patch: Patch, u: ArrayLike, parametrization: Parametrization = "toric") -> Curvature:
    """Gaussian and mean curvature of a surface at (m, 2) parameters, with respect to the normals of `Patch.normals`.

    Values on edges and at corners are limits, computed by formula. Let δ < δ' be the distances of the two layers of
    knots next to an edge. The curvature across the edge has a limit if δ' ≥ 2δ. If δ' < 2δ, it generally grows like
    h^(δ'/δ − 2), where h is the distance in the linear parametrisation. At a corner the condition must hold for both
    edges, and no knot inside may be nearer to either than the first layer. Without a limit or a normal, values are NaN.

    The relative error inside is a few roundings divided by the sine of the angle between the derivatives, however near
    the boundary is. `DomainError` is raised for a curve, and for a parameter outside Δ.
    """
    columns = patch.domain.columns(u)
    found = curvatures_at([patch], patch.rational_basis.locations(columns, parametrization), len(columns))
    return Curvature(found.gaussian[0], found.mean[0])


def curvatures_at(patches: Sequence[Patch], where: Iterable[Location], count: int) -> Curvature:
    """(q, count) curvatures of q patches that share one rational basis: what does not depend on points is made once."""
    field = _CurvatureField(patches)
    gaussian, mean = np.empty((len(patches), count)), np.empty((len(patches), count))
    for location in where:
        gaussian[:, location.rows], mean[:, location.rows] = field.at(location)
    return Curvature(gaussian, mean)


class _Layers(NamedTuple):
    """(n,) bool each: the knots that count in each sum, and those that prevent a limit unless they are in the plane.

    Inside Δ all knots count in all sums. With ξ and η of `_CurvatureField`, a limit on an edge is a sum over the knots
    with one value of η; a limit at a corner is a sum over the knots with one value of ξ and of η.
    """

    point: BoolArray
    xi: BoolArray
    eta: BoolArray
    xi_xi: BoolArray
    xi_eta: BoolArray
    eta_eta: BoolArray
    against: BoolArray


class _CurvatureField:
    """Curvatures of q patches with one basis; data that do not depend on the place are computed once."""

    def __init__(self, patches: Sequence[Patch]) -> None:
        if patches[0].dimension == 1:
            raise DomainError("curvature: Gaussian and mean curvature are a surface's, this is a curve")
        self.domain = patches[0].domain
        self.log_weights = patches[0].log_products
        points = np.array([patch.control_points for patch in patches])
        points -= (points.min(axis=1, keepdims=True) + points.max(axis=1, keepdims=True)) / 2
        # If points have size 1, no product of derivatives leaves the range of floats.
        extent = np.abs(points).max(axis=(1, 2))
        self.extent = np.where(extent > 0, extent, 1.0)[:, None]
        self.points = points / self.extent[:, :, None]
        self.rounding = np.array([[coordinate_rounding(patch.control_points)] for patch in patches]) / self.extent

    def at(self, location: Location) -> Curvature:
        """(q, m) curvatures at the m parameters of a location."""
        work_arrays = 12  # as large as T, alive at once
        shape, face = self.domain, location.face
        n = len(shape.knots)
        if face.is_interior:
            every = np.ones(n, dtype=bool)
            layers = _Layers(every, every, every, every, every, every, against=~every)
            knots = location.knots
        elif face.is_corner:
            layers = self._corner_layers(face.index)
            knots = np.zeros((n, 0))
        else:
            layers = self._edge_layers(face.index)
            knots = shape.along(face.index, shape.knots)[:, None]
        count = location.s.shape[1]
        gaussian, mean = np.empty((len(self.points), count)), np.empty((len(self.points), count))
        step = max(64, block_length(n) // work_arrays)
        for begin in range(0, count, step):
            block = slice(begin, begin + step)
            e = exponents(knots, self.log_weights, location.s[:, block])
            gaussian[:, block], mean[:, block] = self._curvatures(e, layers)
        with np.errstate(over="ignore"):  # of a surface smaller than the smallest square
            return Curvature(gaussian / self.extent / self.extent, mean / self.extent)

    def _edge_layers(self, edge: int) -> _Layers:
        level = _levels(self.domain.heights[:, edge])
        on, first, second = (level == k for k in (0, 1, 2))
        return _Layers(on, on, first, on, first, second, against=(level > 1) & (level < 2))

    def _corner_layers(self, corner: int) -> _Layers:
        """The layers at a corner; ξ runs along the edge that starts there, η along the one that ends there."""
        heights, incidence = self.domain.heights, self.domain.incidence
        before, after = (corner - 1) % heights.shape[1], corner
        xi = _levels(heights[:, before], incidence[:, after])
        eta = _levels(heights[:, after], incidence[:, before])
        slow = ((xi > 0) & (xi < 1)) | ((eta > 0) & (eta < 1))
        slow |= ((xi > 1) & (xi < 2)) | ((eta > 1) & (eta < 2))
        point, first, second = ((xi == i) & (eta == 0) for i in (0, 1, 2))
        other_first, other_second = ((xi == 0) & (eta == j) for j in (1, 2))
        return _Layers(point, first, other_first, second, (xi == 1) & (eta == 1), other_second, against=slow)

    def _curvatures(self, e: FloatArray, layers: _Layers) -> Curvature:
        """Curvatures from the (n, m) logarithms of T, up to a constant per column."""
        leader = np.where(layers.point[:, None], e, -np.inf).argmax(axis=0)
        gaussian, mean = np.empty((len(self.points), e.shape[1])), np.empty((len(self.points), e.shape[1]))
        for k, here in groups(leader):
            gaussian[:, here], mean[:, here] = self._about(k, e[:, here] - e[k, here], layers)
        return Curvature(gaussian, mean)

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")  # from points without a normal or a finite limit
    def _about(self, k: int, e: FloatArray, layers: _Layers) -> Curvature:
        """Curvatures at points where knot k has the largest T; the logarithms are relative to it."""
        xi, eta, e_one, e_other, turn = _triangle(Differences(self.domain, k), e, layers)
        deltas = cleared(self.points - self.points[:, [k]], self.rounding[:, :, None])
        columns = deltas.swapaxes(1, 2)
        t = _weighted(e, layers.point, 0.0, 1.0)
        total = t.sum(axis=0)
        p = columns @ t / total
        first, second = (
            columns @ x - p * x.sum(axis=0)
            for x in (_weighted(e, layers.xi, e_one, xi), _weighted(e, layers.eta, e_other, eta))
        )
        cross = np.empty_like(first)
        cross_of_columns(first.swapaxes(0, 1), second.swapaxes(0, 1), cross.swapaxes(0, 1))
        lengths = [np.sqrt((v**2).sum(axis=1)) for v in (first, second, cross)]
        regular = lengths[2] > PARALLEL_SINE * lengths[0] * lengths[1]
        d = self._depths(deltas, p, np.where(regular[:, None], cross / lengths[2][:, None] * turn, np.nan))
        xi_xi, xi_eta, eta_eta = (
            total * (_weighted(e, members, shift, factor) * d).sum(axis=1)
            for members, shift, factor in (
                (layers.xi_xi, 2 * e_one, xi * (xi - 1)),
                (layers.xi_eta, e_one + e_other, xi * eta),
                (layers.eta_eta, 2 * e_other, eta * (eta - 1)),
            )
        )
        square, product = lengths[2] ** 2, (first * second).sum(axis=1)
        gaussian = (xi_xi * eta_eta - xi_eta**2) / square
        mean = (2 * product * xi_eta - lengths[1] ** 2 * xi_xi - lengths[0] ** 2 * eta_eta) / (2 * square)
        unlimited = (d[:, layers.against] != 0).any(axis=1) | ~np.isfinite(gaussian) | ~np.isfinite(mean)
        return Curvature(np.where(unlimited, np.nan, gaussian), np.where(unlimited, np.nan, mean))

    def _depths(self, deltas: FloatArray, p: FloatArray, normal: FloatArray) -> FloatArray:
        """(q, n, m) distances of control points from the tangent planes, with 0 in place of possible rounding."""
        d = deltas @ normal - (normal * p).sum(axis=1, keepdims=True)
        # The control points of the leading knot, and those equal to it, are as near as p is.
        near = 8 * EPS * np.sqrt((p**2).sum(axis=1, keepdims=True))
        moved = (deltas != 0).any(axis=2, keepdims=True)
        d[np.abs(d) <= np.where(moved, self.rounding[:, :, None] + near, near)] = 0.0
        return np.asarray(d)


def _triangle(about: Differences, e: FloatArray, layers: _Layers) -> tuple[FloatArray, ...]:
    """(n, m) ξ and η, (m,) logarithms of T at two more knots, and 1 if these are counter-clockwise, else −1.

    Both coordinates are 0 at the knot with the largest T; ξ is 1 at the first of the other knots and 0 at the second,
    and η vice versa. They are chosen like pivots, so that the triangle has neither little weight nor a small angle.
    """
    columns = np.arange(e.shape[1])
    one = np.where(layers.xi[:, None], e + 2 * np.log(about.lengths[:, None]), -np.inf).argmax(axis=0)
    eta = about.across(one)
    other = np.where(layers.eta[:, None], e + 2 * np.log(np.abs(eta)), -np.inf).argmax(axis=0)
    xi, turn = about.across(other), np.sign(eta[other, columns])
    return xi / xi[one, columns], eta / eta[other, columns], e[one, columns], e[other, columns], turn


def _weighted(e: FloatArray, members: BoolArray, shift: FloatArray | float, factor: FloatArray | float) -> FloatArray:
    """(n, m) factor · T up to exp(shift), for members; exact zeros are kept."""
    x = np.exp(np.clip(e - shift, UNDERFLOW_EXPONENT, -UNDERFLOW_EXPONENT)) * factor
    x[~members] = 0.0
    return np.asarray(x)


def _levels(heights: FloatArray, among: BoolArray | None = None) -> FloatArray:
    """(n,) heights over the lowest positive one (among some knots), rounded to 0, 1 and 2 within `LAYER_TOLERANCE`."""
    positive = heights > 0 if among is None else (heights > 0) & among
    level = heights / heights[positive].min()
    for whole in (1, 2):
        level[np.abs(level - whole) * heights[positive].min() <= LAYER_TOLERANCE * heights.max()] = whole
    return np.asarray(level)
