"""Meshes to files: the writer of each format, what it leaves out, where 32 bits move vertices; axes: `vocabulary`."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, combinations, count
from typing import IO

import numpy as np

from gtb_cli.arrays import FloatArray, row_blocks
from gtb_cli.errors import ExportError
from gtb_cli.files import replace_file, write_all
from gtb_cli.formats.file_arrays import SINGLE_FLOAT, first_beyond, single_half_steps
from gtb_cli.formats.numbers_written import BLOCK_ROWS, decimals, number_lines, obj_blocks
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.vocabulary import DEFAULT_UNIT, FORMATS, UNIT_FORMATS, UNITS, UP, Up, plain_name, suffix_of

_SINGLE_LIMIT = (2.0 - 2.0**-23) * 2.0**127  # the largest finite 32-bit number
_DOUBLE_LIMIT = 2.0**1022  # differences, such as a box's extents, are finite as well


def write_mesh(
    mesh: Mesh,
    path_or_file: str | os.PathLike[str] | IO[bytes],
    format: str | None = None,
    *,
    ascii: bool = False,
    normals: bool | None = None,
    uv: bool = False,
    up: Up | None = None,
    unit: str | None = None,
) -> None:
    """Write a mesh to a file, whole or not at all.

    Parameters
    ----------
    mesh : Mesh
        The order of vertices and cells is kept, and the same mesh gives the same bytes.
    path_or_file : str, path-like or binary file object
        A path is replaced atomically (see `gtb_cli.files.replace_file`); a file object is written to and flushed.
    format : {"obj", "ply", "stl", "glb", "3mf"}, optional
        The default is the format of the path's suffix.
    ascii : bool
        Write PLY and STL as text, with numbers that read back exactly, instead of 32-bit binary. OBJ is always text.
    normals : bool, optional
        Write normals; by default GLB has those that the mesh has, and the others have none. Where patches meet, OBJ and
        GLB (whose nodes have their own vertices) hold each patch's own, PLY the mean. STL always has normals of facets.
    uv : bool
        Write `mesh.parameters`, unchanged, as texture coordinates: OBJ, PLY, GLB. The second coordinate is 0 for a
        curve.
    up : {"z", "y"}, optional
        The axis of the file for the z axis of the mesh. The default is y in GLB, as glTF prescribes, and z in the
        others.
    unit : {"mm", "cm", "m", "in", "ft"}, optional
        The unit of length of the mesh. 3MF names it, by default mm; GLB is in metres, and by default its numbers stay.

    Raises `ExportError` if the format cannot hold the mesh, a number is not finite, or the file cannot be written, and
    `BrokenPipeError` if the reader of a pipe has closed it.
    """
    if not isinstance(mesh, Mesh):
        raise ExportError(f"expected a Mesh, such as gtb_cli.tessellate makes, got {type(mesh).__name__}")
    encoded = partial(encode_mesh, mesh, ascii=ascii, normals=normals, uv=uv, up=up, unit=unit)
    if isinstance(path_or_file, (str, os.PathLike)):
        replace_file(path_or_file, encoded(format or _format_of(os.fspath(path_or_file))))
        return
    if hasattr(path_or_file, "encoding"):
        raise ExportError("cannot write a mesh to a text file object: expected a binary one")
    name = getattr(path_or_file, "name", None)
    blocks = encoded(format or _format_of(name if isinstance(name, str) else "a file without a name"))
    try:
        write_all(path_or_file, blocks)
    except BrokenPipeError:
        raise
    except OSError as error:
        place = name if isinstance(name, str) else "the output"
        raise ExportError(f"cannot write {place}: {error.strerror or error}") from error


def encode_mesh(
    mesh: Mesh,
    format: str,
    *,
    ascii: bool = False,
    normals: bool | None = None,
    uv: bool = False,
    up: Up | None = None,
    unit: str | None = None,
) -> Iterable[bytes]:
    """Return the bytes of a mesh file, block by block; the parameters are those of `write_mesh`.

    All its errors about the mesh are raised here, before the first block.
    """
    kind = _known(format)
    holds, shown, vertices = FORMATS[kind], kind.upper(), len(mesh.vertices)
    if mesh.is_curve and not holds.curves:
        raise ExportError(f"{shown} holds triangles, and a curve has none: give it a thickness with `radius` (a tube)")
    if ascii and holds.text == "never":
        raise ExportError(f"{shown} has no text form: expected obj, ply or stl with `ascii`")
    if unit is not None and unit not in UNITS:
        raise ExportError(f"unit: expected one of {', '.join(UNITS)}, got {unit!r}")
    if unit is not None and kind not in UNIT_FORMATS:
        raise ExportError(f"unit: {shown} has none")
    if not vertices or not len(mesh.cells):
        raise ExportError(f"the mesh is empty: {vertices} vertices, {len(mesh.cells)} cells")
    low, high = int(mesh.cells.min()), int(mesh.cells.max())
    if low < 0 or high >= vertices:
        raise ExportError(f"cells: expected indices from 0 to {vertices - 1}, got {low if low < 0 else high}")
    mesh = _with_normals(mesh, kind, normals)
    coordinates = _texture_coordinates(mesh) if uv and holds.uv else None
    attributes: dict[str, FloatArray] = {}
    if holds.attributes and mesh.attributes:
        from gtb_cli.formats.ply import ply_attributes

        attributes = ply_attributes(mesh.attributes)
    name, groups = plain_name(mesh.name), groups_of(mesh)

    limit = _DOUBLE_LIMIT if FORMATS[kind].is_text(ascii) else _SINGLE_LIMIT
    columns = (("coordinates", mesh.vertices), ("normal", mesh.normals), ("uv", coordinates), *attributes.items())
    for label, values in columns:
        if values is not None and (bad := first_beyond(values.reshape(len(values), -1), limit)) is not None:
            row, reason = np.atleast_1d(values[bad]), "must be finite"
            if np.isfinite(row).all():
                reason = "too large for 32-bit numbers" if limit == _SINGLE_LIMIT else "too large"
            raise ExportError(f"vertex {bad}: {label}: {reason}, got {' '.join(f'{value:g}' for value in row)}")

    mesh = standing(mesh, kind, up)
    if kind == "obj":
        return obj_blocks(mesh, coordinates, groups)
    if kind == "ply":
        from gtb_cli.formats.ply import ply_blocks

        return ply_blocks(mesh, coordinates, attributes, ascii=ascii)
    if kind == "stl":
        from gtb_cli.formats.stl import stl_blocks

        return stl_blocks(mesh.vertices, mesh.cells, name, ascii=ascii)
    groups = groups or [(name, 0, len(mesh.cells))]
    if kind == "3mf":
        from gtb_cli.formats.threemf import threemf_blocks

        return threemf_blocks(mesh.vertices, mesh.cells, groups, name, unit or DEFAULT_UNIT)
    from gtb_cli.formats.glb import glb_blocks

    return glb_blocks(mesh, groups, coordinates, up or FORMATS[kind].up, unit, name)


def _with_normals(mesh: Mesh, kind: str, normals: bool | None) -> Mesh:
    """Return the mesh with the normals that are written, or without any; GLB has a vertex for each."""
    if not FORMATS[kind].has_normals(normals) or mesh.is_curve:
        return replace(mesh, normals=None, normal_of=None, exact_normals=False)  # type: ignore[arg-type]
    if mesh.normals is None and normals:
        raise ExportError("normals: the mesh has none")
    return mesh.split if kind == "glb" else mesh


def standing(mesh: Mesh, format: str, up: Up | None = None) -> Mesh:
    """Return a mesh with the axes of a file; the parameters are those of `write_mesh`."""
    axis = up or FORMATS[format].up
    if axis not in UP:
        raise ExportError(f"up: expected z or y, got {axis!r}")
    return mesh.with_y_up if axis == "y" else mesh


def warnings_for(mesh: Mesh, format: str, *, ascii: bool = False, normals: bool = False, uv: bool = False) -> list[str]:
    """Return warnings about the file that `write_mesh` would write with the same arguments.

    They say whether 32-bit numbers would merge or visibly move vertices, what is left out, and which readers refuse it.
    """
    kind = _known(format)
    holds, shown = FORMATS[kind], kind.upper()
    messages = _single_precision_warnings(mesh, kind) if holds.is_single(ascii) else []
    messages += ["PLY: meshio and assimp read no file with edges, as a curve has"] * (kind == "ply" and mesh.is_curve)
    if kind == "stl" and not mesh.is_curve and len(mesh.cells) < 4:
        messages.append(f"STL: admesh reads no file of fewer than 4 facets, and this has {len(mesh.cells)}")
    messages += [f"{shown}: holds no texture coordinates, none are written"] * (uv and not holds.uv)
    messages += [f"{shown}: a curve has no normals, none are written"] * (normals and mesh.is_curve)
    if kind == "ply" and normals and not mesh.is_curve and round(mesh.largest_split, 6) > 1.0:
        split = f"here at up to {mesh.largest_split:.3g} degrees; OBJ and GLB hold all"
        messages.append(f"PLY: holds one normal a vertex, the mean where several meet, {split}")
    if kind == "obj" and normals and mesh.normals is not None and len(mesh.normals) > len(mesh.vertices):
        readers = "viewers and renderers show them, and meshio does not read such a file"
        messages.append(f"OBJ: a vertex where patches meet at an angle has several normals: {readers}")
    if kind == "obj" and uv and mesh.parameters is not None:
        extent, size = (float(np.ptp(rows, axis=0).max()) for rows in (mesh.parameters, mesh.bounds))
        if 0.0 < extent < 1e-3 * min(1.0, size):
            few = f"too few for parameters that span {extent:.3g}; PLY keeps their digits"
            messages.append(f"OBJ: texture coordinates have the decimals of the vertices, {few}")
    return messages


def _known(format: str) -> str:
    kind = format.lower()
    if kind not in FORMATS:
        raise ExportError(f"format: expected one of {', '.join(FORMATS)}, got {format!r}")
    return kind


def _format_of(path: str) -> str:
    suffix = suffix_of(path)
    if suffix not in FORMATS:
        expected = ", ".join(f".{name}" for name in FORMATS)
        raise ExportError(f"cannot tell the format of {path}: expected a name that ends in {expected}, or a format")
    return suffix


def _texture_coordinates(mesh: Mesh) -> FloatArray:
    if mesh.parameters is None:
        raise ExportError("uv: the mesh has no parameters")
    if mesh.origin is not None:
        raise ExportError("uv: where patches of a model meet, a vertex has parameters in each; mesh them one by one")
    columns = mesh.parameters.reshape(len(mesh.vertices), -1)
    return columns if columns.shape[1] == 2 else np.column_stack([columns[:, 0], np.zeros(len(columns))])


def groups_of(mesh: Mesh) -> list[tuple[str, int, int]]:
    """Return the non-empty `mesh.groups`, with plain and distinct names."""
    groups: dict[str, tuple[int, int]] = {}
    end = 0
    for name, start, stop in mesh.groups:
        if start != end or stop < start:
            raise ExportError(f"groups: {name!r} has cells {start} to {stop}, expected it to start at {end}")
        end = stop
        plain = plain_name(name)
        numbered = (f"{plain}-{number}" for number in count(2))
        groups[next(name for name in chain([plain], numbered) if name not in groups)] = start, stop
    if mesh.groups and end != len(mesh.cells):
        raise ExportError(f"groups: they end at cell {end} of {len(mesh.cells)}")
    return [(name, start, stop) for name, (start, stop) in groups.items() if stop > start]


def rounding_in(kind: str, hull: Sequence[FloatArray], ascii: bool = False) -> float:
    """Bound how far a format moves vertices in the hull of (n, 3) points, as its numbers have fewer digits.

    Text that is written on request has all digits.
    """
    points = np.concatenate(hull)
    if FORMATS[kind].is_single(ascii):
        return float(np.linalg.norm(single_half_steps(np.abs(points).max(axis=0))))
    return 0.0 if FORMATS[kind].text == "on request" else 3**0.5 / 2 * 10.0 ** -decimals(points)


def held_vertices(mesh: Mesh, kind: str, ascii: bool = False) -> FloatArray:
    """Return the (m, 3) vertices as the numbers of a format hold them; those too large for it are infinite."""
    vertices = mesh.vertices
    if FORMATS[kind].is_single(ascii):
        with np.errstate(over="ignore", under="ignore"):
            return vertices.astype(SINGLE_FLOAT).astype(np.float64)
    if FORMATS[kind].text == "on request" or not np.isfinite(vertices).all():
        return vertices
    digits = decimals(vertices)
    texts = (number_lines("", vertices[rows], digits) for rows in row_blocks(len(vertices), BLOCK_ROWS))
    return np.concatenate([np.array(text.split(), dtype=np.float64) for text in texts]).reshape(-1, 3)


def held(mesh: Mesh, kind: str, ascii: bool = False) -> tuple[Mesh, str]:
    """Return a mesh as the numbers of a format hold it, without normals, and the way out where they are too coarse."""
    vertices = held_vertices(mesh, kind, ascii)
    coarse = f"the numbers of {kind.upper()} are too coarse here, {_way_out(kind)}"
    coarse += "; nearer to the origin they are finer" * (kind != "obj")
    if not np.isfinite(vertices).all():
        return mesh, coarse  # an error of the file
    return replace(mesh, vertices=vertices, normals=None, normal_of=None, exact_normals=False), coarse  # type: ignore[arg-type]


def _way_out(kind: str) -> str:
    """Say which file holds more digits than one of a format."""
    ways = {"always": "PLY with `ascii` keeps", "on request": "`ascii` or OBJ keeps", "never": "OBJ keeps"}
    return f"{ways[FORMATS[kind].text]} their digits"


def _single_precision_warnings(mesh: Mesh, kind: str) -> list[str]:
    visible_shift = 1e-5  # fraction of the model's diagonal; shading shows facets if vertices are shifted by more
    columns = held_vertices(mesh, kind).T
    if not np.isfinite(columns).all():
        return []  # an error, not a warning
    loss = f"{kind.upper()}: 32-bit numbers"
    messages = []
    moved = max(float(np.abs(column - x).max()) for column, x in zip(columns, mesh.vertices.T, strict=True))
    diagonal = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    if moved > visible_shift * diagonal > 0.0:
        share = f"{moved / diagonal:.2g} of the model's diagonal"
        messages.append(f"{loss} move vertices by up to {moved:.2g}, {share}; {_way_out(kind)}")
    merged = np.zeros(len(mesh.cells), dtype=bool)
    for one, other in combinations(mesh.cells.T, 2):
        near = np.flatnonzero(np.all([column[one] == column[other] for column in columns], axis=0))
        merged[near] |= (mesh.vertices[one[near]] != mesh.vertices[other[near]]).any(axis=1)
    if merged.any():
        share = f"{np.count_nonzero(merged)} of {len(merged)} {'segments' if mesh.is_curve else 'triangles'}"
        messages.append(f"{loss} merge the corners of {share}; {_way_out(kind)}")
    return messages
