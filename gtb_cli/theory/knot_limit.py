"""What knots leave behind that move to the boundary of Δ: films, which the limit of the patches has as a set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, IntArray, read_only
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.tessellation.triangulation import triangulation
from gtb_cli.theory.degeneration import ends_of_moves, merge_knots
from gtb_cli.theory.domain import domain
from gtb_cli.theory.linear import LinearParametrization
from gtb_cli.theory.patch import Patch

PARALLEL = 1e-9
"""Speeds whose second singular value is below this fraction of the first are parallel: knots typed on one line."""

CELLS = {1: 1024, 2: 64}
"""Cells of a film along each of its sides."""


@dataclass(frozen=True, eq=False)
class Film:
    """What moving knots leave between the patch's boundary, which stays, and that of the merged patch.

    On a facet or corner F of Δ let η_i be the speeds, over the facets that meet in F, at which the knots that end on F
    come there (0 for those that are there). For distances ε from the end of the way, the points of the patch at
    torus coordinates s + τ/ε outwards tend to those of the knots on F with the weights ``c_i ω_i ∏_j z_j^{η_ij}``,
    z_j = e^{−τ_j} from 1, the merged patch's boundary, to 0, the boundary that stays.

    Attributes
    ----------
    face : int
        Row of `Domain.faces` of F.
    members : (k,) int
        The knots that end on F.
    speeds : (k, g) float
        η, for the g facets that meet in F, in units of the smallest positive one of each.
    along : (k,) or None
        Coordinates of the ends of the ways along an edge; None where F is a corner, or an end of a curve.
    log_products : (k,) float
        log(c_i ω_i).
    control_points : (k, 3) float
    """

    face: int
    members: IntArray
    speeds: FloatArray
    along: FloatArray | None
    log_products: FloatArray
    control_points: FloatArray

    def section(self, z: float) -> Patch:
        """Return the curve at level z of the film of an edge."""
        if self.along is None:
            raise DomainError("the film of a corner has no sections")
        return self._curve(self._log_weights(np.array([[z]]))[0])

    def points(self, z: ArrayLike) -> FloatArray:
        """(m, 3) points at (m, g) levels z of the film of a corner or end."""
        if self.along is not None:
            raise DomainError("the film of an edge consists of sections")
        logs = self._log_weights(np.asarray(z, dtype=np.float64))
        weights = np.exp(logs - logs.max(axis=1, keepdims=True))
        return np.asarray(weights @ self.control_points / weights.sum(axis=1, keepdims=True))

    def _log_weights(self, z: FloatArray) -> FloatArray:
        """(m, k) logarithms of the weights, −inf where they vanish."""
        with np.errstate(divide="ignore", invalid="ignore"):
            powers = self.speeds[None] * np.log(z)[:, None, :]
        return np.asarray(self.log_products + np.where(self.speeds[None] > 0, powers, 0.0).sum(axis=2))

    def _curve(self, log_weights: FloatArray) -> Patch:
        here = np.isfinite(log_weights)
        assert self.along is not None
        return Patch(self.along[here], self.control_points[here], log_weights=log_weights[here])


@dataclass(frozen=True, eq=False)
class KnotLimit:
    """The limit of patches whose knots move to others.

    Attributes
    ----------
    patch : Patch
    moves : mapping of int to int
    """

    patch: Patch
    moves: Mapping[int, int]

    @cached_property
    def merged(self) -> Patch:
        """The merged patch: the limit at every point inside Δ."""
        return merge_knots(self.patch, self.moves)

    @cached_property
    def films(self) -> tuple[Film, ...]:
        """What the limit as a set has beside the merged patch; nothing where the convergence is uniform."""
        return tuple(_films(self.patch, ends_of_moves(self.patch, self.moves)))

    @cached_property
    def arrivals(self) -> Mapping[int, int]:
        """For each knot that comes to an end, corner or edge on which it is not: that row of `Domain.faces`."""
        shape, ends = self.patch.domain, ends_of_moves(self.patch, self.moves)
        comes = shape.incidence[ends] & ~shape.incidence
        # Rows go from Δ over edges to corners: the last that holds the end of the way is the smallest.
        smallest = len(shape.faces) - 1 - shape.faces[::-1, ends].argmax(axis=0)
        return {k: int(smallest[k]) for k in np.flatnonzero(comes.any(axis=1)).tolist()}

    def nearness(self, step: float) -> float:
        """Smallest distance, at a step, of a knot from a facet that it comes to, as a fraction of Δ's size."""
        shape = self.patch.domain
        ends = ends_of_moves(self.patch, self.moves)
        comes = shape.incidence[ends] & ~shape.incidence
        least = (shape.heights / shape.normal_lengths).min(where=comes, initial=np.inf)
        return float(least) * (1 - step) / shape.size

    @property
    def is_uniform(self) -> bool:
        """Whether the patches converge to the merged patch as sets, in the Hausdorff distance."""
        return not self.films


