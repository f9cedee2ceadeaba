"""Crowding of vertices in the toric parametrisation, which may leave most of a patch to a few triangles."""

import math

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.knots.triangulation import Triangulation, triangulation
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch


def crowding(spec: Patch | Model, resolution: int) -> list[str]:
    """Say how far the vertices of a uniform toric mesh crowd, and what helps; nothing if they do not.

    Parameters
    ----------
    spec : Patch or Model
    resolution : int
        Segments along each edge of each domain.

    Notes
    -----
    Places are compared by ``μ = Σ_i T_i a_i``, their parameters in the linear parametrisation, in which a mesh is even.
    This takes one more evaluation of the patch, with the knots in place of the control points.
    """
    max_side = 0.1  # part of an edge, or of the domain's size, that a side may span before vertices are said to crowd
    min_resolution = 16  # from which on even spacing gives no sides as wide as that
    same_place = 1e-9  # of the domain's size: corners of a face that are nearer are one point
    block_cells = 1 << 14  # whose sides fit in the cache
    patches = spec.patches
    widest, lost, count = 0.0, 0, 0
    for patch in patches:
        part = triangulation(patch.domain, resolution)
        places = _places(patch, part, shared_edges=isinstance(spec, Model))
        widest, count = max(widest, _widest_on_edges(part, places)), count + len(part.cells)
        for begin in range(0, len(part.cells), block_cells):
            corners = places[part.cells[begin : begin + block_cells]] / patch.domain.size
            sides = corners - np.roll(corners, 1, axis=1)
            squares = np.einsum("kce,kce->kc", sides, sides)
            lost += int(np.count_nonzero((squares <= same_place**2).any(axis=1)))
            widest = max(widest, math.sqrt(squares.max()))
    cells, side = ("segments", "segment") if patches[0].dimension == 1 else ("faces", "side of a face")
    found = []
    if lost:
        found.append(f"{lost} of {count} {cells} have corners at one point")
    if widest > max_side and resolution >= min_resolution:
        found.append(f"one {side} spans {widest:.0%} of the patch")
    if not found:
        return []
    return [f"toric parameters crowd: {' and '.join(found)}; leave out --parametrization toric"]


def _places(patch: Patch, part: Triangulation, *, shared_edges: bool) -> FloatArray:
    """(m, d) points μ of the vertices of a toric mesh."""
    sampler = Sampler((patch,), "toric", shared_edges)
    locations = sampler.locations(0, part.parameters, part.faces(patch.domain.faces))
    return patch.rational_basis.blend(patch.knots, locations, len(part.parameters))


def _widest_on_edges(part: Triangulation, places: FloatArray) -> float:
    """The largest part of an edge that a segment on it spans; 0 for a curve."""
    widest = 0.0
    for edge in range(len(part.boundary)) if places.shape[1] == 2 else ():
        steps = np.linalg.norm(np.diff(places[part.side(edge)], axis=0), axis=1)
        widest = max(widest, float(steps.max() / steps.sum()))
    return widest
