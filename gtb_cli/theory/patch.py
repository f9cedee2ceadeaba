"""`Patch`: a GT-Bézier curve or surface; one type for both, as one theory covers both."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, finite, positive, read_only
from gtb_cli.errors import DomainError
from gtb_cli.theory.basis import Location, blend, exponentials, rational_basis, toric_locations
from gtb_cli.theory.domain import Domain, EdgeNormals, domain
from gtb_cli.theory.normals import NormalField


@dataclass(frozen=True, eq=False)
class Patch:
    """A GT-Bézier curve (d = 1) or surface (d = 2): ``P(u) = Σ_i b_i T_i(u)``, u in Δ = conv{a_i}.

    Parameters
    ----------
    knots : (n, d) float, or (n,) for a curve
        Real knots a_i; repetitions allowed.
    control_points : (n, 3) or (n, 2) float
        b_i, in model units; planar points get z = 0.
    weights : (n,) float, optional
        ω_i > 0, default 1.
    coefficients : (n,) float, optional
        c_i > 0, default 1. They act only through the products c_i ω_i.
    edge_normals, edge_scale
        Scale of the edge functions, see `gtb_cli.theory.domain.domain`: changes the parametrisation, not the image.
    lifting : (n,) float, optional
        λ_i, for the toric degeneration.
    name : str, optional
    log_weights : (n,) float, optional
        log ω_i in place of `weights`, for weights beyond the range of floats (x^λ); `weights` then holds
        their exponentials, 0 or inf where need be.

    Raises
    ------
    DomainError
        Arrays that do not fit, are not finite, or not positive; knots with a flat hull.

    References
    ----------
    Def. 3.1, Def. 4.1.
    """

    knots: FloatArray
    control_points: FloatArray
    weights: FloatArray = None  # type: ignore[assignment]
    coefficients: FloatArray = None  # type: ignore[assignment]
    edge_normals: EdgeNormals = field(default="auto", kw_only=True)
    edge_scale: float | FloatArray = field(default=1.0, kw_only=True)
    lifting: FloatArray | None = field(default=None, kw_only=True)
    name: str | None = field(default=None, kw_only=True)
    log_weights: FloatArray | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        shape = domain(self.knots, self.edge_normals, self.edge_scale)
        set_field(self, "_domain", shape)
        set_field(self, "knots", shape.knots)
        n = len(shape.knots)
        points = finite("control_points", self.control_points)
        if points.ndim != 2 or points.shape[1] not in (2, 3):
            raise DomainError(f"control_points: expected shape ({n}, 3) or ({n}, 2), got {points.shape}")
        if points.shape[1] == 2:
            points = read_only(np.column_stack([points, np.zeros(len(points))]))
        set_field(self, "control_points", points)
        if self.log_weights is not None:
            set_field(self, "log_weights", finite("log_weights", self.log_weights))
            with np.errstate(over="ignore", under="ignore"):
                set_field(self, "weights", read_only(np.exp(self.log_weights)))
        else:
            set_field(self, "weights", positive("weights", np.ones(n) if self.weights is None else self.weights))
        coefficients = np.ones(n) if self.coefficients is None else self.coefficients
        set_field(self, "coefficients", positive("coefficients", coefficients))
        if self.lifting is not None:
            set_field(self, "lifting", finite("lifting", self.lifting))
        if np.ndim(self.edge_scale):
            set_field(self, "edge_scale", read_only(self.edge_scale))
        for label in ("control_points", "weights", "coefficients", "lifting", "log_weights"):
            values = getattr(self, label)
            expected = (n, 3) if label == "control_points" else (n,)
            if values is not None and values.shape != expected:
                raise DomainError(f"{label}: expected {n} entries, one per knot, got shape {values.shape}")

    @property
    def dimension(self) -> int:
        """1 for a curve, 2 for a surface."""
        return self.domain.dimension

    @property
    def domain(self) -> Domain:
        """Δ with its edge functions."""
        shape: Domain = self._domain  # type: ignore[attr-defined]
        return shape

    @cached_property
    def log_products(self) -> FloatArray:
        """(n,) log(c_i ω_i), all that the rational basis sees of weights and coefficients."""
        logs = np.log(self.weights) if self.log_weights is None else self.log_weights
        return read_only(logs + np.log(self.coefficients))

    def evaluate(self, u: ArrayLike) -> FloatArray:
        """Evaluate the patch.

        Parameters
        ----------
        u : (m, d) float, or (m,) for a curve
            Parameters in Δ.

        Returns
        -------
        (m, 3) float
            Points, in model units. On edge j the curve of the knots on that edge; at corners exactly their control
            points.

        Raises
        ------
        DomainError
            A parameter lies outside Δ by more than rounding.

        References
        ----------
        Eq. (301), eq. (401).
        """
        u = self.domain.columns(u)
        return self.points_at(toric_locations(self.domain, u), len(u))

    def basis(self, u: ArrayLike) -> FloatArray:
        """(m, n) values T_i(u) of the rational basis (eq. 202, eq. 205); parameters as in `evaluate`."""
        u = self.domain.columns(u)
        return rational_basis(self.domain, self.log_products, toric_locations(self.domain, u), len(u))

    def points_at(self, locations: Iterable[Location], count: int) -> FloatArray:
        """(count, 3) points at locations found by any parametrisation."""
        return blend(self.domain, self.log_products, self.control_points, locations, count)

    def derivatives(self, u: ArrayLike) -> FloatArray:
        """(m, 3, d) first derivatives ∂P/∂u at parameters inside Δ.

        ``∂P/∂u = Σ_j (Σ_i T_i h_j(a_i) (b_i − P)) (s_j ξ_j)ᵀ / h_j(u)``.

        Raises
        ------
        DomainError
            A parameter lies on the boundary, where the derivative may be infinite: use `normals` there.
        """
        u = self.domain.columns(u)
        result = np.empty((len(u), 3, self.dimension))
        points = self.control_points - self._middle
        for where, face, knots, s, heights in toric_locations(self.domain, u):
            if face:
                raise DomainError("derivatives are taken inside the domain: a parameter lies on its boundary")
            t = exponentials(knots, self.log_products, s)
            t /= t.sum(axis=0)
            # Where h_j(u) is small, so are all T_i but those with h_j(a_i) exactly 0: digits are kept up to the edges.
            mean = points.T @ t
            rates = [
                ((points * column[:, None]).T @ t - mean * (column @ t)) / height
                for column, height in zip(self.domain.heights.T, heights, strict=True)
            ]
            result[where] = np.einsum("jkm,jl->mkl", np.array(rates), self.domain.normals)
        return result

    def normals(self, u: ArrayLike) -> FloatArray:
        """Unit normals of a surface, in the direction of ∂P/∂u_0 × ∂P/∂u_1, with their limits on the boundary.

        Parameters
        ----------
        u : (m, 2) float

        Returns
        -------
        (m, 3) float
            NaN where the surface has no normal there (coincident control points): see
            `gtb_cli.tessellation.tessellate`, which takes the mean of adjacent faces.

        Raises
        ------
        DomainError
            The patch is a curve, or a parameter lies outside Δ.

        Notes
        -----
        On an edge: tangent × derivative towards the nearest layer of knots that is not parallel to it; at a corner
        the directions to the next knots along its two edges. Inside, digits are kept up to the boundary and where
        few knots hold nearly all of T; see `gtb_cli.theory.normals`.
        """
        u = self.domain.columns(u)
        return self.normals_at(toric_locations(self.domain, u), len(u))

    def normals_at(self, locations: Iterable[Location], count: int) -> FloatArray:
        """(count, 3) unit normals, as `normals`, at locations found by any parametrisation."""
        return self._normal_field.at(locations, count)

    def boundary(self, edge: int) -> Patch:
        """Return the curve of an edge: the patch of the knots on it, measured from its first corner (Thm 4.0).

        Parameters
        ----------
        edge : int
            0 … r − 1, counter-clockwise from the lowest, then leftmost, corner of Δ.

        Raises
        ------
        DomainError
            The patch is a curve, or has no such edge.
        """
        r = len(self.domain.vertices)
        if self.dimension == 1 or not 0 <= edge < r:
            raise DomainError(f"edge: expected 0 … {r - 1} of a surface, got {edge}")
        members = self.domain.edge_knots(edge)
        return Patch(
            self.domain.along(edge, self.knots)[members],
            self.control_points[members],
            self.weights[members],
            self.coefficients[members],
            lifting=None if self.lifting is None else self.lifting[members],
            name=f"{self.name or 'patch'}-edge{edge}",
            log_weights=None if self.log_weights is None else self.log_weights[members],
        )

    @cached_property
    def _middle(self) -> FloatArray:
        return np.asarray((self.control_points.min(axis=0) + self.control_points.max(axis=0)) / 2)

    @cached_property
    def _normal_field(self) -> NormalField:
        return NormalField(self.domain, self.log_products, self.control_points)
