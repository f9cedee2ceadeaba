"""Meshes to files: OBJ, PLY, STL and GLB.

| format | holds | numbers | written by |
|---|---|---|---|
| OBJ | triangles or segments, groups, normals, uv | decimal, 9 digits at the model's size | `obj` |
| PLY | triangles or segments, normals, uv, attributes | 32-bit; `ascii`: exact | trimesh; else `formats` |
| STL | triangles | 32-bit; `ascii`: exact | trimesh; else `formats` |
| GLB | triangles or segments, groups, normals, uv | 32-bit | trimesh; else `formats` |
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import IO, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import ExportError
from gtb_cli.files import replace_file
from gtb_cli.formats.obj import ROWS, obj_blocks
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.vocabulary import FORMATS

if TYPE_CHECKING:  # OBJ, the format of small and quick meshes, does without this room
    from gtb_cli.formats.records import Part

VISIBLE = 1e-5
"""A vertex moved by more than this part of the model's diagonal shows as facets in its shading."""

_SINGLE_LIMIT = (2.0 - 2.0**-23) * 2.0**127  # the largest finite one
_DOUBLE_LIMIT = 2.0**1022  # a difference of two, or a box's extent, is finite too
_STL_NAME = 80  # characters; some readers have no room for more
_PLY_RESERVED = ("x", "y", "z", "nx", "ny", "nz", "s", "t")


def write_mesh(
    mesh: Mesh,
    path_or_file: str | os.PathLike[str] | IO[bytes],
    format: str | None = None,
    *,
    ascii: bool = False,
    normals: bool = False,
    uv: bool = False,
) -> None:
    """Write a mesh to a file, whole or not at all.

    Parameters
    ----------
    mesh : Mesh
        What to write. Its order of vertices and cells is kept, and the same mesh gives the same bytes.
    path_or_file : str, path-like or binary file object
        A path is replaced atomically (see `gtb_cli.files.replace_file`); a file object is written to and flushed.
    format : {"obj", "ply", "stl", "glb"}, optional
        By default what the suffix of the path says.
    ascii : bool
        PLY and STL as text, with numbers that read back exactly, in place of 32-bit binary. OBJ is always text.
    normals : bool
        Write `mesh.normals` at the vertices: OBJ, PLY, GLB. STL always has normals, of its facets, from their corners.
    uv : bool
        Write `mesh.parameters`, as they are, as texture coordinates: OBJ, PLY, GLB. A curve's second one is 0.

    Raises
    ------
    ExportError
        The format cannot hold the mesh, a number is not finite, or the file cannot be written.
    BrokenPipeError
        The reader of a pipe has gone.
    """
    if isinstance(path_or_file, (str, os.PathLike)):
        kind = format or _format_of(os.fspath(path_or_file))
        replace_file(path_or_file, encode_mesh(mesh, kind, ascii=ascii, normals=normals, uv=uv))
        return
    if hasattr(path_or_file, "encoding"):
        raise ExportError("cannot write a mesh to a text file object: expected a binary one")
    name = getattr(path_or_file, "name", None)
    kind = format or _format_of(name if isinstance(name, str) else "a file without a name")
    blocks = encode_mesh(mesh, kind, ascii=ascii, normals=normals, uv=uv)
    try:
        for block in blocks:
            path_or_file.write(block)
        path_or_file.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        place = name if isinstance(name, str) else "the output"
        raise ExportError(f"cannot write {place}: {error.strerror or error}") from error


