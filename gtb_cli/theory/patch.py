"""`Patch`: a GT-Bézier curve or surface, one type for both because one theory covers both."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from dataclasses import field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, IntArray, finite, one_for_each, read_only
from gtb_cli.display import notebook_html, plot
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import Domain, EdgeNormals, domain
from gtb_cli.theory.basis import CoefficientRule, Location, both_weights, coefficients_of, gt_bernstein
from gtb_cli.theory.rational_basis import RationalBasis
from gtb_cli.values import by_value
from gtb_cli.vocabulary import Parametrization

if TYPE_CHECKING:
    from gtb_cli.theory.curvature import Curvature
    from gtb_cli.theory.derivatives import Order


@by_value
class Patch:
    """A GT-Bézier curve (d = 1, Def. 3.1) or surface (d = 2, Def. 4.1): ``P(u) = Σ_i b_i T_i(u)``, u in Δ = conv{a_i}.

    Parameters
    ----------
    knots : (n, d) float, or (n,) for a curve
        Real knots a_i; repetitions allowed.
    control_points : (n, 3) or (n, 2) float
        b_i, in model units; planar points get z = 0.
    weights : (n,) float, optional
        ω_i > 0, default 1.
    coefficients : (n,) float, "binomial" or "partition-of-unity", optional
        c_i > 0, default 1, or the name of a rule, as in a spec. They act only through the products c_i ω_i.
    edge_normals, edge_scale
        Scale of the edge functions, see `gtb_cli.knots.domain.domain`. It changes the parametrisation, not the image.
    lifting : (n,) float, optional
        λ_i, for the toric degeneration.
    name : str, optional
    log_weights : (n,) float, optional
        log ω_i instead of `weights`, for weights beyond the range of floats (x^λ). A patch has both: the logarithms
        count, and `weights` are the given numbers or their exponentials, 0 or inf if out of range.
    rational_basis : RationalBasis, optional
        The functions T_i of another patch, shared if they are this one's, too; `replace` passes them on.

    Raises
    ------
    DomainError
        Arrays do not fit, are not finite or not positive; weights and their logarithms disagree; or knots are in line.

    Notes
    -----
    A value: patches with equal numbers and names are equal and have the same hash, also after pickling or copying.
    Arrays belong to the patch and are read-only; `replace` makes changed copies.
    """

    knots: FloatArray
    control_points: FloatArray
    weights: FloatArray = None  # type: ignore[assignment]
    coefficients: FloatArray = None  # type: ignore[assignment]
    edge_normals: EdgeNormals = field(default="auto", kw_only=True)
    edge_scale: float | FloatArray = field(default=1.0, kw_only=True)
    lifting: FloatArray | None = field(default=None, kw_only=True)
    name: str | None = field(default=None, kw_only=True)
    log_weights: FloatArray = field(default=None, kw_only=True)  # type: ignore[arg-type]
    rational_basis: RationalBasis = field(default=None, kw_only=True, compare=False)  # type: ignore[assignment]

    if TYPE_CHECKING:

        def __init__(
            self,
            knots: ArrayLike,
            control_points: ArrayLike,
            weights: ArrayLike | None = None,
            coefficients: ArrayLike | CoefficientRule | None = None,
            *,
            edge_normals: EdgeNormals = "auto",
            edge_scale: ArrayLike = 1.0,
            lifting: ArrayLike | None = None,
            name: str | None = None,
            log_weights: ArrayLike | None = None,
            rational_basis: RationalBasis | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        shape = domain(self.knots, self.edge_normals, self.edge_scale)
        n = len(shape.knots)
        points = finite("control_points", self.control_points)
        if points.ndim != 2 or points.shape[1] not in (2, 3):
            raise DomainError(f"control_points: expected shape ({n}, 3) or ({n}, 2), got {points.shape}")
        if points.shape[1] == 2:
            points = read_only(np.column_stack([points, np.zeros(len(points))]))
        made: dict[str, Any] = {"knots": shape.knots, "edge_scale": shape.edge_scale, "control_points": points}
        made["weights"], made["log_weights"] = both_weights(self.weights, self.log_weights, n)
        made["coefficients"] = coefficients_of(shape, self.coefficients)
        if self.lifting is not None:
            made["lifting"] = finite("lifting", self.lifting)
        for label in ("control_points", "weights", "coefficients", "lifting"):
            if label in made:
                one_for_each(label, made[label], n, "knot", (3,) if label == "control_points" else ())
        if self.name is not None and not isinstance(self.name, str):
            raise DomainError(f"name: expected a string, got {self.name!r}")
        products = read_only(made["log_weights"] + np.log(made["coefficients"]))
        basis: RationalBasis | None = self.rational_basis
        if basis is None or basis.domain != shape or not np.array_equal(basis.log_weights, products):
            made["rational_basis"] = RationalBasis(shape, products)
        for label, value in made.items():
            object.__setattr__(self, label, value)

    def __repr__(self) -> str:
        kind = "curve" if self.dimension == 1 else f"{len(self.domain.vertices)}-sided surface"
        return f"<Patch {self.name or 'without a name'}: {kind}, {len(self.knots)} knots>"

    def replace(self, **changes: Any) -> Patch:
        """Return a copy with other values in some fields.

        New `weights` replace the old logarithms, and new `log_weights` the old weights. The copy shares Δ if knots,
        edge normals and edge scale stay the same, and the rational basis if weights and coefficients do as well.
        """
        for one, other in (("weights", "log_weights"), ("log_weights", "weights")):
            if one in changes:
                changes.setdefault(other, None)
        return dataclasses.replace(self, **changes)

    def part(self, members: IntArray, **changes: Any) -> Patch:
        """Return the patch of some knots, with the data that belong to them.

        Its edges are its own: primitive normals become automatic, and the edge scale 1. For other fields see `replace`.
        """
        names = {"knots", "control_points", "weights", "log_weights", "coefficients"} - changes.keys()
        rows = {name: getattr(self, name)[members] for name in names}
        rows["lifting"] = None if self.lifting is None else self.lifting[members]
        rows["edge_normals"] = "unit" if self.edge_normals == "unit" else "auto"
        return self.replace(**{**rows, "edge_scale": 1.0, **changes})

    @property
    def dimension(self) -> int:
        """1 for a curve, 2 for a surface."""
        return int(self.knots.shape[1])

    @property
    def patches(self) -> tuple[Patch]:
        """The patch alone, where several may be meant, as in a `Model`."""
        return (self,)

    @property
    def domain(self) -> Domain:
        """Δ with its edge functions."""
        return self.rational_basis.domain

    @property
    def log_products(self) -> FloatArray:
        """Logarithms of c_i ω_i, (n,), through which alone weights and coefficients act on the rational basis."""
        return self.rational_basis.log_weights

    def evaluate(self, u: ArrayLike, parametrization: Parametrization = "toric") -> FloatArray:
        """Evaluate the patch (eq. 301, eq. 401).

        Parameters
        ----------
        u : (…, d) float, or (…) for a curve
            Parameters in Δ: one, a row of them, or a grid. For a curve, a last axis of length 1 counts as d.
        parametrization : {"toric", "linear"}
            Parametrisation of u, see `gtb_cli.theory.rational_basis`.

        Returns
        -------
        (…, 3) float
            Points, in model units. Points on edge j lie on the curve of its knots; corners are exactly control points.

        Raises
        ------
        DomainError
            A parameter lies outside Δ by more than rounding.
        """
        return self._mapped(self.points_at, u, parametrization)

    def _mapped(
        self, rows_at: Callable[[Iterable[Location], int], FloatArray], u: ArrayLike, parametrization: Parametrization
    ) -> FloatArray:
        columns, grid = self.domain.grid(u)
        found = rows_at(self.rational_basis.locations(columns, parametrization), len(columns))
        return found.reshape(*grid, found.shape[1])

    def basis(self, u: ArrayLike, parametrization: Parametrization = "toric") -> FloatArray:
        """Evaluate the rational basis: T_i(u), (…, n), at parameters as in `evaluate` (eq. 202, eq. 205)."""
        return self._mapped(self.rational_basis.values, u, parametrization)

    def beta(self, u: ArrayLike) -> FloatArray:
        """Evaluate the basis ``β_i(u) = c_i Π_j h_j(u)^{h_j(a_i)}``, not normalised: (…, n) (eq. 201, eq. 204).

        Unlike `basis`, it depends on the scale of the edge functions; entries beyond the range of floats are 0 or inf.
        """
        columns, grid = self.domain.grid(u)
        return gt_bernstein(self.domain, self.coefficients, columns).reshape(*grid, len(self.knots))

    def moment(self, u: ArrayLike) -> FloatArray:
        """Map toric parameters to linear ones: ``Σ_i T_i(u) a_i``, (…, d), a point of Δ (Birch's theorem)."""
        return self._mapped(partial(self.rational_basis.blend, self.knots), u, "toric")

    def points_at(self, locations: Iterable[Location], count: int) -> FloatArray:
        """Return points at locations found by any parametrisation, (count, 3)."""
        return self.rational_basis.blend(self.control_points, locations, count)

    def derivatives(self, u: ArrayLike, order: Order = 1, parametrization: Parametrization = "toric") -> FloatArray:
        """Differentiate the patch once, ∂P/∂u, or twice, ∂²P/∂u², also on the boundary of Δ (eq. 202, eq. 205).

        Parameters
        ----------
        u : (…, d) float, or (…) for a curve
            Parameters, as in `evaluate`.
        order : {1, 2}
        parametrization : {"toric", "linear"}
            With respect to which derivatives are taken.

        Returns
        -------
        (…, 3, d) float, or (…, 3, d, d) of order 2
            Coordinates of the derivatives, in model units per units of the knots. On the boundary they are limits from
            inside. Where there is none, as they grow without bound or differ along different ways into a corner, or
            where they are beyond floats, inf stands for it, without a sign.

        Raises
        ------
        DomainError
            A parameter lies outside Δ, or the order is another.

        Notes
        -----
        Digits are kept up to the boundary: errors are some roundings of the largest term. In the toric parametrisation
        the first derivative across edge j is infinite on it if a knot has 0 < h_j(a_i) < 1, and the second one also if
        1 < h_j(a_i) < 2. In the linear parametrisation all first derivatives are finite on edges; the second one across
        an edge is infinite if a knot is less than twice as far from it as the nearest ones. Control points for which
        the infinite terms vanish are found.
        """
        from gtb_cli.theory.derivatives import DerivativeField

        return DerivativeField(self.rational_basis, self.control_points).at(u, order, parametrization)

    def basis_derivatives(
        self, u: ArrayLike, order: Order = 1, parametrization: Parametrization = "toric"
    ) -> FloatArray:
        """Differentiate the T_i once, (…, n, d), or twice, (…, n, d, d); everything else is as in `derivatives`."""
        from gtb_cli.theory.derivatives import DerivativeField

        return DerivativeField(self.rational_basis, None).at(u, order, parametrization)

    def normals(self, u: ArrayLike, parametrization: Parametrization = "toric") -> FloatArray:
        """Return unit normals of a surface, (…, 3), along ∂P/∂u_0 × ∂P/∂u_1, with their limits on the boundary.

        Parameters are (…, 2). Normals are NaN where there is none, or there are several limits at a corner: a mesh has
        the mean of its adjacent faces there. `DomainError` is raised for a curve, and for a parameter outside Δ.

        The normal on an edge is tangent × derivative towards the nearest layer of knots not parallel to it. At a corner
        it is the limit on all ways to it, up to 1e-4 degrees: see `gtb_cli.corner_limits`. Inside, digits are kept up
        to the boundary, even if a few knots hold nearly all of T; see `gtb_cli.theory.normals`.
        """
        return self._mapped(self.normals_at, u, parametrization)

    def normals_at(self, locations: Iterable[Location], count: int) -> FloatArray:
        """Return unit normals at locations found by any parametrisation, (count, 3); see `normals`."""
        from gtb_cli.theory.normals import normals_at  # most meshes do not need them

        return normals_at(self, locations, count)

    def curvature(self, u: ArrayLike, parametrization: Parametrization = "toric") -> Curvature:
        """Return the Gaussian and the mean curvature of a surface, (…) each, at (…, 2) parameters.

        ``found.gaussian`` and ``found.mean`` are NaN without a normal or a finite limit; see `gtb_cli.Curvature`.
        `DomainError` is raised for a curve, and for a parameter outside Δ.

        Values on edges and at corners are limits. Across an edge there is one if the second layer of knots next to it
        is at least twice as far as the first; otherwise the curvature generally grows like h^(r − 2), r the ratio and h
        the distance in linear parameters. For corners see `gtb_cli.corner_limits`. The relative error is a few
        roundings, over the sine between the derivatives.
        """
        from gtb_cli.theory.curvature import Curvature, curvatures_at

        columns, grid = self.domain.grid(u)
        found = curvatures_at([self], self.rational_basis.locations(columns, parametrization), len(columns))
        return Curvature(*(each.reshape(grid) for each in found))

    def tangents(self, t: ArrayLike | None = None, parametrization: Parametrization = "toric") -> FloatArray:
        """Return unit tangents of a curve, (…, 3), in the direction of increasing parameters; by default at its ends.

        They are NaN where the derivative vanishes. At an end they are limits: the direction from its control point to
        the nearest knot's different control point, where repeated knots count with their mean (property (c) of
        GT-Bézier curves, eq. 302). `DomainError` is raised for a surface, and for a parameter outside Δ.
        """
        from gtb_cli.theory.normals import tangents

        return tangents(self, self.domain.vertices if t is None else t, parametrization)

    def boundary(self, edge: int) -> Patch:
        """Return the curve of an edge: the patch of the knots on it, measured from its first corner (Thm 4.0).

        Edges are 0 … r − 1, counter-clockwise from the lowest, then leftmost, corner of Δ. `DomainError` is raised for
        a curve, and for another edge.
        """
        r = len(self.domain.vertices)
        if self.dimension == 1 or not 0 <= edge < r:
            raise DomainError(f"edge: expected 0 … {r - 1} of a surface, got {edge}")
        members = self.domain.edge_knots(edge)
        knots = self.domain.along(edge, self.knots)[members]
        return self.part(members, knots=knots, edge_normals="auto", name=f"{self.name or 'patch'}-edge{edge}")

    plot = plot
    _repr_html_ = notebook_html
