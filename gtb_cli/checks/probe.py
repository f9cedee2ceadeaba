"""Sample parameters of a patch at which checks measure, and bounds for its rounding."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from itertools import product
from typing import NamedTuple, TypeAlias

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray
from gtb_cli.checks.report import Finding
from gtb_cli.design.isocurve import unmerged_isocurve
from gtb_cli.knots.face import INTERIOR
from gtb_cli.knots.triangulation import cell_count, triangulation
from gtb_cli.theory.basis import Location, torus_coordinates
from gtb_cli.theory.knot_limit import merge_knots
from gtb_cli.theory.linear import LinearParametrization
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

# In units of `EPS`, of a value of the basis beside those of its exponent: logarithms, a sum, an exponential, a quotient
VALUE_ROUNDINGS = 64


Measure: TypeAlias = "Callable[[Probe], Finding]"


class Edges(NamedTuple):
    """Places on edges, which depend only on the rational basis.

    Attributes
    ----------
    numbers : list of int
        The edges.
    each : int
        Places on an edge, from corner to corner.
    locations : list of Location
        The places of one edge after those of another.
    torus : list of (1, each − 2) float
        Torus coordinates, on each edge's curve, of the places between its corners.
    leak : float
        Largest value there of T of a knot off the edge.
    """

    numbers: list[int]
    each: int
    locations: list[Location]
    torus: list[FloatArray]
    leak: float


@frozen
class Probe:
    """A patch with sample parameters and values that several checks need.

    Parameters
    ----------
    patch : Patch
        The patch to check; checks ask it for points and values of the basis instead of computing them.
    """

    patch: Patch

    def of(self, patch: Patch) -> Probe:
        """The probe of a patch with the same rational basis, with the data that depend only on this."""
        own = {"patch", "points", "extent", "reach", "distance_rounding", "merged"}
        other = Probe(patch)
        other.__dict__.update({name: value for name, value in self.__dict__.items() if name not in own})
        return other

    @cached_property
    def u(self) -> FloatArray:
        """(m, d) parameters: a uniform triangulation with its boundary and corners, and points near the boundary."""
        # Roughly the numbers of parameters; with many knots they are fewer, for a table of at most a million values.
        min_parameters, max_parameters, max_values = 16, 1500, 1_000_000
        curve_segments, surface_segments = 128, 16
        boundary_fractions = (2.0**-8, 2.0**-16, 2.0**-30)  # of the way to the middle: the basis is steep there
        domain = self.patch.domain
        most = max(min_parameters, min(max_parameters, max_values // len(domain.knots)))
        if domain.dimension == 1:
            uniform = triangulation(domain, min(curve_segments, most)).parameters
        else:
            finest = math.isqrt(2 * most // cell_count(domain, 1))
            uniform = triangulation(domain, max(2, min(surface_segments, finest))).parameters
        heights = domain.heights_of_columns(uniform)
        outer = uniform[(heights == 0).any(axis=0)]
        fractions = [fraction for fraction in boundary_fractions if fraction > self.knot_rounding]
        near = [outer + fraction * (domain.center - outer) for fraction in fractions]
        return np.concatenate([uniform, *near])[: 4 * most]

    @cached_property
    def heights(self) -> FloatArray:
        """(r, m) edge functions at `u`."""
        return self.patch.domain.heights_of_columns(self.u)

    @cached_property
    def inside(self) -> IntArray:
        """Indices of the parameters inside Δ."""
        return np.flatnonzero((self.heights > 0).all(axis=0))

    @cached_property
    def torus(self) -> FloatArray:
        """(d, k) torus coordinates of the parameters inside Δ."""
        return torus_coordinates(self.patch.domain, self.heights[:, self.inside])

    @cached_property
    def basis(self) -> FloatArray:
        """(m, n) the rational basis at `u`."""
        return self.patch.basis(self.u)

    @cached_property
    def points(self) -> FloatArray:
        """(m, 3) points at `u`."""
        return self.points_of(self.patch)

    def points_of(self, patch: Patch) -> FloatArray:
        """Return (m, 3) points at `u` of a patch with the same domain."""
        return patch.points_at(self.locations, len(self.u))

    @cached_property
    def locations(self) -> list[Location]:
        """The parameters `u`, located."""
        return list(self.patch.rational_basis.locations(self.u))

    @cached_property
    def powers(self) -> tuple[slice, BoolArray, FloatArray]:
        """Some rows of `u`, whether their powers are within floats, and (k, n) values of T there by the definition."""
        max_powers = 1_000_000  # for the time of long doubles
        domain = self.patch.domain
        rows = slice(None, None, -(-self.heights.size * len(domain.knots) // max_powers))
        heights = self.heights[:, rows].astype(np.longdouble)
        with np.errstate(all="ignore"):
            products = np.exp(self.patch.log_products.astype(np.longdouble))
            beta = np.repeat(products[None], heights.shape[1], axis=0)
            for h, exponents in zip(heights, domain.heights.astype(np.longdouble).T, strict=True):
                # 0**0 is 1, and 0 to any positive power is 0.
                beta *= h[:, None] ** exponents
            total = beta.sum(axis=1)
            # If the largest is near the end of the range, others that matter may be beyond it.
            whole = np.isfinite(total) & (beta.max(axis=1) * EPS**2 > np.finfo(np.longdouble).tiny)
            return rows, whole, (beta / total[:, None])[whole].astype(np.float64)

    @cached_property
    def edges(self) -> Edges:
        """Places on edges of a surface: of more than 64, on an evenly spread choice."""
        patch, domain, count = self.patch, self.patch.domain, 17
        v = domain.vertices
        numbers, leak, torus, u = choice(len(v), 64), 0.0, [], []
        for edge in numbers:
            u.append(v[edge] + np.linspace(0.0, 1.0, count)[:, None] * (v[(edge + 1) % len(v)] - v[edge]))
            u[-1][-1] = v[(edge + 1) % len(v)]
            inner = u[-1][1:-1]
            leak = max(leak, largest(np.abs(patch.basis(inner)[:, ~domain.incidence[:, edge]])))
            heights = domain.heights_of_columns(inner, 0, np.full(len(inner), domain.faces.edge(edge).number))
            heights[edge] = 1.0
            torus.append((domain.direction(edge) @ torus_coordinates(domain, heights))[None])
        return Edges(numbers, count, list(patch.rational_basis.locations(np.concatenate(u))), torus, leak)

    @cached_property
    def isolines(self) -> tuple[list[Location], FloatArray]:
        """Places on isolines of a rectangle along the axes, and (m, n) values there of the basis of their curves."""
        domain, count = self.patch.domain, 17
        low, high = domain.vertices.min(axis=0), domain.vertices.max(axis=0)
        u: list[FloatArray] = []
        values: list[FloatArray] = []
        for axis, fraction in product((0, 1), (0.125, 0.5, 0.8)):
            place = low + fraction * (high - low)
            v = np.linspace(low[1 - axis], high[1 - axis], count)
            v[-1] = high[1 - axis]
            curve, members = unmerged_isocurve(self.patch, axis, float(place[axis]))
            values.append(np.zeros((count, len(domain.knots))))
            values[-1][:, members] = curve.basis(v)
            u.append(np.column_stack([v, v]))
            u[-1][:, axis] = place[axis]
        return list(self.patch.rational_basis.locations(np.concatenate(u))), np.concatenate(values)

    @cached_property
    def of_basis(self) -> dict[str, Finding]:
        """Findings about the rational basis, by name."""
        return {}

    @cached_property
    def knot_rounding(self) -> float:
        """Error of places in Δ due to rounding of the knots, as a fraction of its size: larger if Δ is thin."""
        domain = self.patch.domain
        width = float((domain.heights.max(axis=0) / domain.normal_lengths).min())
        return EPS * VALUE_ROUNDINGS * max(domain.size, float(np.abs(domain.knots).max())) / width

    @cached_property
    def extent(self) -> float:
        """Largest extent of the control points along an axis, in which distances are measured; 1 where it is 0."""
        return float(np.ptp(self.patch.control_points, axis=0).max()) or 1.0

    @cached_property
    def reach(self) -> float:
        """Largest coordinate of a control point, as a multiple of `extent`, and at least 1."""
        return max(1.0, float(np.abs(self.patch.control_points).max()) / self.extent)

    @cached_property
    def rounding(self) -> float:
        """Relative error of a value of the basis: roundings of exponents, which grow with their size.

        The exponents are Σ_j h_j(a_i) log h_j(u) + log(c_i ω_i). The knots are taken as exact, but products with knots
        far from the origin have their rounding errors.
        """
        exponent_roundings = 8  # relative to its terms: a logarithm and two short sums of products
        domain = self.patch.domain
        logs = np.abs(np.log(np.where(self.heights > 0, self.heights, 1.0)))
        reach = float((domain.heights.max(axis=0) @ logs).max()) + float(np.abs(self.patch.log_products).max())
        shift = max(1.0, float(np.abs(domain.knots).max()) / domain.size)
        return EPS * (exponent_roundings * reach * shift + VALUE_ROUNDINGS + len(domain.knots))

    @cached_property
    def distance_rounding(self) -> float:
        """Error of a point as a fraction of `extent`: of the basis, and of sums of control points."""
        return self.rounding + EPS * (VALUE_ROUNDINGS + len(self.patch.knots)) * self.reach

    def distance(self, first: FloatArray, second: FloatArray) -> float:
        """Return the largest distance of (m, 3) points from others, as a fraction of `extent`."""
        return largest(np.sqrt((((first - second) / self.extent) ** 2).sum(axis=1)))

    @cached_property
    def linear(self) -> LinearParametrization:
        """The linear parametrisation of the patch."""
        return self.patch.rational_basis.linear

    @cached_property
    def merged(self) -> Patch:
        """The patch with its repeated knots merged; the patch itself if no knot is repeated."""
        moves = self.repetitions
        return merge_knots(self.patch, moves) if moves else self.patch

    @cached_property
    def repetitions(self) -> dict[int, int]:
        """From each knot that repeats an earlier one to this earlier one."""
        _, first, group = np.unique(self.patch.knots, axis=0, return_index=True, return_inverse=True)
        lowest = first[group.ravel()]
        return {int(k): int(lowest[k]) for k in np.flatnonzero(lowest != np.arange(len(lowest)))}


def points_at_torus(patch: Patch, s: FloatArray) -> FloatArray:
    """Return (m, 3) points of a patch at (d, m) torus coordinates."""
    count = s.shape[1]
    shape = patch.domain
    where = Location(
        slice(0, count), shape.faces[INTERIOR], shape.knots - shape.center, s, np.ones((len(shape.vertices), count))
    )
    return patch.points_at([where], count)


def principal_axes(points: FloatArray) -> FloatArray:
    """Return (3, 3) orthonormal axes (rows) of (m, 3) points about 0, starting with that of largest extent."""
    # Rows of zeros give even two points three axes.
    return np.asarray(np.linalg.svd(np.concatenate([points, np.zeros((3, 3))]), full_matrices=False)[2])


def evenly(count: int, dimension: int) -> FloatArray:
    """Return (count, dimension) points spread evenly over the unit cube, always the same ones.

    Notes
    -----
    The recurrence is additive, with powers of the root of x^(d + 1) = x + 1, the golden ratio of that dimension.
    """
    root = 2.0
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (dimension + 1))
    steps = root ** -np.arange(1.0, dimension + 1)
    return np.asarray((0.5 + np.arange(1.0, count + 1)[:, None] * steps) % 1.0)


def choice(count: int, most: int) -> list[int]:
    """Return at most `most` indices below `count`, evenly spread from the first to the last."""
    spread: list[int] = np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64)).tolist()
    return spread


def largest(values: FloatArray) -> float:
    """Return the largest violation: 0 if there are none, infinite if one is not a number."""
    worst = float(values.max(initial=0.0)) + 0.0  # not -0
    return math.inf if math.isnan(worst) else worst