def encode_mesh(
    mesh: Mesh, format: str, *, ascii: bool = False, normals: bool = False, uv: bool = False
) -> Iterable[bytes]:
    """Return the bytes of a mesh file, block by block; the parameters are those of `write_mesh`.

    Everything that can be wrong with the mesh is raised here, before the first block.

    Raises
    ------
    ExportError
        The format cannot hold the mesh, or a number is not finite (the first such vertex is named).
    """
    kind = _known(format)
    text = kind == "obj" or ascii
    if kind == "stl" and mesh.is_curve:
        raise ExportError("STL holds triangles, and a curve has none: give it a thickness with --radius R (a tube)")
    if kind == "glb" and ascii:
        raise ExportError("GLB has no text form: expected obj, ply or stl with --ascii")
    vertex_normals = _vertex_normals(mesh) if normals and kind != "stl" else None
    coordinates = _texture_coordinates(mesh) if uv and kind != "stl" else None
    attributes = _ply_attributes(mesh) if kind == "ply" else {}
    name, groups = _plain_name(mesh.name), _groups(mesh)

    limit = _DOUBLE_LIMIT if text else _SINGLE_LIMIT
    _check_cells(mesh)
    _check_numbers("coordinates", mesh.vertices, limit)
    if vertex_normals is not None:
        _check_numbers("normal", vertex_normals, limit)
    if coordinates is not None:
        _check_numbers("uv", coordinates, limit)
    for label, values in attributes.items():
        _check_numbers(label, values, limit)

    if kind == "obj":
        return obj_blocks(mesh.vertices, mesh.cells, vertex_normals, coordinates, groups)
    from gtb_cli.formats.records import glb_of_lines, ply_of_edges, ply_text, stl_text

    if kind == "ply":
        columns = _ply_columns(mesh.vertices, vertex_normals, coordinates, attributes)
        if ascii:
            return ply_text(columns, mesh.cells)
        if mesh.is_curve:
            return ply_of_edges(columns, mesh.cells)
        return [_ply_of_trimesh(mesh, vertex_normals, columns)]
    if kind == "stl":
        if ascii:
            return stl_text(mesh.vertices, mesh.cells, name.encode("ascii", "replace")[:_STL_NAME])
        return [_stl_of_trimesh(mesh)]
    parts = _parts(mesh, groups or [(name, 0, len(mesh.cells))], vertex_normals, coordinates)
    return [glb_of_lines(parts) if mesh.is_curve else _glb_of_trimesh(parts)]


def warnings_for(mesh: Mesh, format: str, *, ascii: bool = False, normals: bool = False, uv: bool = False) -> list[str]:
    """Return what a user should know of a file that `write_mesh` would write with the same arguments.

    That 32-bit numbers would merge or visibly move vertices, that what was asked for is
    left out, and which common readers refuse such a file.

    Returns
    -------
    list of str
        One message each; empty for an ordinary mesh.
    """
    kind = _known(format)
    messages: list[str] = []
    if not len(mesh.vertices):
        return messages  # an error, not a warning
    if kind in ("ply", "stl", "glb") and not (ascii and kind != "glb"):
        messages += _single_precision_warnings(mesh, kind)
    if kind == "ply" and mesh.is_curve:
        messages.append("PLY: meshio and assimp read no file with edges, as a curve has")
    if kind == "stl" and not mesh.is_curve and len(mesh.cells) < 4:
        messages.append(f"STL: admesh reads no file of fewer than 4 facets, and this has {len(mesh.cells)}")
    if kind == "stl" and uv:
        messages.append("STL: holds no texture coordinates, none are written")
    if normals and mesh.is_curve:
        messages.append(f"{kind.upper()}: a curve has no normals, none are written")
    if kind == "obj" and uv and mesh.parameters is not None and len(mesh.parameters):
        extent, size = float(np.ptp(mesh.parameters, axis=0).max()), float(np.ptp(mesh.vertices, axis=0).max())
        if 0.0 < extent < 1e-3 * min(1.0, size):
            messages.append(
                "OBJ: texture coordinates have the decimals of the vertices, too few for parameters that span "
                f"{extent:.3g}; PLY keeps their digits"
            )
    return messages


def _known(format: str) -> str:
    kind = format.lower()
    if kind not in FORMATS:
        raise ExportError(f"format: expected one of {', '.join(FORMATS)}, got {format!r}")
    return kind


def _format_of(path: str) -> str:
    suffix = os.path.splitext(path)[1][1:].lower()
    if suffix not in FORMATS:
        expected = ", ".join(f".{name}" for name in FORMATS)
        raise ExportError(f"cannot tell the format of {path}: expected a name that ends in {expected}, or a format")
    return suffix


def _check_cells(mesh: Mesh) -> None:
    count = len(mesh.vertices)
    if not count or not len(mesh.cells):
        raise ExportError(f"the mesh is empty: {count} vertices, {len(mesh.cells)} cells")
    low, high = int(mesh.cells.min()), int(mesh.cells.max())
    if low < 0 or high >= count:
        raise ExportError(f"cells: expected indices from 0 to {count - 1}, got {low if low < 0 else high}")


