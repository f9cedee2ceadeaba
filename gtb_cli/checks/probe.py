"""Sample parameters of a patch at which checks measure, and bounds for its rounding."""

import math
from functools import cached_property

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.knots.even_triangulation import cell_count, triangulation
from gtb_cli.knots.face import INTERIOR
from gtb_cli.knots.lattice import repeated
from gtb_cli.limits.knot_limit import merge_knots
from gtb_cli.theory.basis import Location
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

# Roundings of a value of the basis, beside its exponent's: logarithms, a sum, an exponential, a quotient
VALUE_ROUNDINGS = 64


@frozen
class Probe:
    """A patch with sample parameters, values there that several checks need, and bounds for rounding."""

    patch: Patch

    @cached_property
    def u(self) -> FloatArray:
        """Parameters, (m, d): a uniform triangulation with its boundary and corners, and points near the boundary."""
        domain = self.patch.domain
        # With many knots there are fewer, for a table of about a million values.
        most = max(16, min(1500, 1_000_000 // len(domain.knots)))
        segments = min(128, most)
        if domain.dimension == 2:
            segments = max(2, min(16, math.isqrt(2 * most // cell_count(domain, 1))))
        uniform = triangulation(domain, segments).parameters
        outer = uniform[(domain.heights_of_columns(uniform) == 0).any(axis=0)]
        # Of the way to the middle: the basis is steep there
        fractions = [fraction for fraction in (2.0**-8, 2.0**-16, 2.0**-30) if fraction > self.knot_rounding]
        near = [outer + fraction * (domain.center - outer) for fraction in fractions]
        return np.concatenate([uniform, *near])[: 4 * most]

    @cached_property
    def heights(self) -> FloatArray:
        """Edge functions at `u`, (r, m)."""
        return self.patch.domain.heights_of_columns(self.u)

    @cached_property
    def inside(self) -> IntArray:
        """Indices of the parameters inside Δ."""
        return np.flatnonzero((self.heights > 0).all(axis=0))

    @cached_property
    def basis(self) -> FloatArray:
        """The rational basis at `u`, (m, n)."""
        return self.patch.basis(self.u)

    @cached_property
    def points(self) -> FloatArray:
        """Points at `u`, (m, 3)."""
        return self.patch.evaluate(self.u)

    @cached_property
    def knot_rounding(self) -> float:
        """Error of places in Δ due to rounding of the knots, as a fraction of its size: larger if Δ is thin."""
        domain = self.patch.domain
        width = float((domain.heights.max(axis=0) / domain.normal_lengths).min())
        return EPS * VALUE_ROUNDINGS * max(domain.size, float(np.abs(domain.knots).max())) / width

    def sharpened(self) -> "Probe":
        """Return a probe of the patch whose knots are on all edges, or ends, on which they count as being."""
        domain, knots = self.patch.domain, self.patch.knots.copy()
        for index, row in enumerate(domain.incidence):
            normals = domain.normals[row]
            knots[index] -= np.linalg.pinv(normals) @ ((knots[index] - domain.vertices[row]) * normals).sum(axis=1)
        return Probe(self.patch.replace(knots=knots))

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

    def along_principal_axes(self, *arrays: FloatArray) -> list[FloatArray]:
        """Return (m, 3) points along the principal axes of control points, from their mean, in units of `extent`."""
        middle = self.patch.control_points.mean(axis=0)
        # Rows of zeros give even two points three axes.
        control = np.concatenate([(self.patch.control_points - middle) / self.extent, np.zeros((3, 3))])
        axes = np.linalg.svd(control, full_matrices=False)[2]
        return [(array - middle) / self.extent @ axes.T for array in arrays]

    @cached_property
    def merged(self) -> Patch:
        """The patch with its repeated knots merged; the patch itself if no knot is repeated."""
        moves = {knot: first for first, *others in repeated(self.patch.knots) for knot in others}
        return merge_knots(self.patch, moves) if moves else self.patch


def points_at_torus(patch: Patch, s: FloatArray) -> FloatArray:
    """Return (m, 3) points of a patch at (d, m) torus coordinates."""
    count, shape = s.shape[1], patch.domain
    return patch.points_at([Location(slice(0, count), shape.faces[INTERIOR], shape.knots - shape.center, s)], count)


def choice(count: int, most: int) -> list[int]:
    """Return at most `most` indices below `count`, evenly spread from the first to the last."""
    return list(map(int, np.linspace(0, count - 1, min(count, most))))


def largest(values: FloatArray) -> float:
    """Return the largest violation: 0 if there are none, infinite if one is not a number."""
    worst = float(values.max(initial=0.0)) + 0.0  # not -0
    return math.inf if math.isnan(worst) else worst
