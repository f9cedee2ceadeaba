"""Patches and models to meshes: uniform, or to a tolerance; patches that share edges are welded."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, TypeAlias, get_args

import numpy as np

from gtb_cli.arrays import EPS, INDEX_ROWS, BoolArray, FloatArray, IntArray, cross, distinct, dot, index_type, paired
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.knots.face import INTERIOR
from gtb_cli.knots.triangulation import cell_count
from gtb_cli.language.loading import load
from gtb_cli.meshes.coincident import merged
from gtb_cli.meshes.mesh import Mesh, Origin
from gtb_cli.meshes.shading import Normals, filled_normals
from gtb_cli.meshes.topology import compacted, sides_of
from gtb_cli.models.model import Model
from gtb_cli.tessellation.complexes import Complex, farthest_move, joined_complex, welded_points
from gtb_cli.tessellation.sampler import Sampler, evenly, torically, torically_inside
from gtb_cli.theory.parametrization import Parametrization
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import MAX_FACES, RESOLUTION, percentage

if TYPE_CHECKING:
    from gtb_cli.models.joints import Joints

Shape: TypeAlias = Patch | Model | Iterable[Patch] | str | os.PathLike[str]

# Cells along an edge from which refinement may start: the first number is taken with which no two cells have the same
# vertices and each patch has a cell
FIRST_RESOLUTIONS = (1, 2, 3, 4)


def shape_of(shape: Shape) -> Patch | Model:
    """Return a patch or model as it is, load the file of a spec, and make a model of several patches.

    Raises `DomainError` if it is something else.
    """
    match shape:
        case Patch() | Model():
            return shape
        case str() | os.PathLike():
            return load(shape)
        case list() | tuple():
            return Model(tuple(shape))
    expected = "a Patch, a Model, several patches or the name of a spec file"
    raise DomainError(f"shape: expected {expected}, got {type(shape).__name__}")


def tessellate(
    shape: Shape,
    resolution: int | None = None,
    tolerance: float | str | None = None,
    parametrization: Parametrization = "linear",
    *,
    normals: bool = True,
    max_faces: int = MAX_FACES,
    rounding: float = 0.0,
) -> Mesh:
    """Mesh a patch or a model, as ``gtb mesh`` does. `Recipe` has tubes, solids and attributes, too.

    Parameters
    ----------
    shape : Patch, Model, list or tuple of Patch, or path of a spec
    resolution : int, optional
        Segments along each edge of the domain, default 32; not together with a tolerance.
    tolerance : float or str, optional
        Largest distance from the surface to the mesh, in model units, or as ``"1%"`` of the bounding box's diagonal;
        certain for a curve, sampled for a surface.
    parametrization : {"linear", "toric"}
        Where vertices are put: evenly (linear), or at the paper's parameters, which crowd where edge functions have
        large exponents. With a tolerance always linear.
    normals : bool
        Whether a surface's mesh gets its unit normals, which take longer than its points.
    max_faces : int
        More faces than this are refused before they are made.
    rounding : float
        How far vertices may move afterwards: the tolerance then holds for the moved ones.

    Returns
    -------
    Mesh
        With parameters, and unit normals if asked for. Edges that patches of a model share are sampled once, by the
        curve's own data, and their vertices are one.

    Raises
    ------
    DomainError
        Something else than a shape, a number that makes no sense, or a resolution together with a tolerance.
    ToleranceError
        Too many faces would be needed.
    SpecError
        The spec cannot be read.
    """
    shape = shape_of(shape)
    if resolution is not None and tolerance is not None:
        raise DomainError("resolution: excludes a tolerance, give one of them")
    resolution = RESOLUTION if resolution is None else resolution
    check_fineness(resolution, tolerance, parametrization)
    tolerance = tolerance_for(shape, tolerance) if isinstance(tolerance, str) else tolerance
    patches = shape.patches
    joints = shape.joints if isinstance(shape, Model) else None
    moved = farthest_move(patches, joints) if isinstance(shape, Model) and shape.weld and joints else 0.0
    if moved:  # points computed in two ways differ by rounding, too
        moved += 16 * EPS * max(float(np.abs(patch.control_points).max()) for patch in patches)
    if tolerance is None:
        refuse_faces(sum(cell_count(patch.domain, resolution) for patch in patches), resolution, max_faces)
        toric = torically if joints is None else torically_inside
        sampler = Sampler(patches, toric if parametrization == "toric" else evenly(resolution))
        mosaic = joined_complex(patches, joints, resolution)
        # Patches that share two edges are cut around their centres, into more cells than others.
        refuse_faces(len(mosaic.cells), resolution, max_faces)
        points = sampler.points(mosaic.patch, mosaic.parameters, mosaic.face)
    else:
        sampler = Sampler(patches)
        if moved > tolerance:
            raise ToleranceError(f"welding moves vertices by up to {moved:.3g}, more than the tolerance {tolerance:g}")
        mosaic, points = refined(patches, joints, sampler, float(tolerance) - rounding, max_faces)
    if joints and moved:
        points = welded_points(mosaic, points, patches, joints)
    return _mesh(mosaic, points, sampler, shape, joints, normals)


def check_fineness(resolution: int, tolerance: float | str | None, parametrization: str) -> None:
    """Raise `DomainError` for numbers that make no sense, and for a tolerance in toric parameters."""
    if isinstance(resolution, bool) or not hasattr(resolution, "__index__") or resolution < 1:
        raise DomainError(f"resolution: expected a whole number of at least 1, got {resolution!r}")
    if parametrization not in get_args(Parametrization):
        raise DomainError(f"parametrization: expected toric or linear, got {parametrization!r}")
    if isinstance(tolerance, str):
        percentage(tolerance)
    elif tolerance is not None and not 0 < tolerance < math.inf:
        raise DomainError(f"tolerance: must be positive, got {tolerance!r}")
    if tolerance is not None and parametrization == "toric":
        raise DomainError("parametrization: a tolerance chooses the parameters itself: leave out toric")


def refuse_faces(faces: int, resolution: int, max_faces: int) -> None:
    """Raise `ToleranceError` if a uniform mesh has more faces than are allowed, or than the machine's memory holds."""
    estimate = f"`resolution` {resolution} makes {faces} faces"
    if faces > max_faces:
        raise ToleranceError(
            f"{estimate}, more than {max_faces}: take a smaller `resolution`, or allow them with `max_faces` {faces}"
        )
    needed = 100 * faces  # bytes, measured: 1.92 GB for twenty million faces of a model, 0.83 of a patch
    try:
        there = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):  # the system does not say
        there = math.inf
    if needed > there:
        raise ToleranceError(
            f"{estimate} and needs about {needed / 1e9:.0f} GB of memory, this machine has {there / 1e9:.0f}: "
            "take a smaller `resolution`"
        )