def _check_numbers(label: str, values: FloatArray, limit: float) -> None:
    # Two reductions: NaN spoils both, and they are the cheapest look at every number.
    if -limit <= values.min() and values.max() <= limit:
        return
    rows = values.reshape(len(values), -1)
    bad = int(np.flatnonzero(~(np.abs(rows) <= limit).all(axis=1))[0])
    reason = "must be finite"
    if np.isfinite(rows[bad]).all():
        reason = "too large for 32-bit numbers" if limit == _SINGLE_LIMIT else "too large"
    raise ExportError(f"vertex {bad}: {label}: {reason}, got {' '.join(f'{value:g}' for value in rows[bad])}")


def _vertex_normals(mesh: Mesh) -> FloatArray | None:
    if mesh.normals is None and not mesh.is_curve:
        raise ExportError("normals: the mesh has none")
    return None if mesh.is_curve else mesh.normals


def _texture_coordinates(mesh: Mesh) -> FloatArray:
    if mesh.parameters is None:
        raise ExportError("uv: the mesh has no parameters")
    if mesh.origin is not None:
        raise ExportError("uv: where patches of a model meet, a vertex has parameters in each; mesh them one by one")
    columns = mesh.parameters.reshape(len(mesh.vertices), -1)
    return columns if columns.shape[1] == 2 else np.column_stack([columns[:, 0], np.zeros(len(columns))])


def _groups(mesh: Mesh) -> list[tuple[str, int, int]]:
    """Return `mesh.groups` with names that are plain and distinct, without the empty ones."""
    taken: set[str] = set()
    end = 0
    groups = []
    for name, start, stop in mesh.groups:
        if start != end or stop < start:
            raise ExportError(f"groups: {name!r} has cells {start} to {stop}, expected it to start at {end}")
        end = stop
        plain = distinct = _plain_name(name)
        number = 1
        while distinct in taken:
            number += 1
            distinct = f"{plain}-{number}"
        taken.add(distinct)
        if stop > start:
            groups.append((distinct, start, stop))
    if mesh.groups and end != len(mesh.cells):
        raise ExportError(f"groups: they end at cell {end} of {len(mesh.cells)}")
    return groups


def _plain_name(name: str) -> str:
    """Return a name without what would end a word, or continue a line, of a text format."""
    plain = "".join("_" if c.isspace() or not c.isprintable() or c == "\\" else c for c in name)
    return plain or "patch"


def _parts(
    mesh: Mesh, groups: Sequence[tuple[str, int, int]], normals: FloatArray | None, uv: FloatArray | None
) -> list[Part]:
    """Return each group with the vertices that its cells use; a single group with all of them."""
    from gtb_cli.formats.records import Part

    if len(groups) == 1:
        return [Part(groups[0][0], mesh.vertices, mesh.cells, normals, uv)]
    parts = []
    for name, start, stop in groups:
        cells = mesh.cells[start:stop]
        used, places = np.unique(cells, return_inverse=True)
        parts.append(
            Part(
                name,
                mesh.vertices[used],
                places.reshape(cells.shape),
                None if normals is None else normals[used],
                None if uv is None else uv[used],
            )
        )
    return parts


def _ply_attributes(mesh: Mesh) -> dict[str, FloatArray]:
    attributes: dict[str, FloatArray] = {}
    for name, values in mesh.attributes.items():
        plain = _plain_name(name).encode("ascii", "replace").decode().replace("?", "_")
        if plain in _PLY_RESERVED or plain in attributes:
            raise ExportError(f"attributes: PLY has a property {plain!r} already, as which {name!r} would be written")
        if values.ndim != 1:
            raise ExportError(f"attributes: {name!r}: expected one number for each vertex, got shape {values.shape}")
        attributes[plain] = values
    return attributes


