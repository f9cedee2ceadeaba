"""Points and normals of several patches at parameters of either parametrisation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import get_args

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, put_columns
from gtb_cli.errors import DomainError
from gtb_cli.knots.face import INTERIOR
from gtb_cli.theory.basis import Location
from gtb_cli.theory.linear import LinearParametrization
from gtb_cli.theory.parametrization import Parametrization, blend_each, toric_locations
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen


@frozen
class Sampler:
    """Points and normals of several patches at parameters of either parametrisation.

    Patches with equal knots are located together.

    With `shared_edges`, edges are sampled linearly, by their own data, even in the toric parametrisation, so that
    patches that share an edge have the same points there.

    If `wholes` are given, each patch only says where a part of a larger one lies, which is evaluated in its place;
    `faces` (patches, faces) has the number of the face of the larger one that holds each face of the part.

    A `resolution` says that all parameters at once may be those of triangulations with so many cells along an edge:
    linear ones are then found sooner.
    """

    patches: Sequence[Patch]
    parametrization: Parametrization
    shared_edges: bool
    flipped: Sequence[bool] = ()
    wholes: Sequence[Patch] = ()
    faces: IntArray | None = None
    resolution: int = 0

    def __post_init__(self) -> None:
        if self.parametrization not in get_args(Parametrization):
            raise DomainError(f"parametrization: expected toric or linear, got {self.parametrization!r}")

    def points(self, patch: IntArray, parameters: FloatArray, face: IntArray, within: float = 0.0) -> FloatArray:
        """(m, 3) positions of (m, d) parameters, each in its own patch, known to lie on given faces.

        Linear parameters may be off by `within`, a fraction of the domain's size: they are then found sooner.
        """
        result = np.empty((len(patch), 3))
        face = self._whole_faces(patch, face)
        for nets, rows, numbers in self.alike(patch):
            locations = self._located(nets.linear, parameters[rows], face[rows], within, nets.weights_of(numbers))
            if len(nets.patches) > 1:
                result[rows] = blend_each(nets.control_points, nets.linear.log_weights, numbers, locations)
            else:
                result[rows] = nets.patches[0].points_at(locations, len(numbers))
        return result

    def normals(self, patch: IntArray, parameters: FloatArray, face: IntArray) -> FloatArray:
        """(m, 3) unit normals, NaN where there is none, reversed where a patch is flipped."""
        result = np.empty((len(patch), 3))
        face = self._whole_faces(patch, face)
        for nets, rows, numbers in self.alike(patch):
            vectors = nets.weights_of(numbers)
            locations = list(self._located(nets.linear, parameters[rows], face[rows], 0.0, vectors))
            bounds = np.searchsorted(numbers, np.arange(len(nets.members) + 1)).tolist()
            for index, begin, end in zip(nets.members, bounds[:-1], bounds[1:], strict=True):
                sign = -1.0 if self.flipped and self.flipped[index] else 1.0
                own = (part for location in locations if (part := location.part(begin, end)) is not None)
                result[rows[begin:end]] = sign * self.evaluated[index].normals_at(own, end - begin)
        return result

    def faces_at(self, patch: IntArray, parameters: FloatArray) -> IntArray:
        """(m,) numbers of the faces of the patches' domains on which (m, d) parameters lie."""
        result = np.empty(len(patch), dtype=np.int64)
        for index in np.unique(patch).tolist():
            rows, domain = np.flatnonzero(patch == index), self.patches[index].domain
            result[rows] = domain.faces.at(domain.heights_of_columns(parameters[rows]))
        return result

    def near(
        self, patch: IntArray, parameters: FloatArray, face: IntArray, guesses: FloatArray, within: float
    ) -> tuple[FloatArray, FloatArray]:
        """(m, 3) points of surfaces like `points`, found sooner from (2, m) guesses; also the (2, m) right guesses.

        Both are NaN where there are none, as on the boundary. See `Nets.near`.
        """
        points, right = np.full((len(patch), 3), np.nan), np.full(guesses.shape, np.nan)
        inside = np.flatnonzero(self._whole_faces(patch, face) == INTERIOR)
        for nets, rows, numbers in self.alike(patch[inside]):
            rows = inside[rows]
            location, found = nets.near(numbers, parameters[rows], guesses.take(rows, axis=1), within)
            there = rows[location.rows]
            numbers, weights = numbers[location.rows], nets.linear.log_weights
            points[there] = blend_each(nets.control_points, weights, numbers, [location._replace(rows=slice(None))])
            put_columns(right, there, found)
        rest = np.flatnonzero(np.isnan(points[:, 0]))
        if len(rest):
            points[rest] = self.points(patch[rest], parameters[rest], face[rest], within)
        return points, right

    @property
    def evaluated(self) -> Sequence[Patch]:
        """The patches themselves, or those whose parts they are."""
        return self.wholes or self.patches

    def locations(self, index: int, u: FloatArray, face: IntArray, within: float = 0.0) -> Iterator[Location]:
        """Locate (m, d) parameters of one patch, known to lie on given faces of its domain."""
        return self._located(self.evaluated[index].rational_basis.linear, u, face, within, None)

    def alike(self, patch: IntArray) -> Iterator[tuple[Nets, IntArray, IntArray]]:
        """Yield for (m,) patches those with equal knots, (k,) rows, and the (k,) ascending numbers of their nets."""
        place = self._place_of[patch]
        order = np.argsort(place, kind="stable")
        place, begin, first = place[order], 0, 0
        for nets in self._nets:
            end = int(np.searchsorted(place, first + len(nets.members)))
            if end > begin:
                yield nets, order[begin:end], place[begin:end] - first
            begin, first = end, first + len(nets.members)

    def _whole_faces(self, patch: IntArray, face: IntArray) -> IntArray:
        return face if self.faces is None else self.faces[patch, face]

    def _located(
        self, linear: LinearParametrization, u: FloatArray, face: IntArray, within: float, vectors: IntArray | None
    ) -> Iterator[Location]:
        if self.parametrization == "linear":
            yield from linear.locations(u, face, within, self.resolution, vectors)
            return
        yield from toric_locations(linear.shape, u, face)
        if self.shared_edges and face.any():
            rows = np.flatnonzero(face)
            own = None if vectors is None else vectors[rows]
            for location in linear.locations(u[rows], face[rows], numbers=own):
                yield location._replace(rows=rows[location.rows])

    @cached_property
    def _nets(self) -> list[Nets]:
        members: dict[tuple[bytes, ...], list[int]] = {}
        for index, patch in enumerate(self.evaluated):
            basis = patch.rational_basis
            # Uniform meshes are interpolated from coarse ones, which depend on the weights.
            arrays = basis.domain.knots, basis.domain.normals, *((basis.log_weights,) if self.resolution else ())
            members.setdefault(tuple(array.tobytes() for array in arrays), []).append(index)
        return [Nets(tuple(self.evaluated[index] for index in indices), tuple(indices)) for indices in members.values()]

    @cached_property
    def _place_of(self) -> IntArray:
        """(patches,) places of the patches in the order of `_nets`."""
        order = np.concatenate([nets.members for nets in self._nets])
        place = np.empty(len(order), dtype=np.int64)
        place[order] = np.arange(len(order))
        return place


