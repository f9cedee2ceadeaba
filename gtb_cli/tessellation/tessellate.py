"""Patches and models to meshes: uniform, or to a tolerance; patches that share edges are welded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, cross, dot
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.meshes.mesh import Mesh, Origin
from gtb_cli.meshes.welding import merged
from gtb_cli.tessellation.complex import Complex, Sampler, joined_complex
from gtb_cli.tessellation.triangulation import cell_count
from gtb_cli.theory.model import Model
from gtb_cli.theory.parametrization import Parametrization
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import MAX_FACES

if TYPE_CHECKING:
    from gtb_cli.theory.joints import Joints


UNIFORM_TRIALS = 2
"""Uniform complexes tried in place of a refined one."""

WITNESSES = 48
"""Segments of each edge of an even mesh in the linear parametrisation, whose vertices a toric one must be near to."""

TORIC_LEAST, TORIC_MOST = 20_000, 100
"""A toric mesh of more cells than this, and as many for each of the linear one, is given up: where parameters near the
edges of Δ are too close to tell apart, more do not help."""

COARSEST = (1, 2, 3, 4)
"""Cells along an edge from which refinement may start: the first with which no two cells have the same vertices,
and no patch is left without cells."""


def tessellate(
    shape: Patch | Model,
    resolution: int = 32,
    tolerance: float | None = None,
    parametrization: Parametrization | None = None,
    *,
    normals: bool = True,
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
    normals : bool
        Whether a surface's mesh gets its unit normals, which take longer than its points.
    max_faces : int
        More cells than this are refused before they are made.
    joints : Joints, optional
        What `find_joints` says of a model's patches, where it is known.

    Returns
    -------
    Mesh
        With unit normals, if asked for, and parameters. Shared edges of a model's patches are sampled
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
        from gtb_cli.theory.joints import find_joints  # imported, like refinement, by the meshes that need it

        joints = find_joints(patches)
    if parametrization is None:
        parametrization = "linear" if isinstance(shape, Model) or tolerance is not None else "toric"
    if isinstance(shape, Model) and tolerance is not None and parametrization == "toric":
        raise DomainError("parametrization: a model is meshed to a tolerance in the linear one only")
    sampler = Sampler(patches, parametrization, isinstance(shape, Model), joints.flipped if joints else ())
    if tolerance is None:
        refuse_too_many(sum(cell_count(patch.domain, resolution) for patch in patches), max_faces)
        mosaic = joined_complex(patches, joints, resolution)
        # Patches that share two edges are cut around their centres, into more cells than others.
        refuse_too_many(len(mosaic.cells), max_faces)
        points = sampler.points(mosaic.patch, mosaic.parameters, mosaic.face)
    else:
        mosaic, points = fewest_cells(patches, joints, sampler, float(tolerance), max_faces)
    return _mesh(mosaic, points, sampler, shape, joints, normals)


def refuse_too_many(cells: int, max_faces: int) -> None:
    """Raise `ToleranceError` where a mesh would have more than `max_faces` cells."""
    if cells > max_faces:
        raise ToleranceError(f"the mesh would have {cells} faces, more than {max_faces}: lower -n or raise --max-faces")


def fewest_cells(
    patches: Sequence[Patch], joints: Joints | None, sampler: Sampler, tolerance: float, max_faces: int
) -> tuple[Complex, FloatArray]:
    """The refined complex, or a uniform one that holds the tolerance with fewer cells.

    Refinement halves; on a gentle surface a number of cells between its steps can be enough.
    """
    from gtb_cli.meshes.nearest import are_near
    from gtb_cli.tessellation.refinement import refine, sampled

    for coarsest in COARSEST:
        start = joined_complex(patches, joints, coarsest)
        if not start.is_simplicial and coarsest < COARSEST[-1]:
            continue
        witnesses = None
        if sampler.parametrization == "toric":
            refined, witnesses = refined_in_toric(start, sampler, tolerance, max_faces)
        else:
            refined = refine(start, sampler, tolerance, max_faces)
        found = refined
        if refined[0].is_whole:
            break

    # The largest number with fewer cells than were found. Where refinement went to less than half its cells' width, it
    # cannot hold: only what is too wide is halved. From there down by the square law of chord errors.
    unit = sum(cell_count(patch.domain, 1) for patch in patches)
    n = int(((len(found[0].cells) - 1) / unit) ** (1 / patches[0].dimension))
    if 2.1 * n < coarsest * narrowest(start, patches) / narrowest(found[0], patches):
        return found
    low, high = coarsest - 1, n + 1
    for _ in range(UNIFORM_TRIALS):
        if not low < n < high:
            break
        candidate = joined_complex(patches, joints, n)
        points, distance, holds = sampled(candidate, sampler, tolerance)
        holds &= candidate.is_whole
        if holds and (witnesses is None or are_near(witnesses, points[candidate.cells], tolerance)):
            found, high = (candidate, points), n
        elif found is refined:
            break
        else:
            low = n
        n = min(max(math.ceil(n * math.sqrt(distance / tolerance)), low + 1), high - 1)
    return found


def refined_in_toric(
    start: Complex, sampler: Sampler, tolerance: float, max_faces: int
) -> tuple[tuple[Complex, FloatArray], FloatArray]:
    """Refine a complex in toric parameters, until it is near to points of linear ones, too; and these points.

    Where exponents are small, much of the surface is nearer to an edge of Δ than toric parameters tell apart.
    """
    from gtb_cli.tessellation.refinement import refine

    linear = Sampler(sampler.patches, "linear", False)
    even = joined_complex(sampler.patches, None, WITNESSES)
    simple, points = refine(start, linear, tolerance, max_faces)
    witnesses = np.concatenate([points, linear.points(even.patch, even.parameters, even.face)])
    count = len(simple.cells)
    try:
        refined = refine(start, sampler, tolerance, min(max_faces, TORIC_LEAST + TORIC_MOST * count), witnesses)
    except ToleranceError as error:
        raise ToleranceError(f"{error}; linear parameters take {count} faces") from None
    return refined, witnesses


def narrowest(mosaic: Complex, patches: Sequence[Patch]) -> float:
    """Width of the narrowest cell of a complex, as a fraction of its patch's domain."""
    sides = np.abs(mosaic.corners - np.roll(mosaic.corners, 1, axis=1)).max(axis=(1, 2))
    return float((sides / np.array([patch.domain.size for patch in patches])[mosaic.cell_patch]).min())


