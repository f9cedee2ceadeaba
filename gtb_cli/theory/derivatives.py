"""First and second derivatives of the rational basis, and of points, in both parametrisations.

Sums ``V = Σ_i v_i f_i / Σ_i f_i`` of terms f_i are differentiated by the quotient rule. In the toric parametrisation
the terms are ``f_i = c_i ω_i Π_j h_j^{h_j(a_i)}``, with ``∂h_j/∂u = s_j ξ_j``. In the linear one they are in
`gtb_cli.theory.local_coordinates`; the chain rule needs the derivatives of the moment map, V with knots as values.
"""

from collections.abc import Callable, Iterator
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, groups
from gtb_cli.errors import DomainError
from gtb_cli.knots.about_a_knot import coordinate_rounding
from gtb_cli.knots.face import Face
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.moment.torus import UNDERFLOW_EXPONENT, block_length
from gtb_cli.theory.local_coordinates import FaceLayers, Local, Terms, neighbourhoods
from gtb_cli.theory.rational_basis import RationalBasis
from gtb_cli.values import frozen
from gtb_cli.vocabulary import Parametrization

Order: TypeAlias = Literal[1, 2]


class Jet(NamedTuple):
    """Values of k functions at m places, (k, m), their gradients, (d, k, m), and second derivatives, (d, d, k, m)."""

    value: FloatArray
    first: FloatArray
    second: FloatArray