def _ply_columns(
    vertices: FloatArray, normals: FloatArray | None, uv: FloatArray | None, attributes: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    columns = dict(zip("xyz", vertices.T, strict=True))
    if normals is not None:
        columns |= zip(("nx", "ny", "nz"), normals.T, strict=True)
    if uv is not None:
        columns |= zip("st", uv.T, strict=True)
    return columns | dict(attributes)


def _ply_of_trimesh(mesh: Mesh, normals: FloatArray | None, columns: Mapping[str, FloatArray]) -> bytes:
    import trimesh
    from trimesh.exchange.ply import export_ply

    from gtb_cli.formats.records import SINGLE

    scalars = list(columns)[3 if normals is None else 6 :]
    data: bytes = export_ply(
        trimesh.Trimesh(
            vertices=mesh.vertices,
            faces=mesh.cells,
            vertex_normals=normals,
            vertex_attributes={name: columns[name].astype(SINGLE) for name in scalars},
            process=False,
            validate=False,
        ),
        encoding="binary",
        vertex_normal=normals is not None,
        include_attributes=True,
    )
    return data


def _stl_of_trimesh(mesh: Mesh) -> bytes:
    from trimesh.exchange.stl import export_stl

    from gtb_cli.formats.records import SINGLE, facet_normals

    normals = np.empty(mesh.cells.shape, dtype=SINGLE)
    for start in range(0, len(mesh.cells), ROWS):
        block = slice(start, start + ROWS)
        normals[block] = facet_normals(mesh.vertices[mesh.cells[block]])
    # A Trimesh would compute its own normals (see facet_normals); the exporter asks for no more than these three.
    facets = SimpleNamespace(faces=mesh.cells, face_normals=normals, triangles=mesh.vertices.astype(SINGLE)[mesh.cells])
    data: bytes = export_stl(facets)
    return data


def _glb_of_trimesh(parts: Sequence[Part]) -> bytes:
    import trimesh
    from trimesh.exchange.gltf import export_glb
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    from gtb_cli.formats.records import mark_views

    root = "world"
    while any(part.name == root for part in parts):
        root += "_"
    scene = trimesh.Scene(base_frame=root)
    # A patch is open: with the default material, viewers leave out its back.
    material = PBRMaterial(metallicFactor=0.0, roughnessFactor=1.0, doubleSided=True)
    for part in parts:
        geometry = trimesh.Trimesh(
            vertices=part.vertices,
            faces=part.cells,
            vertex_normals=part.normals,
            visual=TextureVisuals(uv=part.uv, material=material),
            process=False,
            validate=False,
        )
        scene.add_geometry(geometry, node_name=part.name, geom_name=part.name)
    data: bytes = export_glb(
        scene,
        include_normals=parts[0].normals is not None,
        unitize_normals=True,
        tree_postprocessor=mark_views,
        extension_webp=False,
        extension_draco=False,
    )
    return data


def _single_precision_warnings(mesh: Mesh, kind: str) -> list[str]:
    with np.errstate(over="ignore", under="ignore"):
        single = mesh.vertices.astype(np.float32)
    if not np.isfinite(single).all():
        return []  # an error, not a warning
    way_out = "OBJ keeps their digits" if kind == "glb" else "--ascii or OBJ keeps their digits"
    messages = []
    moved = float(np.abs(single - mesh.vertices).max(initial=0.0))
    diagonal = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    if moved > VISIBLE * diagonal > 0.0:
        messages.append(
            f"{kind.upper()}: 32-bit numbers move vertices by up to {moved:.2g}, "
            f"{moved / diagonal:.2g} of the model's diagonal; {way_out}"
        )
    collapsed = _collapsed(mesh, single)
    if collapsed:
        what = "segments" if mesh.is_curve else "triangles"
        messages.append(
            f"{kind.upper()}: 32-bit numbers merge the corners of {collapsed} of {len(mesh.cells)} {what}; {way_out}"
        )
    return messages


def _collapsed(mesh: Mesh, single: NDArray[np.float32]) -> int:
    """Return how many cells have two corners that differ, but not in `single`."""
    gone = np.zeros(len(mesh.cells), dtype=bool)
    columns = np.ascontiguousarray(single.T)
    corners = mesh.cells.T
    for start, stop in ((0, 1),) if mesh.is_curve else ((0, 1), (1, 2), (2, 0)):
        suspects: NDArray[np.intp] | slice = slice(None)
        for column in columns:  # few are left after the first
            same = column[corners[start][suspects]] == column[corners[stop][suspects]]
            suspects = np.flatnonzero(same) if isinstance(suspects, slice) else suspects[same]
        ends = (mesh.vertices[corners[side][suspects]] for side in (start, stop))
        gone[suspects] |= np.not_equal(*ends).any(axis=1)
    return int(np.count_nonzero(gone))
