"""Points and normals of several patches at parameters of either parametrisation."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, get_args

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.errors import DomainError
from gtb_cli.knots.face import INTERIOR
from gtb_cli.theory.basis import Location
from gtb_cli.theory.parametrization import Parametrization, RationalBasis, toric_locations
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

if TYPE_CHECKING:
    from gtb_cli.tessellation.neighbours import Neighbours
    from gtb_cli.theory.linear import LinearParametrization

MAX_SHARED_LOCATIONS = 4096
"""Largest number of parameters of a patch whose locations are kept for others: more take long to evaluate anyway."""


@frozen
class Sampler:
    """Points and normals of several patches at parameters of either parametrisation.

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
        face = face if self.faces is None else self.faces[patch, face]
        for index, rows in _groups(patch):
            points = self._made(self.evaluated[index].points_at, index, parameters[rows], face[rows], within)
            if isinstance(rows, slice):
                return points
            result[rows] = points
        return result

    @cached_property
    def neighbours(self) -> list[Neighbours]:
        """Of each patch what finds points beside others."""
        from gtb_cli.tessellation.neighbours import Neighbours  # a uniform mesh does not need it

        return [Neighbours(*pair) for pair in zip(self.evaluated, self._linear, strict=True)]

    def corrections(self, patch: IntArray, parameters: FloatArray, face: IntArray) -> FloatArray:
        """(m, 2) corrections of points, NaN where there are none, as on the boundary."""
        result = np.full(parameters.shape, np.nan)
        face = face if self.faces is None else self.faces[patch, face]
        inside = np.flatnonzero(face == INTERIOR)
        for index, own in groups(patch[inside]):
            result[inside[own]] = self.neighbours[index].corrections(parameters[inside[own]])
        return result

    def _made(
        self,
        function: Callable[[Iterable[Location], int], FloatArray],
        index: int,
        u: FloatArray,
        face: IntArray,
        within: float = 0.0,
    ) -> FloatArray:
        """(m, 3) positions or normals on one patch."""
        if self.resolution and self.parametrization == "linear" and len(u) > MAX_SHARED_LOCATIONS:
            return self._linear[index].evenly(function, u, face, self.resolution)
        return function(self.locations(index, u, face, within), len(u))

    def normals(self, patch: IntArray, parameters: FloatArray, face: IntArray) -> FloatArray:
        """(m, 3) unit normals, NaN where there is none, reversed where a patch is flipped."""
        result = np.empty((len(patch), 3))
        face = face if self.faces is None else self.faces[patch, face]
        for index, rows in _groups(patch):
            sign = -1.0 if self.flipped and self.flipped[index] else 1.0
            result[rows] = sign * self._made(self.evaluated[index].normals_at, index, parameters[rows], face[rows])
        return result

    @property
    def evaluated(self) -> Sequence[Patch]:
        """The patches themselves, or those whose parts they are."""
        return self.wholes or self.patches

    @cached_property
    def _linear(self) -> list[LinearParametrization]:
        bases = [patch.rational_basis for patch in self.evaluated]
        if self.resolution or self.evaluated[0].dimension == 1:
            return [basis.linear() for basis in bases]
        # What a patch learnt from another would change its points by rounding; where all is known, nothing is learnt.
        result: list[LinearParametrization] = []
        known: dict[RationalBasis, LinearParametrization] = {}
        for basis in bases:
            result.append(known.get(basis) or basis.linear())
            if result[-1].longest.moments.bezier_shift is not None:
                known[basis] = result[-1]
        return result

    def locations(self, index: int, u: FloatArray, face: IntArray, within: float = 0.0) -> Iterable[Location]:
        """Locate (m, d) parameters of one patch, known to lie on given faces of its domain.

        Patches with the same basis share the locations of uniform meshes: finding them takes most of the time of a
        coarse mesh.
        """
        if not self.resolution or len(u) > MAX_SHARED_LOCATIONS:
            return self._located(index, u, face, within)
        key = (self.evaluated[index].rational_basis, u.tobytes(), face.tobytes(), within)
        if key not in self._shared:
            self._shared[key] = list(self._located(index, u, face, within))
        return self._shared[key]

    @cached_property
    def _shared(self) -> dict[tuple[object, ...], list[Location]]:
        return {}

    def _located(self, index: int, u: FloatArray, face: IntArray, within: float) -> Iterator[Location]:
        if self.parametrization == "linear":
            yield from self._linear[index].locations(u, face, within, self.resolution)
            return
        yield from toric_locations(self.evaluated[index].domain, u, face)
        if self.shared_edges and face.any():
            rows = np.flatnonzero(face)
            for location in self._linear[index].locations(u[rows], face[rows]):
                yield location._replace(rows=rows[location.rows])


def _groups(patch: IntArray) -> Iterator[tuple[int, slice | IntArray]]:
    """Rows of each patch; a slice of all rows if there is only one patch."""
    if len(patch) and (patch == patch[0]).all():
        yield int(patch[0]), slice(None)
    else:
        yield from groups(patch)