def tolerance_for(shape: Patch | Model, percent: str) -> float:
    """Return a percentage, such as ``"1%"``, of the diagonal of a shape's bounding box in model units."""
    share = percentage(percent) / 100
    size_resolution = 16  # of the mesh whose bounding box is meant
    low, high = tessellate(shape, size_resolution, normals=False).bounds
    diagonal = math.dist(low, high)
    if diagonal == 0:
        raise DomainError(f"tolerance: {percent} of the size of a single point is nothing")
    return share * diagonal


def refined(
    patches: Sequence[Patch], joints: Joints | None, sampler: Sampler, tolerance: float, max_faces: int
) -> tuple[Complex, FloatArray]:
    """Refine the coarsest complex that serves until it holds a tolerance; return it with the points of its vertices."""
    from gtb_cli.tessellation.refinement import refine

    for coarsest in FIRST_RESOLUTIONS:
        start = joined_complex(patches, joints, coarsest)
        if not start.is_simplicial and coarsest < FIRST_RESOLUTIONS[-1]:
            continue
        mosaic, points = refine(start, sampler, tolerance, max_faces)
        if mosaic.is_whole:
            break
    return mosaic, points


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
    cell_patch, vertices = mosaic.cell_patch, points
    patch, parameters, face = mosaic.patch, mosaic.parameters, mosaic.face
    if not len(cells):
        raise DomainError("resolution: too low, every face is a point or a line: edges of the patches are points")
    if len(mosaic.collapsed):
        used, cells = compacted(cells)
        cell_patch = cell_patch[rows]
        vertices, patch, parameters, face = points[used], patch[used], parameters[used], face[used]
    inward = np.zeros(len(shape.patches), dtype=bool)
    if joints is not None and cells.shape[1] == 3:
        inward = inside_out(vertices, cells, cell_patch, face != INTERIOR, len(shape.patches))
    reversed_ = inward ^ np.array(joints.flipped) if joints else inward
    turned = np.flatnonzero(inward[cell_patch]) if inward.any() else cells[:0, 0]

    def outwards(rows: IntArray) -> IntArray:
        """Reverse the triangles of patches that look inwards."""
        if len(turned):
            rows = rows.copy()
            rows[turned] = rows[turned][:, [0, 2, 1]]
        return rows

    def normals() -> Normals:
        """Normals of the vertices in their patches, and those in further patches, or at further places of a tip."""
        visible = 1e-7  # least distance between normals that files of 32-bit numbers tell apart
        found = sampler.normals(patch, parameters, face)
        if joints is None:
            return Normals(filled_normals(found, vertices, cells), None, not np.isnan(found).any())
        owners, places, corners, number = mosaic.further_places
        vertex = np.searchsorted(used, owners[:, 0]) if len(mosaic.collapsed) else owners[:, 0]
        found = np.concatenate([found, sampler.normals(owners[:, 1], places, sampler.faces_at(owners[:, 1], places))])
        of_patch, of_vertex = np.append(patch, owners[:, 1]), np.append(np.arange(len(patch)), vertex)
        found = np.where(reversed_[of_patch, None], -found, found)
        row = _rows_of_missing(found, of_patch, of_vertex)
        rows = cells.astype(index_type(len(found)))
        rows.ravel()[corners] = row[len(patch) + number]
        filled = filled_normals(found, vertices[of_vertex], outwards(rows))
        same = np.linalg.norm(filled - filled[of_vertex], axis=1) <= visible
        kept, number = np.unique(np.where(same, of_vertex, row)[len(patch) + number], return_inverse=True)
        further = kept >= len(patch)
        rows.ravel()[corners] = np.where(further, len(patch) - 1 + np.cumsum(further), kept)[number]
        chosen = np.append(np.arange(len(patch)), kept[further])
        return Normals(filled[chosen], outwards(rows), not np.isnan(found).any())

    groups: tuple[tuple[str, int, int], ...] = ()
    if isinstance(shape, Model):
        starts = np.searchsorted(cell_patch, np.arange(len(shape.patches) + 1)).tolist()
        names = [patch.name or f"patch{index}" for index, patch in enumerate(shape.patches)]
        groups = tuple(zip(names, starts[:-1], starts[1:], strict=True))
    return Mesh(
        vertices,
        outwards(cells),
        parameters=parameters,
        normals=normals if with_normals and cells.shape[1] == 3 else None,
        groups=groups,
        name=name,
        origin=None if joints is None else Origin(patch, reversed_),
    )