def _mesh(
    mosaic: Complex,
    points: FloatArray,
    sampler: Sampler,
    shape: Patch | Model,
    joints: Joints | None,
    with_normals: bool,
) -> Mesh:
    name = shape.name or ("model" if isinstance(shape, Model) else "patch")
    cells, rows = mosaic.without_collapsed
    cell_patch, used = mosaic.cell_patch[rows], np.arange(len(points))
    if not len(cells):
        raise DomainError("resolution: too low, every face is a point or a line: edges of the patches are points")
    if len(mosaic.collapsed):
        used, cells = np.unique(cells, return_inverse=True)
        cells = cells.reshape(-1, mosaic.cells.shape[1])
    vertices = points[used]
    normals = None
    inward = np.zeros(len(sampler.patches), dtype=bool)
    if joints is not None and cells.shape[1] == 3:
        inward = inside_out(vertices, cells, cell_patch)
        cells = np.where(inward[cell_patch, None], cells[:, [0, 2, 1]], cells)
    if with_normals and cells.shape[1] == 3:
        normals = sampler.normals(mosaic.patch[used], mosaic.parameters[used], mosaic.face[used])
        normals = np.where(inward[mosaic.patch[used], None], -normals, normals)
        normals = vertex_normals(normals, vertices, cells)
    groups: tuple[tuple[str, int, int], ...] = ()
    if isinstance(shape, Model):
        starts = np.searchsorted(cell_patch, np.arange(len(shape.patches) + 1)).tolist()
        names = [patch.name or f"patch{index}" for index, patch in enumerate(shape.patches)]
        groups = tuple(zip(names, starts[:-1], starts[1:], strict=True))
    return Mesh(
        vertices,
        cells,
        parameters=mosaic.parameters[used],
        normals=normals,
        groups=groups,
        name=name,
        origin=None if joints is None else Origin(mosaic.patch[used], inward ^ np.array(joints.flipped)),
    )


def inside_out(vertices: FloatArray, faces: IntArray, face_patch: IntArray) -> BoolArray:
    """(patches,) whether a patch belongs to a closed body whose faces look inwards."""
    count = int(face_patch.max()) + 1
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    owner = np.repeat(face_patch, 3)
    order = np.lexsort(sides.T)
    sides, owner = sides[order], owner[order]
    same = (sides[1:] == sides[:-1]).all(axis=1)
    body = merged(count, np.unique(np.stack([owner[1:][same], owner[:-1][same]], axis=1), axis=0))
    paired = np.zeros(len(sides), dtype=np.int64)
    paired[1:] += same
    paired[:-1] += same
    is_open = np.zeros(count, dtype=bool)
    is_open[body[owner[paired != 1]]] = True
    a, b, c = (vertices[corner] - vertices.mean(axis=0) for corner in faces.T)
    volume = np.bincount(body[face_patch], dot(a, cross(b, c)), minlength=count)
    return np.asarray((volume < 0)[body] & ~is_open[body])


def vertex_normals(normals: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Replace normals that the surface does not have (NaN) by the mean of the adjacent faces, weighted by area."""
    missing = np.isnan(normals[:, 0])
    if not missing.any():
        return normals
    touching = missing[faces].any(axis=1)
    corners = vertices[faces[touching]]
    area = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(sums, faces[touching, k], area)
    scale = np.abs(sums).max(axis=1, keepdims=True)
    sums = np.where(scale > 0, sums / np.where(scale > 0, scale, 1), [0.0, 0.0, 1.0])
    sums /= np.linalg.norm(sums, axis=1, keepdims=True)
    return np.asarray(np.where(missing[:, None], sums, normals))
