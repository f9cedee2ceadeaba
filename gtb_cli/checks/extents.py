"""Lengths of curves, areas of surfaces and volumes inside closed ones, extrapolated from meshes."""

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, cross, dot
from gtb_cli.knots.triangulation import cell_count
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.measures import measure
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch


class Extent(NamedTuple):
    """A length, area or volume."""

    value: float
    error: float  # an estimate, and not a bound


def extents(shape: Patch | Model) -> dict[str, Extent]:
    """Return the length of curves; or the area of surfaces and, if they are closed, the volume inside, by name.

    One that overflows is left out. It takes as long as a mesh of 100,000 faces.

    Each is extrapolated (Richardson) from meshes, each of which has twice as many segments along an edge as the one
    before. The error is the difference of the last two extrapolated values, and at least 1e-9 of the size.
    """
    most_faces, most_segments = 80_000, 256  # of the finest mesh
    segments = 8
    while (
        segments < most_segments and sum(cell_count(each.domain, 2 * segments) for each in shape.patches) <= most_faces
    ):
        segments *= 2
    meshes = [tessellate(shape, segments // part, normals=False) for part in (4, 2, 1)]
    frame = Frame.around(meshes[-1].vertices)
    coarse, middle, fine = (_sums(mesh, frame) for mesh in meshes)
    before, value = ((4 * second - first) / 3 for first, second in ((coarse, middle), (middle, fine)))
    error = np.maximum(np.abs(value - before), 1e-9 * np.abs(value).max())

    is_curve, is_closed = meshes[0].is_curve, measure(meshes[0]).volume is not None
    names = ["length"] if is_curve else ["area", "volume"] if is_closed else ["area"]
    found = {}
    for k, name in enumerate(names):
        dimension = 1 if is_curve else k + 2
        extent = Extent(*(float(frame.length(each[k], dimension)) for each in (value, error)))
        if np.isfinite(extent).all():
            found[name] = extent
    return found


def _sums(mesh: Mesh, frame: Frame) -> FloatArray:
    """Return the length of a curve and 0, or the area of a surface and the volume inside it, in the frame."""
    corners = frame.inside(mesh.vertices)[mesh.cells]
    sides = corners[:, 1:] - corners[:, :1]
    if mesh.is_curve:
        return np.array([np.sqrt(dot(sides[:, 0], sides[:, 0])).sum(), 0.0])
    normals = cross(sides[:, 0], sides[:, 1])
    return np.array([np.sqrt(dot(normals, normals)).sum() / 2, dot(corners[:, 0], normals).sum() / 6])
