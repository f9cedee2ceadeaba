"""What is compared: meshes, patches, models, and files of meshes or specs, as they are read."""

import os
from dataclasses import replace
from functools import cached_property
from typing import IO, TypeAlias

import numpy as np

from gtb_cli.distances.named_files import named_files
from gtb_cli.errors import ExportError, GtbError
from gtb_cli.files import read_up_to
from gtb_cli.formats.export import encode_mesh, groups_of
from gtb_cli.formats.file_arrays import FileArrays
from gtb_cli.formats.meshfiles import MAX_FILE_BYTES, decode_mesh, format_of, size_limit, values_of
from gtb_cli.language.document import MAX_BYTES as MAX_SPEC_BYTES, kind_of, spec_format_of
from gtb_cli.language.loading import parse
from gtb_cli.language.reading import AS_SEEN, Reading
from gtb_cli.meshes.mesh import NORMALS, TEXTURE, KnownMesh, Mesh, Values, are_marks, known_exactly, rounding
from gtb_cli.models.model import Model
from gtb_cli.tessellation.attributes import QUALITY_NAME
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.tessellate import Shape, shape_of
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen
from gtb_cli.vocabulary import ATTRIBUTES, BASIS, FORMATS, SPEC_FORMATS, suffix_of

BEGINNING_BYTES = 1 << 16  # bytes by which a mesh is told from a spec

Comparable: TypeAlias = Mesh | Shape
Spec: TypeAlias = Patch | Model


@frozen
class Operand:
    """One of the two things that are compared."""

    origin: KnownMesh | Mesh | Patch | Model
    recipe: Recipe  # for what is not a mesh
    name: str = ""  # of its file, for errors

    @property
    def spec(self) -> Spec | None:
        """The patch or model that it is, if it is not a mesh."""
        return None if isinstance(self.origin, KnownMesh | Mesh) else self.origin

    @cached_property
    def known(self) -> KnownMesh:
        """The mesh that it is or becomes."""
        return self.origin if isinstance(self.origin, KnownMesh) else _computed(self.made)

    @cached_property
    def made(self) -> Mesh:
        """The mesh, with its normals if it was computed."""
        if self.spec is None:
            return self.origin.mesh if isinstance(self.origin, KnownMesh) else self.origin  # type: ignore[return-value]
        try:
            return replace(self.recipe, normals=True).mesh(self.spec)[0]
        except GtbError as error:
            raise (error.within(self.name) if self.name else error) from error

    def beside(self, file: KnownMesh) -> KnownMesh:
        """Its mesh, if it was computed with what `gtb mesh` writes of it beside the faces of such a file."""
        spec, kind = self.spec, file.format
        if spec is None or kind not in FORMATS:
            return self.known
        held, made = file.values(), self.made
        names, uv = _options(spec, held) if FORMATS[kind].attributes else ([], TEXTURE in held)
        made = replace(self.recipe, normals=True, attributes=tuple(names)).mesh(spec)[0] if names else made
        uv = uv and made.parameters is not None and made.origin is None
        try:
            blocks = encode_mesh(made, kind, normals=NORMALS in held or None, uv=uv)
        except ExportError:  # numbers that the format cannot hold
            return self.known
        written = decode_mesh(b"".join(blocks), self.name, kind)
        is_exact = made.exact_normals or len(made.cells) == len(file.mesh.cells)
        doubtful = tuple(name for name in held if are_marks(name) or (name == NORMALS and not is_exact))
        mesh, units = written.mesh, file.space.split(", ")[: 1 if kind == "3mf" else 2]  # any unit, and any axis
        if len(mesh.cells) == len(made.cells):  # 3MF leaves out collapsed ones
            mesh = replace(self.known.mesh, groups=mesh.groups)
        space = ", ".join([*units, *written.space.split(", ")[len(units) :]])
        values = {name: rows for name, rows in written.values().items() if name != QUALITY_NAME or name in held}
        return replace(self.known, mesh=mesh, format=kind, space=space, values=lambda: values, doubtful=doubtful)

    @cached_property
    def libraries(self) -> dict[str, bytes | str]:
        """Digests of libraries and pictures that it names, by their names; the names of those that are not there."""
        return named_files(self.known, self.name)


def operand(what: Comparable, recipe: Recipe) -> Operand:
    """Return what is compared, with the recipe for what is not a mesh; `GtbError` if it is neither mesh nor spec."""
    if isinstance(what, Mesh):
        return Operand(what, recipe)
    if not isinstance(what, str | os.PathLike):
        return Operand(shape_of(what), recipe)
    name = os.fspath(what)
    try:
        with open(name, "rb") as file:
            data = read_content(file, name)
    except OSError as error:
        raise GtbError(f"{name}: {error.strerror or error}") from None
    return decoded(data, name, recipe)


def read_content(file: IO[bytes], name: str, most: int = MAX_FILE_BYTES) -> bytes:
    """Read a mesh or a spec of this name, at most one byte more than it may have, or than `most`."""
    start = file.read(BEGINNING_BYTES)
    limit = MAX_SPEC_BYTES if suffix_of(name) in SPEC_FORMATS else size_limit(start, MAX_SPEC_BYTES)
    if file.seekable():  # so that a large file is in memory only once
        file.seek(-len(start), os.SEEK_CUR)
        start = b""
    return start + read_up_to(file, min(limit, most) + 1 - len(start))


def decoded(data: bytes, name: str, recipe: Recipe, reading: Reading = AS_SEEN) -> Operand:
    """Read a mesh or a spec: what the content says, else the suffix of the name; `GtbError` if it is neither."""
    suffix = suffix_of(name)
    kind = None if suffix in SPEC_FORMATS else format_of(data) or (suffix if suffix in FORMATS else None)
    if kind is not None:
        return Operand(decode_mesh(data, name, kind), recipe, name)
    if b"\0" in data[:BEGINNING_BYTES] and not reading.spec_format:
        raise GtbError(f"{name}: is {kind_of(data) or 'neither a mesh nor a spec'}")
    return Operand(parse(data, name, reading.spec_format or spec_format_of(name), dict(reading.let)), recipe, name)


def _computed(mesh: Mesh) -> KnownMesh:
    """A mesh that was computed here, with groups as a file of it has them."""
    known, groups = known_exactly(mesh), tuple(groups_of(mesh))
    content = FileArrays(mesh.vertices, mesh.cells, rounding, groups)
    named = replace(mesh, groups=groups, normals=None, normal_of=None, exact_normals=False)  # type: ignore[arg-type]
    return replace(known, mesh=named, values=lambda: {**known.values(), **values_of(content, named, "")})


def _options(spec: Spec, held: Values) -> tuple[list[str], bool]:
    """Return the attributes that a PLY file has of a spec, in the order of its options, and whether it has uv, too."""
    known = dict.fromkeys(ATTRIBUTES[: 4 if spec.dimension == 2 else 1])
    if isinstance(spec, Patch):
        known |= {f"basis_{index}": None for index in range(len(spec.knots))}
    columns, uv = {name: rows for name, (rows, _) in held.items()}, TEXTURE in held
    if uv and spec.dimension == 2 and not {"u", "v"} & columns.keys():  # named u and v, or s and t
        columns, uv = {"u": columns[TEXTURE][:, :1], "v": columns[TEXTURE][:, 1:], **columns}, False
    names = [name for name in columns if name in known]  # first the one that is there again as the quality
    names.sort(key=lambda name: not np.array_equal(columns[name], columns.get(QUALITY_NAME, [])))
    return [name.replace("basis_", BASIS) for name in names], uv