@frozen
class Nets:
    """The control points of patches with equal knots, and for uniform meshes equal weights.

    Parameters
    ----------
    patches : tuple of Patch
    members : tuple of int
        Their numbers among all patches.
    """

    patches: Sequence[Patch]
    members: tuple[int, ...]

    @cached_property
    def linear(self) -> LinearParametrization:
        """The linear parametrisation with the weights of all patches, or with one vector if they are equal."""
        basis = self.patches[0].rational_basis
        weights = np.stack([patch.log_products for patch in self.patches])
        return basis.linear if (weights == weights[0]).all() else LinearParametrization(basis.domain, weights)

    def weights_of(self, numbers: IntArray) -> IntArray | None:
        """Return the numbers of the vectors of weights of (m,) patches, or None if there is one vector."""
        return numbers if self.linear.log_weights.ndim == 2 else None

    @cached_property
    def control_points(self) -> FloatArray:
        """(patches, n, 3) control points."""
        return np.stack([patch.control_points for patch in self.patches])

    def near(self, numbers: IntArray, u: FloatArray, guesses: FloatArray, within: float) -> tuple[Location, FloatArray]:
        """Locate (m, 2) linear parameters inside Δ, in the coordinates of its longest edge, from (2, m) guesses.

        A guess is the difference between torus coordinates and those from the nearest layers of knots, or from 0 if
        knots crowd. It changes slowly, so that a nearby point's serves; NaN stands for an unknown one. Parameters may
        be off by `within`, a fraction of the domain's size. Returns the points found, and their (2, k) right guesses.
        """
        longest = self.linear.longest
        places = longest.columns(u)
        layers = longest.moments.starts(places)
        base = np.zeros_like(layers) if self._is_crowded else layers
        start = np.where(np.isnan(guesses), layers, base + guesses)
        s, missing = longest.moments.near(places, start, within, self.weights_of(numbers))
        rows = np.delete(np.arange(len(u)), missing)
        if len(missing):
            s, base = s.take(rows, axis=1), base.take(rows, axis=1)
        return Location(rows, self.linear.shape.faces[INTERIOR], longest.moments.knots, s, None), s - base

    @cached_property
    def _is_crowded(self) -> bool:
        """Whether knots are so near an edge that starts from these alone say nothing of points farther inside.

        The distance from an edge to the next knot, in units of 1/√n of the widest, is 1 in lattices; it was 0.4 or more
        in all of specs/, and 0.001 among 1,000 random knots.
        """
        heights = self.linear.shape.heights
        least = np.where(heights > 0, heights, np.inf).min(axis=0) / heights.max(axis=0)
        return bool(least.min() * len(heights) ** 0.5 < 0.1)
