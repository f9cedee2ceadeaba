"""Grids of parameters of a rectangle along the axes: torus coordinates are found along two lines only."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.moment.grid import Raster, grid_of, raster_of
from gtb_cli.moment.torus import block_length
from gtb_cli.theory.basis import Location

Line = Callable[[int, FloatArray], FloatArray]
"""(m,) torus coordinates along an axis, by its number, of (m,) coordinates inside a rectangle."""


def is_rectangle(shape: Domain) -> bool:
    """Whether the knots are all points of a grid along the axes."""
    return shape.dimension == 2 and len(shape.vertices) == 4 and grid_of(shape.knots) is not None


def with_rasters(
    shape: Domain,
    u: FloatArray,
    faces: IntArray | None,
    line: Line,
    others: Callable[[FloatArray, IntArray | None], Iterable[Location]],
) -> Iterator[Location]:
    """Locate (m, 2) parameters by `line` if they are a grid of a rectangle; those on edges, or all, by `others`.

    Parameters
    ----------
    shape : Domain
    u : (m, 2) float
    faces : (m,) int, optional
        See `gtb_cli.theory.parametrization.RationalBasis.locations`.
    line, others : callable
    """
    raster = raster_of(u) if is_rectangle(shape) else None
    rest = (yield from _inside(shape, u, faces, raster, line)) if raster else None
    if rest is None:
        yield from others(u, faces)
        return
    for location in others(u[rest], None if faces is None else faces[rest]):
        rows = location.rows if isinstance(location.rows, np.ndarray) else np.arange(len(rest))[location.rows]
        yield location._replace(rows=rest[rows])


def _inside(
    shape: Domain, u: FloatArray, faces: IntArray | None, raster: Raster, line: Line
) -> Generator[Location, None, IntArray | None]:
    """Locate the parameters of a raster, and return the rows of those on edges, where `Location.s` means nothing.

    None if any parameter lies outside: nothing has been located then.
    """
    axis, width = raster
    places = u.reshape(-1, width, 2)
    inside, s = [], []
    for number, coordinates in ((axis, places[0, :, axis]), (1 - axis, places[:, 0, 1 - axis])):
        points = np.tile(shape.center, (len(coordinates), 1))
        points[:, number] = coordinates
        try:
            inside.append((shape.heights_of_columns(points) > 0).all(axis=0))
        except DomainError:  # reported with the index of the parameter
            return None
        s.append(np.zeros(len(coordinates)))
        s[-1][inside[-1]] = line(number, coordinates[inside[-1]])
    face, centred, step = shape.faces[INTERIOR], shape.knots - shape.center, block_length(len(shape.knots)) // width
    for first in range(0, len(places), max(step, 1)):
        across = s[1][first : first + max(step, 1)]
        here = np.empty((2, len(across), width))
        here[axis], here[1 - axis] = s[0], across[:, None]
        rows = slice(first * width, (first + len(across)) * width)
        yield Location(rows, face, centred, here.reshape(2, -1), None, raster)
    on_edge = ~np.logical_and.outer(inside[1], inside[0])
    if faces is not None:
        on_edge |= faces.reshape(-1, width) != INTERIOR
    return np.flatnonzero(on_edge)
