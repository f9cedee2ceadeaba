"""Patches and models to meshes: uniform, or to a tolerance; patches that share edges are welded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.complex import Complex, Parametrization, Sampler, joined_complex, merged
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.joints import Joints, find_joints
from gtb_cli.mesh import Mesh
from gtb_cli.patch import Model, Patch
from gtb_cli.refinement import refine
from gtb_cli.triangulation import cell_count

MAX_FACES = 5_000_000
"""Cells of a mesh that is made without being asked for more."""

COARSEST = (1, 2, 3)
"""Cells along an edge from which refinement may start: the first with which no two cells have the same vertices."""


def tessellate(
    shape: Patch | Model,
    resolution: int = 32,
    tolerance: float | None = None,
    parametrization: Parametrization | None = None,
    *,
    max_faces: int = MAX_FACES,
    joints: Joints | None = None,
) -> Mesh:
    """Mesh a patch or a model.

    Parameters
    ----------
    shape : Patch or Model
    resolution : int
        Cells along each edge of the domain; not used with a tolerance.
    tolerance : float, optional
        Largest distance from the surface to the mesh, in model units; verified by sampling.
    parametrization : {"toric", "linear"}, optional
        Where vertices are put. Default: toric, the paper's, for a patch without tolerance, else linear.
    max_faces : int
        More cells than this are refused before they are made.
    joints : Joints, optional
        What `find_joints` says of a model's patches, where it is known.

    Returns
    -------
    Mesh
        With unit normals (surfaces) and, for a patch, parameters. Shared edges of a model's patches are sampled
        once, by the curve's own data, and their vertices are one.

    Raises
    ------
    DomainError
        A number that makes no sense.
    ToleranceError
        Too many faces would be needed.
    """
    if isinstance(resolution, bool) or not isinstance(resolution, int | np.integer) or resolution < 1:
        raise DomainError(f"resolution: expected a whole number of at least 1, got {resolution!r}")
    if tolerance is not None and not (np.isfinite(tolerance) and tolerance > 0):
        raise DomainError(f"tolerance: must be positive, got {tolerance!r}")
    patches = shape.patches if isinstance(shape, Model) else (shape,)
    if isinstance(shape, Model) and joints is None:
        joints = find_joints(patches)
    if parametrization is None:
        parametrization = "linear" if isinstance(shape, Model) or tolerance is not None else "toric"
    if isinstance(shape, Model) and tolerance is not None and parametrization == "toric":
        raise DomainError("parametrization: a model is meshed to a tolerance in the linear one only")
    sampler = Sampler(patches, parametrization, isinstance(shape, Model), joints.flipped if joints else ())
    if tolerance is None:
        refuse_too_many(sum(cell_count(patch.domain, resolution) for patch in patches), max_faces)
        mosaic = joined_complex(patches, joints, resolution)
        points = sampler.points(mosaic.patch, mosaic.parameters, mosaic.face)
    else:
        start = coarsest_complex(patches, joints)
        mosaic, points = refine(start, sampler, float(tolerance), max_faces)
    return _mesh(mosaic, points, sampler, shape)


def refuse_too_many(cells: int, max_faces: int) -> None:
    """Raise `ToleranceError` where a mesh would have more than `max_faces` cells."""
    if cells > max_faces:
        raise ToleranceError(f"the mesh would have {cells} faces, more than {max_faces}: lower -n or raise --max-faces")


def coarsest_complex(patches: Sequence[Patch], joints: Joints | None) -> Complex:
    """The complex with the fewest cells whose cells and sides are told apart by their vertices."""
    for resolution in COARSEST:
        mosaic = joined_complex(patches, joints, resolution)
        if mosaic.is_simplicial:
            break
    return mosaic


def _mesh(mosaic: Complex, points: FloatArray, sampler: Sampler, shape: Patch | Model) -> Mesh:
    name = shape.name or ("model" if isinstance(shape, Model) else "patch")
    cells, cell_patch = mosaic.cells, mosaic.cell_patch
    used = np.arange(len(points))
    if len(mosaic.collapsed):
        # Edges that are one point are never split: their ends become one, and cells with a side there vanish.
        label = merged(len(points), mosaic.collapsed)
        cells = label[cells]
        proper = (np.diff(np.sort(cells, axis=1), axis=1) > 0).all(axis=1)
        used, cells = np.unique(cells[proper], return_inverse=True)
        cells, cell_patch = cells.reshape(-1, mosaic.cells.shape[1]), cell_patch[proper]
    vertices = points[used]
    normals = None
    if cells.shape[1] == 3:
        normals = sampler.normals(mosaic.patch[used], mosaic.parameters[used], mosaic.face[used])
        normals = vertex_normals(normals, vertices, cells)
    groups: tuple[tuple[str, int, int], ...] = ()
    if isinstance(shape, Model):
        starts = np.searchsorted(cell_patch, np.arange(len(shape.patches) + 1)).tolist()
        names = [patch.name or f"patch{index}" for index, patch in enumerate(shape.patches)]
        groups = tuple(zip(names, starts[:-1], starts[1:], strict=True))
    return Mesh(
        vertices,
        cells,
        parameters=None if isinstance(shape, Model) else mosaic.parameters[used],
        normals=normals,
        groups=groups,
        name=name,
    )


def vertex_normals(normals: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Replace normals that the surface does not have (NaN) by the mean of the adjacent faces, weighted by area."""
    missing = np.isnan(normals[:, 0])
    if not missing.any():
        return normals
    touching = missing[faces].any(axis=1)
    corners = vertices[faces[touching]]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(sums, faces[touching, k], area)
    scale = np.abs(sums).max(axis=1, keepdims=True)
    sums = np.where(scale > 0, sums / np.where(scale > 0, scale, 1), [0.0, 0.0, 1.0])
    sums /= np.linalg.norm(sums, axis=1, keepdims=True)
    return np.asarray(np.where(missing[:, None], sums, normals))