def knot_limit(patch: Patch, moves: Mapping[int, int]) -> KnotLimit:
    """Find what a patch tends to as knots move to the places of others, along lines and all at once.

    Parameters
    ----------
    patch : Patch
    moves : mapping of int to int
        As for `merge_knots`.

    Returns
    -------
    KnotLimit
        The merged patch, to which the patches converge at every point inside Δ, and the films, which the limit as a
        set has besides.

    Raises
    ------
    DomainError
        As `merge_knots`.

    Notes
    -----
    A knot that comes to a boundary from inside does not count there before it has arrived: the
    boundary of the patches stays what it was, while inside they tend to a patch with another boundary. The Hausdorff
    limit is the merged patch with what is stretched between the two: a segment at the end of a curve (a curve where
    several knots arrive there), a membrane at an edge.

    References
    ----------
    Thm 3.1, Thm 4.1, which claim the merged patch alone; Ex. 4.2.
    """
    ends_of_moves(patch, moves)
    return KnotLimit(patch, dict(moves))


def _films(patch: Patch, targets: IntArray) -> list[Film]:
    shape = patch.domain
    r = len(shape.vertices)
    moved = targets != np.arange(len(targets))
    films = []
    for face, ends_on in enumerate(shape.faces[:, targets]):
        facets = np.flatnonzero(shape.vanishing[face])
        members = np.flatnonzero(ends_on)
        speeds = np.where(moved[members, None], shape.heights[members][:, facets], 0.0)
        if face == 0 or not speeds.any():
            continue
        along = None
        if shape.dimension == 2 and face <= r:
            along = shape.along(face - 1, patch.knots[targets[members]])
        elif shape.dimension == 2:
            # Where all come on one line, the film of the corner is a border of its edges' films.
            values = np.linalg.svd(speeds / speeds.max(axis=0, initial=np.finfo(float).tiny), compute_uv=False)
            if len(values) < 2 or values[1] <= PARALLEL * values[0]:
                continue
        units = [column[column > 0].min(initial=np.inf) for column in speeds.T]
        films.append(
            Film(
                face,
                members,
                read_only(speeds / np.array(units)),
                along,
                patch.log_products[members],
                patch.control_points[members],
            )
        )
    return films


def film_mesh(limit: KnotLimit, resolution: int | None = None) -> Mesh:
    """Mesh the films of a knot limit: segments for a curve, triangles for a surface.

    Parameters
    ----------
    limit : KnotLimit
        With films.
    resolution : int, optional
        Cells along each side of each film; default `CELLS`.
    """
    dimension = limit.patch.dimension
    n = CELLS[dimension] if resolution is None else resolution
    points, cells, count = [], [], 0
    for film in limit.films:
        if dimension == 1:
            points.append(film.points((np.arange(n + 1) / n)[:, None]))
            cells.append(count + np.stack([np.arange(n), np.arange(1, n + 1)], axis=1))
        else:
            points.append(_film_points(film, n))
            cells.append(count + triangulation(_SQUARE, n).cells)
        count += len(points[-1])
    vertices, triangles = np.concatenate(points), np.concatenate(cells)
    # Sections share the corners that no knot comes to: no cell there.
    distinct = (vertices[triangles] != vertices[np.roll(triangles, 1, axis=1)]).any(axis=2)
    return Mesh(vertices, triangles[distinct.all(axis=1)], name="film")


_SQUARE = domain([[0, 0], [1, 0], [1, 1], [0, 1]])


def _film_points(film: Film, n: int) -> FloatArray:
    """The film of a surface at ((n + 1)², 3) points, row by row."""
    levels = np.arange(n + 1) / n
    if film.along is not None:
        return np.concatenate([_section_points(film.section(z), n) for z in levels.tolist()])
    first, second = np.meshgrid(levels, levels, indexing="ij")
    return film.points(np.column_stack([first.ravel(), second.ravel()]))


def _section_points(section: Patch, n: int) -> FloatArray:
    start, end = section.domain.vertices[:, 0]
    t = start + (end - start) * (np.arange(n + 1) / n)
    t[-1] = end
    where = LinearParametrization(section.domain, section.log_products).locations(t[:, None])
    return section.points_at(where, n + 1)
