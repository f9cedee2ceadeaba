"""The mesh of a complex with points: without collapsed cells, turned to one side, with normals and named groups."""

import numpy as np

from gtb_cli.arrays import (
    INDEX_ROWS,
    BoolArray,
    FloatArray,
    IntArray,
    cross,
    distinct,
    dot,
    index_type,
    merged,
    paired,
    row_blocks,
)
from gtb_cli.errors import DomainError
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.mesh import Mesh, Origin
from gtb_cli.meshes.shading import Normals, filled_normals
from gtb_cli.meshes.topology import compacted, sides_of
from gtb_cli.models.model import Model, joints_of
from gtb_cli.tessellation.complexes import Complex
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.theory.patch import Patch


def finished(shape: Patch | Model, mosaic: Complex, points: FloatArray, sampler: Sampler, with_normals: bool) -> Mesh:
    """Return the mesh of a complex and the (v, 3) points of its vertices.

    Cells whose vertices became one are left out. Faces of a closed body look outwards, faces of any other model to the
    side that its joints choose. Normals are computed when they are asked for. `DomainError` if no cell is left.
    """
    joints, (cells, rows) = joints_of(shape), mosaic.without_collapsed
    if not len(cells):
        raise DomainError("resolution: too low, every face is a point or a line: edges of the patches are points")
    vertices, cell_patch = points, mosaic.cell_patch[rows]
    patch, parameters, face = mosaic.patch, mosaic.parameters, mosaic.face
    if len(mosaic.collapsed):
        used, cells = compacted(cells)
        vertices, patch, parameters, face = points[used], patch[used], parameters[used], face[used]
    inward = np.zeros(len(shape.patches), dtype=bool)
    if joints.joins and cells.shape[1] == 3:
        inward = _inside_out(vertices, cells, cell_patch, face != INTERIOR, len(shape.patches))
    turned = inward ^ np.array(joints.flipped)
    backwards = np.flatnonzero(inward[cell_patch]) if inward.any() else cells[:0, 0]

    def outwards(rows: IntArray) -> IntArray:
        """Reverse the triangles of patches that look inwards."""
        if len(backwards):
            rows = rows.copy()
            rows[backwards] = rows[backwards][:, [0, 2, 1]]
        return rows

    def normals() -> Normals:
        """Return a normal of each vertex in its patch, then more in further patches, or at further places of a tip."""
        visible = 1e-7  # least distance between normals that files of 32-bit numbers tell apart
        found = sampler.normals(patch, parameters, face)
        if not joints.joins:
            return Normals(filled_normals(found, vertices, cells), None, not np.isnan(found).any())
        owners, places, corners, number = mosaic.further_places
        vertex = np.searchsorted(used, owners[:, 0]) if len(mosaic.collapsed) else owners[:, 0]
        found = np.concatenate([found, sampler.normals(owners[:, 1], places, sampler.faces_at(owners[:, 1], places))])
        of_patch, of_vertex = np.append(patch, owners[:, 1]), np.append(np.arange(len(patch)), vertex)
        found = np.where(turned[of_patch, None], -found, found)
        # Normals (NaN) that one vertex lacks in one patch share a row.
        row, missing = np.arange(len(found)), np.flatnonzero(np.isnan(found[:, 0]))
        keys = paired(of_vertex[missing], of_patch[missing], len(turned))
        _, first, number_of_key = np.unique(keys, return_index=True, return_inverse=True)
        row[missing] = missing[first[number_of_key]]
        rows = cells.astype(index_type(len(found)))
        rows.ravel()[corners] = row[len(patch) + number]
        filled = filled_normals(found, vertices[of_vertex], outwards(rows))
        same = np.linalg.norm(filled - filled[of_vertex], axis=1) <= visible
        kept, number = np.unique(np.where(same, of_vertex, row)[len(patch) + number], return_inverse=True)
        further = kept >= len(patch)
        rows.ravel()[corners] = np.where(further, len(patch) - 1 + np.cumsum(further), kept)[number]
        chosen = np.append(np.arange(len(patch)), kept[further])
        return Normals(filled[chosen], outwards(rows), not np.isnan(found).any())

    is_model = isinstance(shape, Model)
    ends = np.searchsorted(cell_patch, np.arange(len(shape.patches) + 1)).tolist()
    names = [each.name or f"patch{index}" for index, each in enumerate(shape.patches)]
    return Mesh(
        vertices,
        outwards(cells),
        parameters=parameters,
        normals=normals if with_normals and cells.shape[1] == 3 else None,
        groups=tuple(zip(names, ends[:-1], ends[1:], strict=True)) if is_model else (),
        name=shape.name or ("model" if is_model else "patch"),
        origin=Origin(patch, turned) if is_model else None,
    )


def _inside_out(
    vertices: FloatArray, faces: IntArray, face_patch: IntArray, on_boundary: BoolArray, count: int
) -> BoolArray:
    """Mark the patches, (count,), of closed bodies whose faces point inwards; only sides at a boundary may be open."""
    a, b, c = (on_boundary[corner] for corner in faces.T)
    outer = np.flatnonzero(a | b | c)
    sides = sides_of(faces[outer])
    owner, edge = np.repeat(face_patch[outer], 3), sides.edge.ravel()
    other = owner[sides.first[edge]]
    body = merged(count, distinct(np.stack([owner, other], axis=1)[owner != other]))
    is_open = np.zeros(count, dtype=bool)
    is_open[body[owner[(sides.uses[edge] != 2) & on_boundary[sides.directed].any(axis=1)]]] = True
    volume, middle = np.zeros(count), vertices.mean(axis=0)
    for rows in row_blocks(len(faces), INDEX_ROWS):  # all at once would take three times the memory of the mesh
        p, q, r = (vertices[corner] - middle for corner in faces[rows].T)
        volume += np.bincount(body[face_patch[rows]], dot(p, cross(q, r)), minlength=count)
    return np.asarray((volume < 0)[body] & ~is_open[body])