@frozen
class DerivativeField:
    """Derivatives of k functions ``Σ_i T_i values_i`` of (n, k) values or, without values, of the n functions T_i."""

    basis: RationalBasis
    values: FloatArray | None

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")  # where there is no finite limit
    def at(self, parameters: ArrayLike, order: Order, parametrization: Parametrization) -> FloatArray:
        """Return derivatives at (…, d) parameters, (…, k, d) or (…, k, d, d); see `Patch.derivatives`."""
        shape, work_arrays = self.basis.domain, 24  # as large as T, alive at once
        u, grid = shape.grid(parameters)
        if order not in (1, 2):
            raise DomainError(f"order: expected 1 or 2, got {order!r}")
        count = len(shape.knots) if self.values is None else self.values.shape[1]
        result = np.empty((*(shape.dimension,) * order, count, len(u)))
        if parametrization == "toric":
            step = max(64, block_length(len(shape.knots)) // work_arrays)
            for begin in range(0, len(u), step):
                heights = shape.heights_of_columns(u[begin : begin + step], begin)
                for number, rows in groups(shape.faces.at(heights)):
                    for here, jet in self._toric(shape.faces[number], heights[:, rows], order):
                        result[..., begin + rows[here]] = jet[order]
        else:
            for location in self.basis.locations(u, parametrization):
                rows = np.arange(len(u))[location.rows]
                for here, local, e, layers in neighbourhoods(shape, self.basis.log_weights, location, work_arrays):
                    jet = self._linear(location.face, u[rows[here]], local, e, layers)
                    result[..., rows[here]] = jet[order]
        result[np.isnan(result)] = np.inf  # differences of numbers beyond floats
        found = np.moveaxis(result, [-1, -2], [0, 1])
        return found.reshape(*grid, *found.shape[1:])

    def _columns(self, k: int) -> FloatArray:
        """Return the values at n knots, less the values at knot k; of the T_i their values 0 and 1."""
        if self.values is None:
            return np.eye(len(self.basis.log_weights))
        return np.asarray((self.values - self.values[k]).T)

    def _sums(self, k: int) -> Callable[[FloatArray], FloatArray]:
        """Return the function that weights values, as `_columns` has them, by (n, m) terms and adds them up."""
        return (lambda terms: terms) if self.values is None else self._columns(k).__matmul__

    @cached_property
    def _rounding(self) -> float:
        return 0.0 if self.values is None else coordinate_rounding(self.values)

    @cached_property
    def _exponents(self) -> FloatArray:
        """The exponents h_j(a_i), (n, r), exactly 1 and 2 where they are to rounding."""
        shape = self.basis.domain
        whole = np.clip(np.rint(shape.heights), 0, 2)
        near = np.abs(shape.heights - whole) <= knot_tolerance(shape.knots) * shape.normal_lengths
        return np.where(near, whole, shape.heights)

    def _toric(self, face: Face, heights: FloatArray, order: Order) -> Iterator[tuple[IntArray, Jet]]:
        """Yield columns led by one knot, of (r, m) edge functions on a face, and derivatives there: with 0⁰ = 1."""
        shape, zero = self.basis.domain, np.isin(np.arange(len(heights)), face.facets)
        x = np.where(zero[:, None], 1.0, heights)
        e = self._exponents @ np.log(x) + self.basis.log_weights[:, None]
        for k, here in groups(np.where(face.knots[:, None], e, -np.inf).argmax(axis=0)):
            powers = self._exponents - np.where(zero, 0.0, self._exponents[k])
            directions = shape.normals[:, :, None] / x[:, None, here]
            jet = jet_of(_power_terms(powers, zero, e[:, here] - e[k, here], directions, order), self._sums(k))
            for facet in face.facets.tolist():
                self._mark(jet, facet, face, k)
            yield here, jet

    def _mark(self, jet: Jet, facet: int, face: Face, k: int) -> None:
        """Write inf where powers of an edge function, 0 here, have no finite derivative."""
        normal = self._normal(facet)
        across = np.outer(normal, normal) != 0
        first, second = (_unlimited(self._exponents[:, facet], order) & ~face.knots for order in (1, 2))
        slopes, bends = (
            (np.abs(self._columns(k)[:, knots, None] - jet.value[:, None]) > self._rounding).any(axis=1)
            for knots in (first, second)
        )
        jet.second[across] = np.where(bends, np.inf, jet.second[across])
        if first.any() and len(normal) == 2:
            along = np.array([-normal[1], normal[0]])
            mixed = np.outer(normal, along) + np.outer(along, normal) != 0
            moves = slopes | (np.einsum("a,akm->km", along, jet.first) != 0)
            jet.second[mixed] = np.where(moves, np.inf, jet.second[mixed])
        jet.first[normal != 0] = np.where(slopes, np.inf, jet.first[normal != 0])

    def _normal(self, facet: int) -> FloatArray:
        """The normal of a facet, along an axis where it is so up to the rounding of knots."""
        shape = self.basis.domain
        normal, least = shape.normals[facet], knot_tolerance(shape.knots) / shape.size
        return np.where(np.abs(normal) > least * np.abs(normal).max(), normal, 0.0)

    def _linear(self, face: Face, p: FloatArray, local: Local, e: FloatArray, layers: FaceLayers) -> Jet:
        """Return derivatives at (m, d) points of Δ, near which `local` are coordinates of the knots."""
        shape = self.basis.domain
        steps = np.array([shape.knots[pivot] - shape.knots[local.k] for pivot in local.pivots])
        knot_step = knot_tolerance(shape.knots) / np.sqrt((steps**2).sum(axis=2))  # rounding of knots, on the axes
        to_local = _inverse(np.moveaxis(steps, 1, 2)).swapaxes(0, 1)  # (d, d, m): row b has ∂ξ_b/∂p
        target = np.einsum("bcm,mc->bm", to_local, p - shape.knots[local.k])
        heights = shape.heights_of_columns(p)
        # Over an edge with knot k and another pivot, the height has more digits than the difference.
        for b, one in enumerate(local.pivots):
            for edge in np.flatnonzero(shape.incidence[local.k]).tolist():
                over = np.all([shape.incidence[other, edge] for other in local.pivots if other is not one], axis=0)
                over &= ~shape.incidence[one, edge]
                target[b] = np.where(over, heights[edge] / shape.heights[one, edge], target[b])
        axes = np.array(local.axes)

        def coordinates(terms: FloatArray) -> FloatArray:
            return np.asarray((axes * terms).sum(axis=1))

        # Of coordinates that are not negative, no knot has more than all: these bound Newton's steps, which the solver
        # leaves out near edges, as exponents may be a thousandfold those of the pivots.
        shares = np.where((axes >= 0).all(axis=1, keepdims=True) & (axes > 0), axes / target[:, None], 0.0)
        most = -np.log(shares.max(axis=0))
        for _ in range(0 if face.is_corner else 20):
            own = jet_of(local.terms(e, layers), coordinates)
            x = np.exp([e[pivot, np.arange(len(p))] for pivot in local.pivots])
            shift = np.nan_to_num(np.einsum("bam,bm->am", _inverse(own.first * x[:, None]), target - own.value))
            moves = (axes * shift[:, None]).sum(axis=0)
            room = np.where(moves > 1, np.maximum(most - e, 1) / moves, 1.0).min(axis=0)
            e = e + moves * np.minimum(room, 1.0)
            if not (np.abs(moves) > 1e-7).any():  # the error is its square
                break
        terms = local.terms(e, layers)
        own, jet = jet_of(terms, coordinates), jet_of(terms, self._sums(local.k))
        to_x = _inverse(own.first)
        slopes = np.einsum("bam,akm->bkm", to_x, jet.first)
        bends = jet.second - np.einsum("bkm,acbm->ackm", slopes, own.second)
        whole = np.einsum("bcm,bam->cam", to_local, to_x)
        first = np.einsum("bcm,bkm->ckm", to_local, slopes)
        second = np.einsum("aim,bjm,ijkm->abkm", whole, whole, bends)

        def leave_the_plane(knots: BoolArray) -> BoolArray:
            """Mark functions and places, (k, m), at which some knots' values are off the tangent plane."""
            away = axes[:, knots] - own.value[:, None]
            rise = self._columns(local.k)[:, knots, None] - jet.value[:, None]
            planes = slopes[:, :, None] * away[:, None]
            rounding = self._rounding + 64 * EPS * (np.abs(rise) + np.abs(planes).sum(axis=0))
            rounding += (np.abs(slopes) * knot_step[:, None]).sum(axis=0)[:, None]
            return np.asarray((np.abs(rise - planes.sum(axis=0)) > rounding).any(axis=1))

        for facet, knots in layers.against:
            across = np.outer(self._normal(facet), self._normal(facet)) != 0
            second[across] = np.where(leave_the_plane(knots), np.inf, second[across])
        slow = leave_the_plane(layers.slow)
        return Jet(jet.value, np.where(slow, np.inf, first), np.where(slow, np.inf, second))


def jet_of(terms: Terms, sums: Callable[[FloatArray], FloatArray]) -> Jet:
    """Differentiate ratios of sums of values times (n, m) terms, and of the terms themselves, by the quotient rule."""
    total, d = terms.point.sum(axis=0), len(terms.first)
    value = sums(terms.point) / total
    rates = [x.sum(axis=0) / total for x in terms.first]
    first = [sums(x) / total - value * rate for x, rate in zip(terms.first, rates, strict=True)]
    second = np.zeros((d, d, *value.shape))
    for x, (a, b) in zip(terms.second, combinations_with_replacement(range(d), 2), strict=False):
        bend = sums(x) / total - value * (x.sum(axis=0) / total) - first[a] * rates[b] - first[b] * rates[a]
        second[a, b] = second[b, a] = bend
    return Jet(value, np.array(first), second)


def _power_terms(powers: FloatArray, zero: BoolArray, e: FloatArray, directions: FloatArray, order: Order) -> Terms:
    """Return terms e^e, and derivatives up to an order, of products of (n, r) powers of r edge functions.

    The (r, d, m) directions are derivatives of edge functions that are zero, and of the logarithms of all others.
    """
    r, d, m = directions.shape
    on, first, twice = (
        np.where(zero, factor * (powers == power), live)
        for power, factor, live in ((0, 1, 1.0), (1, 1, powers), (2, 2, powers * (powers - 1)))
    )
    on_face = on[:, zero].prod(axis=1)
    rest = np.repeat(on_face[:, None], r, axis=1)  # on the face, but for the facet itself
    for j in np.flatnonzero(zero).tolist():
        rest[:, j] = on[:, zero & (np.arange(r) != j)].prod(axis=1)
    slopes, f = first * rest, np.where(e > UNDERFLOW_EXPONENT, np.exp(e), 0.0)
    ways = list(combinations_with_replacement(range(d), 2))[: None if order == 2 else 0]
    bends = [np.zeros((len(f), m)) for _ in ways]
    for i in range(r if order == 2 else 0):
        after = slice(i + 1, r)
        mixed = np.where(zero[after], first[:, [i]], slopes[:, [i]]) * first[:, after]
        if not zero[i]:
            mixed = first[:, [i]] * slopes[:, after]
        factors = np.column_stack([twice[:, i] * rest[:, i], mixed])
        for bend, (a, b) in zip(bends, ways, strict=True):
            both = directions[i, a] * directions[after, b] + directions[after, a] * directions[i, b]
            bend += factors @ np.concatenate([directions[i : i + 1, a] * directions[i, b], both])
    rates = tuple(f * (slopes @ directions[:, a]) for a in range(d))
    return Terms(f * on_face[:, None], rates, tuple(f * bend for bend in bends))


def _unlimited(powers: FloatArray, order: int) -> BoolArray:
    """Mark (n,) powers of x that have, or whose products have, no finite derivative of an order at x = 0."""
    every = np.column_stack([powers, powers[:, None] + powers])
    whole = np.abs(every - np.rint(every)) <= 64 * EPS
    return np.asarray(((every > 0) & (every < order) & ~whole).any(axis=1))


def _inverse(matrices: FloatArray) -> FloatArray:
    """Invert matrices, (d, d, m), d up to 2."""
    if len(matrices) == 1:
        return np.asarray(1 / matrices)
    (a, b), (c, d) = matrices
    return np.asarray(np.array([[d, -b], [-c, a]]) / (a * d - b * c))
