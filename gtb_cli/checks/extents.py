"""Lengths of curves, areas of surfaces and volumes inside closed ones, extrapolated from meshes."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, cross, dot
from gtb_cli.knots.triangulation import cell_count
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.measures import measure
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch


class Extent(NamedTuple):
    """A length, area or volume."""

    value: float
    error: float  # an estimate, and not a bound


def extents(shape: Patch | Model) -> dict[str, Extent]:
    """Return the length of curves; or the area of surfaces and, if they are closed, the volume inside, by name.

    One that overflows is left out. It takes as long as a mesh of 100,000 faces.

    Each is extrapolated (Richardson) from meshes, each of which has twice as many segments along an edge as the one
    before. The error is twice the difference of the last two extrapolated values, or of all that would follow if these
    differences went on as they did, and at least 1e-9 of the size. Lengths are integrals between the vertices of a mesh
    within a tolerance, as steep weights bend a curve where even vertices miss it.
    """
    if shape.dimension == 1:
        return _lengths(shape)
    most_faces, most_segments = 80_000, 256  # of the finest mesh
    segments = 8
    while (
        segments < most_segments and sum(cell_count(each.domain, 2 * segments) for each in shape.patches) <= most_faces
    ):
        segments *= 2
    meshes = [tessellate(shape, segments // part, normals=False) for part in (8, 4, 2, 1)]
    frame = Frame.around(meshes[-1].vertices)
    sums = [_sums(mesh, frame) for mesh in meshes]
    first, before, value = ((4 * finer - coarser) / 3 for coarser, finer in pairwise(sums))
    step = np.abs(value - before)
    slowest = 0.75  # ratio of differences: steep weights make 0.73
    ratio = step / np.maximum(np.maximum(np.abs(before - first), step / slowest), np.finfo(float).tiny)
    error = np.maximum(2 * step * np.maximum(1, ratio / (1 - ratio)), 1e-9 * np.abs(value).max())
    names = ["area"] if measure(meshes[0]).volume is None else ["area", "volume"]
    found = {name: _extent(frame, value[k], error[k], k + 2) for k, name in enumerate(names)}
    return {name: extent for name, extent in found.items() if np.isfinite(extent).all()}


def _lengths(shape: Patch | Model) -> dict[str, Extent]:
    """The length of curves, by Gauss's rule between the vertices of a mesh, and its difference beside a coarser one."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    frame = Frame.around(*(patch.control_points for patch in shape.patches))
    sums = np.zeros(2)
    for patch in shape.patches:
        placed = patch.replace(control_points=frame.inside(patch.control_points))
        for k, tolerance in enumerate((1e-4, 1e-6)):  # in the frame
            mesh = tessellate(placed, tolerance=tolerance, normals=False)
            assert mesh.parameters is not None
            ends = np.sort(mesh.parameters.ravel())
            places = ends[:-1, None] + np.diff(ends)[:, None] * (nodes + 1) / 2
            slopes = placed.derivatives(places.ravel(), 1, "linear").reshape(-1, 3)
            sums[k] += np.sqrt(dot(slopes, slopes)) @ (np.diff(ends)[:, None] * weights / 2).ravel()
    extent = _extent(frame, sums[1], max(abs(sums[1] - sums[0]), 1e-9 * sums[1]), 1)
    return {"length": extent} if np.isfinite(extent).all() else {}


def _extent(frame: Frame, value: float, error: float, dimension: int) -> Extent:
    return Extent(*(float(frame.length(np.array(each), dimension)) for each in (value, error)))


def _sums(mesh: Mesh, frame: Frame) -> FloatArray:
    """Return the area of a surface and the volume inside it, in the frame."""
    corners = frame.inside(mesh.vertices)[mesh.cells]
    sides = corners[:, 1:] - corners[:, :1]
    normals = cross(sides[:, 0], sides[:, 1])
    return np.array([np.sqrt(dot(normals, normals)).sum() / 2, dot(corners[:, 0], normals).sum() / 6])
