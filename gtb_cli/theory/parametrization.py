"""The rational basis T_i of a patch, and its parametrisations.

The toric parametrisation, the paper's, has ``s(u) = Σ_j s_j ξ_j log h_j(u)``. The linear one has μ(s(u)) = u, so that a
patch whose control points are its knots is the identity. The image is the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.moment.torus import CUT_OFF_SHARE, NO_ROWS, block_length, exponentials, weighted_sums
from gtb_cli.theory.basis import Location, face_knots, torus_coordinates
from gtb_cli.values import frozen

if TYPE_CHECKING:
    from gtb_cli.theory.linear import LinearParametrization

Parametrization: TypeAlias = Literal["toric", "linear"]


@frozen
class RationalBasis:
    """The rational basis ``T_i = c_i ω_i β_i / Σ c ω β`` of a domain and weights.

    Parameters
    ----------
    domain : Domain
    log_weights : (n,) float
        log(c_i ω_i); T depends only on these and the domain.

    References
    ----------
    Eq. (202), eq. (205); Thm 2.1, Thm 2.3.
    """

    domain: Domain
    log_weights: FloatArray

    def locations(
        self,
        u: ArrayLike,
        parametrization: Parametrization = "toric",
        faces: IntArray | None = None,
        within: float = 0.0,
    ) -> Iterable[Location]:
        """Locate parameters, for `values` and `blend`.

        Parameters
        ----------
        u : (m, d) float, or (m,) for a curve
        parametrization : {"toric", "linear"}
        faces : (m,) int, optional
            Numbers of the faces of Δ on which the parameters are known to lie, despite rounding.
        within : float
            Sufficient accuracy of linear parameters, as a fraction of Δ's size.

        Raises
        ------
        DomainError
            A parameter is not finite or lies outside Δ, or the parametrisation is unknown.
        ToleranceError
            A linear parameter was not found to `RESIDUAL`.
        """
        columns = self.domain.columns(u)
        if parametrization == "toric":
            return toric_locations(self.domain, columns, faces)
        if parametrization == "linear":
            return self.linear.locations(columns, faces, within)
        raise DomainError(f"parametrization: expected toric or linear, got {parametrization!r}")

    @cached_property
    def linear(self) -> LinearParametrization:
        """The linear parametrisation."""
        from gtb_cli.theory.linear import LinearParametrization  # a small toric mesh does not need it

        return LinearParametrization(self.domain, self.log_weights)

    def values(self, locations: Iterable[Location], count: int) -> FloatArray:
        """(count, n) values T_i at the locations of `count` parameters; exact zeros off the face of a location."""
        result = np.zeros((count, len(self.domain.knots)))
        for rows, face, knots, s, _ in locations:
            e = exponentials(knots, self.log_weights[face.knots], s)
            e /= e.sum(axis=0)
            e[e <= CUT_OFF_SHARE] = 0.0
            values = np.zeros((e.shape[1], result.shape[1]))
            values[:, face.knots] = e.T
            result[rows] = values
        return result

    def blend(self, values: FloatArray, locations: Iterable[Location], count: int) -> FloatArray:
        """(count, k) sums ``Σ_i T_i values_i`` of (n, k) values, such as control points, without storing T.

        The sum at a corner with one knot is exactly the value of that knot.

        Notes
        -----
        The cost is n exps and r logs per parameter and two small matrix products, in blocks that fit in the cache.
        """
        result = np.empty((count, values.shape[1]))
        for location in locations:
            face = location.face.knots
            sums = weighted_sums(location.knots, self.log_weights[face], values[face], location.s)
            if isinstance(location.rows, slice):
                np.divide(sums[1:], sums[0], out=result[location.rows].T)
            else:
                for column, values_there in zip(result.T, sums[1:] / sums[0], strict=True):
                    column[location.rows] = values_there  # numpy takes twice as long for rows
        return result


def blend_each(
    values: FloatArray, log_weights: FloatArray, numbers: IntArray, locations: Iterable[Location]
) -> FloatArray:
    """(m, k) sums ``Σ_i T_i values_i`` at m parameters, each with its own one of (p, n, k) values, by its number.

    Numbers ascend, and so do the rows of each location. Logarithms of weights are (n,), or (p, n) with numbers alike.
    """
    result = np.empty((len(numbers), values.shape[2]))
    for location in locations:
        face, own = location.face.knots, numbers[location.rows]
        weights, chosen = log_weights[..., face], values[:, face]
        shares = exponentials(location.knots, weights if weights.ndim == 1 else weights[own].T, location.s)
        shares /= shares.sum(axis=0)
        if len(own) < 16 * len(values):  # a few for each: all at once take less time than one after another
            result[location.rows] = np.einsum("mnk,nm->mk", chosen[own], shares)
            continue
        ends = np.searchsorted(own, np.arange(len(values) + 1)).tolist()
        sums = np.empty((values.shape[2], len(own)))
        for one, begin, end in zip(chosen, ends[:-1], ends[1:], strict=True):
            np.matmul(one.T, shares[:, begin:end], out=sums[:, begin:end])
        result[location.rows] = sums.T
    return result


def toric_locations(domain: Domain, u: FloatArray, faces: IntArray | None = None) -> Iterator[Location]:
    """Locate (m, d) parameters in the toric parametrisation; see `RationalBasis.locations`."""

    centred = domain.knots - domain.center
    for rows, number, heights in _blocks(domain, u, faces):
        face = domain.faces[number]
        if face.is_interior:
            yield Location(rows, face, centred, torus_coordinates(domain, heights), heights)
            continue
        s = np.zeros((0, heights.shape[1]))
        if not face.is_corner:
            others = np.where(heights == 0, 1.0, heights)
            s = (domain.direction(face.index) @ torus_coordinates(domain, others))[None]
        yield Location(rows, face, face_knots(domain, face), s, heights)


def _blocks(
    domain: Domain, u: FloatArray, faces: IntArray | None
) -> Iterator[tuple[slice | IntArray, int, FloatArray]]:
    """Split (m, d) parameters into blocks, each on one face: rows, number of the face, edge functions."""
    length = block_length(len(domain.knots))
    rows: list[IntArray] = []
    kept: list[FloatArray] = []
    for start in range(0, len(u), length):
        known = None if faces is None else faces[start : start + length]
        heights = domain.heights_of_columns(u[start : start + length], start, known)
        boundary = np.flatnonzero((heights == 0).any(axis=0)) if heights.min() == 0 else NO_ROWS
        if len(boundary):
            rows.append(start + boundary)
            kept.append(heights[:, boundary])
            heights[:, boundary] = 1.0
        if len(boundary) < heights.shape[1]:
            yield slice(start, start + heights.shape[1]), INTERIOR, heights
    if rows:
        row, heights = np.concatenate(rows), np.concatenate(kept, axis=1)
        for number, members in groups(domain.faces.at(heights)):
            for start in range(0, len(members), length):
                part = members[start : start + length]
                yield row[part], number, heights[:, part]
