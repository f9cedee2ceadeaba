"""Points and normals of several patches at parameters (for `-n`: those of `even_triangulation`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from typing import TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.moment.torus import exponentials
from gtb_cli.tessellation.complexes import kinds_of
from gtb_cli.theory.basis import Location
from gtb_cli.theory.patch import Patch
from gtb_cli.theory.rational_basis import LinearParametrization, toric_locations
from gtb_cli.values import frozen

# Locates (m, d) parameters on given faces of Δ, to a fraction `within` of its size; `numbers` has the vector of weights
# of each, if there are several. Called as `LinearParametrization.locations` is.
Locate: TypeAlias = Callable[..., Iterator[Location]]


def torically(linear: LinearParametrization, u: FloatArray, face: IntArray, **_: object) -> Iterator[Location]:
    """Locate toric parameters."""
    return toric_locations(linear.shape, u, face)


def torically_inside(
    linear: LinearParametrization, u: FloatArray, face: IntArray, within: float = 0.0, numbers: IntArray | None = None
) -> Iterator[Location]:
    """Locate parameters, toric inside Δ and linear on edges, so that patches that share an edge share its points."""
    yield from toric_locations(linear.shape, u, face)
    rows = np.flatnonzero(face)
    for location in linear.locations(u[rows], face[rows], numbers=None if numbers is None else numbers[rows]):
        yield location._replace(rows=rows[location.rows])


@frozen
class Sampler:
    """Points and normals of several patches; parameters of patches with equal knots are located together."""

    patches: Sequence[Patch]
    locate: Locate = LinearParametrization.locations
    parts: Sequence[Domain] = ()  # of the patches' domains, if parameters are in the parts
    faces: IntArray | None = None  # (patches, faces) of each domain, by number, that hold the faces of its part

    @property
    def domains(self) -> Sequence[Domain]:
        """The domains in which parameters are."""
        return self.parts or [patch.domain for patch in self.patches]

    def points(self, patch: IntArray, parameters: FloatArray, face: IntArray, within: float = 0.0) -> FloatArray:
        """Return points, (m, 3), at (m, d) parameters on known faces of their patches, sooner to `within` of Δ."""
        result, face = np.empty((len(patch), 3)), self._faces_of_patches(patch, face)
        for nets, rows, numbers in self._alike(patch):
            own = nets.vectors(numbers)
            locations = self.locate(nets.linear, parameters[rows], face[rows], within=within, numbers=own)
            if len(nets.patches) > 1:
                result[rows] = nets.blend(numbers, locations)
            else:
                result[rows] = nets.patches[0].points_at(locations, len(numbers))
        return result

    def normals(self, patch: IntArray, parameters: FloatArray, face: IntArray) -> FloatArray:
        """Return the unit normals, (m, 3), NaN where there is none."""
        result, face = np.empty((len(patch), 3)), self._faces_of_patches(patch, face)
        for index, rows in groups(patch):
            locations = self.locations(index, parameters[rows], face[rows])
            result[rows] = self.patches[index].normals_at(locations, len(rows))
        return result

    def locations(self, index: int, u: FloatArray, face: IntArray) -> Iterator[Location]:
        """Locate (m, d) parameters of one patch, known to lie on given faces of its domain."""
        return self.locate(self.patches[index].rational_basis.linear, u, face)

    def faces_at(self, patch: IntArray, parameters: FloatArray) -> IntArray:
        """Return the numbers of the faces of the patches' domains on which (m, d) parameters lie."""
        result = np.empty(len(patch), dtype=np.int64)
        for index, rows in groups(patch):
            domain = self.patches[index].domain
            result[rows] = domain.faces.at(domain.heights_of_columns(parameters[rows]))
        return result

    def near(
        self, patch: IntArray, parameters: FloatArray, face: IntArray, guesses: FloatArray, within: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return what `points` does, found sooner from (2, m) guesses (NaN: unknown), and the right guesses."""
        points, right = np.full((len(patch), 3), np.nan), np.full(guesses.shape, np.nan)
        inside = np.flatnonzero(self._faces_of_patches(patch, face) == INTERIOR)
        for nets, rows, numbers in self._alike(patch[inside]):
            rows = inside[rows]
            location, found = nets.near(numbers, parameters[rows], guesses.take(rows, axis=1), within)
            there, own = rows[location.rows], numbers[location.rows]
            points[there] = nets.blend(own, [location._replace(rows=slice(None))])
            right[:, there] = found
        rest = np.flatnonzero(np.isnan(points[:, 0]))
        if len(rest):
            points[rest] = self.points(patch[rest], parameters[rest], face[rest], within)
        return points, right

    def _faces_of_patches(self, patch: IntArray, face: IntArray) -> IntArray:
        return face if self.faces is None else self.faces[patch, face]

    def _alike(self, patch: IntArray) -> Iterator[tuple[_AlikePatches, IntArray, IntArray]]:
        """Yield the patches with equal knots, the (k,) rows of points in them, and the ascending numbers among them."""
        kinds, nets = self._kinds
        for kind, rows in groups(kinds[patch]):
            rows = rows[np.argsort(patch[rows], kind="stable")]
            yield nets[kind], rows, np.searchsorted(nets[kind].members, patch[rows])

    @cached_property
    def _kinds(self) -> tuple[IntArray, dict[int, _AlikePatches]]:
        kinds = kinds_of([patch.domain for patch in self.patches])
        return kinds, {k: _AlikePatches(own, [self.patches[index] for index in own]) for k, own in groups(kinds)}


@frozen
class _AlikePatches:
    """Patches with equal knots, and their (p,) ascending numbers among all."""

    members: IntArray
    patches: Sequence[Patch]

    @cached_property
    def linear(self) -> LinearParametrization:
        """The linear parametrisation with the weights of all patches, or with one vector if they are equal."""
        basis = self.patches[0].rational_basis
        weights = np.stack([patch.log_products for patch in self.patches])
        return basis.linear if (weights == weights[0]).all() else LinearParametrization(basis.domain, weights)

    def vectors(self, numbers: IntArray) -> IntArray | None:
        """Return the number of the vector of weights of each patch, (m,), or None if all have the same."""
        return numbers if self.linear.log_weights.ndim == 2 else None

    @cached_property
    def control_points(self) -> FloatArray:
        """The control points of all, (p, n, 3)."""
        return np.stack([patch.control_points for patch in self.patches])

    def blend(self, numbers: IntArray, locations: Iterable[Location]) -> FloatArray:
        """Return points, (m, 3), of the patches with these (m,) numbers, which ascend in the rows of each location."""
        points, result = self.control_points, np.empty((len(numbers), 3))
        for rows, face, knots, s in locations:
            own = numbers[rows]
            weights, chosen = self.linear.log_weights[..., face.knots], points[:, face.knots]
            shares = exponentials(knots, weights if weights.ndim == 1 else weights[own].T, s)
            shares /= shares.sum(axis=0)
            ends = np.searchsorted(own, np.arange(len(points) + 1)).tolist()
            sums = np.empty((3, len(own)))
            for one, begin, end in zip(chosen, ends[:-1], ends[1:], strict=True):
                np.matmul(one.T, shares[:, begin:end], out=sums[:, begin:end])
            result[rows] = sums.T
        return result

    def near(self, numbers: IntArray, u: FloatArray, guesses: FloatArray, within: float) -> tuple[Location, FloatArray]:
        """Locate (m, 2) linear parameters inside Δ, in the coordinates of its longest edge, from (2, m) guesses or NaN.

        A guess is what must be added to the torus coordinates that the nearest layers of knots give, or to 0 if knots
        crowd; the guess of a point nearby serves. Return the points found, and their right guesses.
        """
        longest = self.linear.longest
        places = longest.columns(u)
        layers = longest.moments.starts(places)
        base = np.zeros_like(layers) if self._is_crowded else layers
        start = np.where(np.isnan(guesses), layers, base + guesses)
        s, missing = longest.moments.near(places, start, within, self.vectors(numbers))
        rows = np.delete(np.arange(len(u)), missing)
        if len(missing):
            s, base = s.take(rows, axis=1), base.take(rows, axis=1)
        return Location(rows, self.linear.shape.faces[INTERIOR], longest.moments.knots, s), s - base

    @cached_property
    def _is_crowded(self) -> bool:
        """Tell whether knots are so near an edge that they alone are no start for points farther inside."""
        # In units of 1/√n of the widest, the next knot's distance is 1 in lattices, .001 among 1,000 random knots.
        heights = self.linear.shape.heights
        least = np.where(heights > 0, heights, np.inf).min(axis=0) / heights.max(axis=0)
        return bool(least.min() * len(heights) ** 0.5 < 0.1)