def _rows_of_missing(normals: FloatArray, patch: IntArray, vertex: IntArray) -> IntArray:
    """(k,) the row of each normal of vertices in patches; one for all (NaN) that a vertex lacks in a patch."""
    result = np.arange(len(normals))
    missing = np.flatnonzero(np.isnan(normals[:, 0]))
    keys = paired(vertex[missing], patch[missing], int(patch.max()) + 1)
    _, first, number = np.unique(keys, return_index=True, return_inverse=True)
    result[missing] = missing[first[number]]
    return result


def inside_out(
    vertices: FloatArray, faces: IntArray, face_patch: IntArray, on_boundary: BoolArray, count: int
) -> BoolArray:
    """Mark the patches, (count,), of closed bodies whose faces point inwards; a patch may have no faces.

    Only sides with an end on the boundary of a patch may be open, or join two patches.
    """
    a, b, c = (on_boundary[corner] for corner in faces.T)
    outer = np.flatnonzero(a | b | c)
    sides = sides_of(faces[outer])
    owner, edge = np.repeat(face_patch[outer], 3), sides.edge.ravel()
    other = owner[sides.first[edge]]
    body = merged(count, distinct(np.stack([owner, other], axis=1)[owner != other]))
    is_open = np.zeros(count, dtype=bool)
    is_open[body[owner[(sides.uses[edge] != 2) & on_boundary[sides.directed].any(axis=1)]]] = True
    volume, middle = np.zeros(count), vertices.mean(axis=0)
    for start in range(0, len(faces), INDEX_ROWS):  # all at once would take three times the memory of the mesh
        rows = slice(start, start + INDEX_ROWS)
        p, q, r = (vertices[corner] - middle for corner in faces[rows].T)
        volume += np.bincount(body[face_patch[rows]], dot(p, cross(q, r)), minlength=count)
    return np.asarray((volume < 0)[body] & ~is_open[body])
