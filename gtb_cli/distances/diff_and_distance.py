"""`diff` and `distance` of any two things: meshes, patches, models, and files of meshes or specs."""

import hashlib
import os
import re
from bisect import bisect_left
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from functools import cache, cached_property, partial
from typing import IO, TypeAlias, get_args

import numpy as np

from gtb_cli.distances.between_shapes import shape_distance
from gtb_cli.distances.patch_equality import Pair, partners
from gtb_cli.errors import DomainError, ExportError, GtbError
from gtb_cli.files import read_file, read_up_to
from gtb_cli.formats.export import encode_mesh, groups_of
from gtb_cli.formats.file_arrays import FileArrays
from gtb_cli.formats.meshfiles import MAX_FILE_BYTES, MAX_STREAM_BYTES, decode_mesh, format_of, size_limit, values_of
from gtb_cli.language.document import MAX_BYTES as MAX_SPEC_BYTES, kind_of, spec_format_of
from gtb_cli.language.loading import parse
from gtb_cli.language.reading import AS_SEEN, Reading
from gtb_cli.meshes.correspondence import nearest_cells
from gtb_cli.meshes.difference import Difference, allowed_for, are, difference
from gtb_cli.meshes.hausdorff import Distance, Farthest, mesh_distance
from gtb_cli.meshes.mesh import LIBRARIES, NORMALS, TEXTURE, KnownMesh, Mesh, Values, are_marks, known_exactly, rounding
from gtb_cli.meshes.topology import components_of
from gtb_cli.models.model import Model
from gtb_cli.tessellation.attributes import QUALITY_NAME
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.tessellate import Shape, shape_of
from gtb_cli.theory.edges import edge_curve
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen
from gtb_cli.vocabulary import ATTRIBUTES, BASIS, FORMATS, SPEC_FORMATS, Aspect, Comparison, suffix_of

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
        held, beside = dict[str, bytes | str](), partial(os.path.join, os.path.dirname(self.name))
        digest = cache(_digest)  # a file may be named in many ways

        def hold(lines: Iterable[str], place: str = "") -> None:
            """Hold what lines name, perhaps in quotes, each several files, or one with blanks after options."""
            for line in (each.replace("\\", "/").replace('"', "") for each in dict.fromkeys(lines)):
                ends = (end for k in range(20) for end in line.split(None, k)[-1:] if " " in end)
                names = next(([end] for end in ends if os.path.isfile(beside(place, end))), line.split())
                for name in (os.path.join(place, name) for name in names):
                    held[name] = digest(os.path.realpath(beside(name))) if os.path.isfile(beside(name)) else name

        hold(self.known.libraries)
        there = {os.path.realpath(beside(name)): name for name, found in held.items() if isinstance(found, bytes)}
        for path, name in there.items() if self.known.format == "obj" else ():  # materials name pictures
            keys = rb"(?im)^[ \t]*(?:map_\w+|bump|disp|decal|norm|refl)[ \t]+(.*\S)"
            hold(map(os.fsdecode, re.findall(keys, read_file(path, MAX_STREAM_BYTES))), os.path.dirname(name))
        return held


def diff(
    a: Comparable,
    b: Comparable,
    tolerance: float | str | None = None,
    *,
    recipe: Recipe | None = None,
    kind: Comparison = "auto",
    ignore: Aspect | Collection[Aspect] = (),
) -> Difference:
    """Compare two meshes, as ``gtb diff`` does: ``found.same``, ``found.distance``, where, and how.

    A `GtbError` says that a file cannot be read, or something cannot be compared.

    Parameters
    ----------
    a, b : Mesh, Patch, Model, several patches, or path of a mesh file or of a spec
    tolerance : float or str, optional
        Largest distance that counts as none, in model units, or as ``"1%"`` of the size; 0 is what the numbers in files
        can hold. Default: 1e-9 of the size.
    recipe : Recipe, optional
        How to mesh what is not a mesh.
    kind : {"auto", "vertices", "surface"}
        Whether vertices are compared if the faces are the same, else surfaces; nothing but vertices; or surfaces. Two
        patches or models are compared themselves, and not as meshes, unless vertices are.
    ignore : {"orientation", "connectivity", "attributes"}, or a collection of them
        What is not a difference between meshes in the same place: faces that are turned over; other holes or parts,
        vertices shared in another way, and faces that are missing, there twice or without area; other normals, texture
        coordinates, attributes and names of patches.
    """
    recipe = recipe or Recipe()
    return compared(operand(a, recipe), operand(b, recipe), tolerance, kind, ignore)


def distance(a: Comparable, b: Comparable) -> Distance:
    """Measure the two-sided (Hausdorff) distance between two surfaces or curves, whatever their parameters.

    ``found.distance`` is also ``float(found)``; there are ``found.error``, and whether it is proved:
    ``found.is_proved``. A `GtbError` says that a file cannot be read, a mesh has no cells, or that something is neither
    a mesh nor a patch.

    Between meshes, the distance is proved up to its error. Between patches, models and curves it is found on themselves
    by a search to three digits, which is not proved: a nearest point may be missed. Beside a mesh, a patch is meshed
    with an error of at most a thousandth of its size, seen at samples only. `a` and `b` are what `diff` takes.
    """
    fine = 1e-3  # of the size: the mesh of a patch that is compared with a mesh
    one, other = (operand(each, Recipe(tolerance=f"{100 * fine}%")) for each in (a, b))
    if one.spec is not None and other.spec is not None:
        return shape_distance(one.spec, other.spec)
    found = mesh_distance(one.known.mesh, other.known.mesh)
    specs = [each for each in (one, other) if each.spec is not None]
    if not specs:
        return found
    size = float(np.linalg.norm(np.ptp(specs[0].known.mesh.bounds, axis=0)))
    return replace(found, bound=found.bound + fine * size, is_proved=False)


def compared(
    a: Operand,
    b: Operand,
    tolerance: float | str | None = None,
    kind: Comparison = "auto",
    ignore: Aspect | Collection[Aspect] = (),
) -> Difference:
    """Compare two operands; see `diff`."""
    aspects = (ignore,) if isinstance(ignore, str) else tuple(ignore)
    for name, known, word in (("kind", Comparison, kind), *(("ignore", Aspect, each) for each in aspects)):
        if word not in get_args(known):
            raise DomainError(f"{name}: expected {' or '.join(get_args(known))}, got {word!r}")
    if kind == "vertices" or a.spec is None or b.spec is None:
        return _meshes_compared(a, b, tolerance, kind, aspects)
    once = [_once(spec) for spec in (a.spec, b.spec)]
    meshes = [Recipe(8).mesh(each)[0] for each in once]
    bounds = [mesh.bounds for mesh in meshes]
    resolution = float(np.linalg.norm(np.sum([rounding(np.abs(each).max(axis=0)) for each in bounds], axis=0)))
    diagonal = min(float(np.linalg.norm(np.ptp(each, axis=0))) for each in bounds)
    asked, allowed = allowed_for(tolerance, diagonal, resolution)
    pairs, lone = partners(a.spec.patches, b.spec.patches, allowed)
    most, place = max(((pair.distance, pair.first) for pair in pairs), default=(0.0, 0))
    at = Farthest(most, tuple(a.spec.patches[place].evaluate(a.spec.patches[place].domain.vertices)[0].tolist()))
    found = Distance(at, at, most, is_proved=True)
    if any(lone) or most > min(allowed, allowed_for(None, diagonal, resolution)[1]):
        found = shape_distance(a.spec, b.spec)
    dimensions = {each.dimension for each in once}
    is_same = found.distance <= allowed and len(dimensions) == 1
    sides = zip(("first", "second"), (a.spec, b.spec), lone, strict=True)
    spare = {name: len(spec.patches) - len(alone) - len(pairs) for name, spec, alone in sides}
    repeated = [f"{are(n, 'patch', 'patches')} there more often in the {name}" for name, n in spare.items() if n]
    turned, values, left_out = _sides_and_names(a.spec, b.spec, once, meshes, pairs, lone) if is_same else (0, (), ())
    return Difference(
        method="patches",
        distance=found.distance,
        bound=found.bound,
        tolerance=allowed,
        asked=asked,
        resolution=resolution,
        diagonal=diagonal,
        forward=found.forward,
        backward=found.backward,
        same_kind=len(dimensions) == 1,
        is_curve=dimensions == {1},
        turned=turned,
        remarks=(*repeated, *_open_edges(once, allowed)) if is_same else (),
        ignored=tuple(sorted(aspects)),
        values=() if "attributes" in aspects else values,
        uncompared=left_out,
        is_searched=not found.is_proved,
    )


def _meshes_compared(
    a: Operand, b: Operand, tolerance: float | str | None, kind: Comparison, aspects: tuple[Aspect, ...]
) -> Difference:
    """Compare meshes, all else that they hold, and files that they name: by what these hold, and not by their names."""
    if kind == "surface" or "attributes" in aspects:
        return difference(a.known, b.known, tolerance, kind, aspects)
    found = difference(a.beside(b.known), b.beside(a.known), tolerance, kind, aspects)
    if not a.known.libraries or not b.known.libraries:
        return found
    values = [remark for remark in found.values if not remark.startswith(LIBRARIES)]
    are_other = [*a.libraries.values()] != [*b.libraries.values()]
    return replace(found, values=(*values, *[f"{LIBRARIES}: not the same"] * are_other))


def _sides_and_names(
    a: Spec, b: Spec, once: Sequence[Model], meshes: Sequence[Mesh], found: Sequence[Pair], lone: Sequence[list[int]]
) -> tuple[int, tuple[str, ...], tuple[str, ...]]:
    """Compare two specs of one surface: how many patches are turned over, remarks on names, and what is left out."""
    numbers = [{patch: k for k, patch in enumerate(model.patches)} for model in once]
    rows = [[of[patch.replace(name=None)] for patch in each.patches] for of, each in zip(numbers, (a, b), strict=True)]
    here, there = (mesh.origin.turned[row] for mesh, row in zip(meshes, rows, strict=True) if mesh.origin is not None)
    ours, theirs = (_one_sided(each, row) for each, row in zip(once, rows, strict=True))
    turned = sum(here[p] ^ there[q] ^ over for p, q, _, over in found if not (ours[p] and theirs[q]))
    pairs, is_cut = [(first, second) for first, second, *_ in found], False
    if any(lone):  # most of their faces tell
        one, other = (0, 1) if len(lone[0]) >= len(lone[1]) else (1, 0)
        nearest, over = nearest_cells(meshes[one], meshes[other])
        groups = [slice(*meshes[one].groups[rows[one][k]][1:]) for k in lone[one]]
        ends = [stop for _, _, stop in meshes[other].groups]
        counts = [np.bincount(np.searchsorted(ends, nearest[group], "right"), minlength=len(ends)) for group in groups]
        home = [rows[other].index(int(each.argmax())) for each in counts]
        homes = [*zip(*((lone[0], home) if one == 0 else (home, lone[1])), strict=True)]
        sided = [over[g] for g, (p, q) in zip(groups, homes, strict=True) if not (ours[p] and theirs[q])]
        turned += sum(each.sum() > each.size / 2 for each in sided)
        is_cut = sorted(home) != lone[other] or any(each.max() < 0.9 * each.sum() for each in counts)
        pairs += [] if is_cut else homes
    refs = [((first, a.patches[first].name), (second, b.patches[second].name)) for first, second in sorted(pairs)]
    names = [[name or f"patch{k}" for k, name in pair] for pair in refs if any(name for _, name in pair)]  # as meshes
    others = [pair for pair in names if pair[0] != pair[1] and max(map(len, (a.patches, b.patches))) > 1]
    old, new = (" ".join(pair[way] for pair in others) for way in (0, 1))
    words = "names of patches, and how often they are there,"
    left_out = (f"{words} are not compared where they are cut otherwise",) * is_cut
    left_out += ("sides of patches are not compared where a surface has only one",) * (any(ours) and any(theirs))
    return int(turned), (f"groups: {old} against {new}",) * bool(others), left_out


def _one_sided(model: Model, rows: Sequence[int]) -> list[bool]:
    """Tell for each of some patches whether it is part of a surface with one side."""
    pairs = np.array([(joint.first[0], joint.second[0]) for joint in model.joints.shared], dtype=np.int64)
    part = components_of(pairs.reshape(-1, 2), len(model.patches))
    return list(np.isin(part, part[[joint.first[0] for joint in model.joints.one_sided]])[rows].tolist())


def _once(spec: Spec) -> Model:
    """The patches without names, and without those that are there again."""
    patches = dict.fromkeys(patch.replace(name=None) for patch in spec.patches)
    return Model(patches, weld=getattr(spec, "weld", None))


def _open_edges(models: Sequence[Model], allowed: float) -> tuple[str, ...]:
    """Remark on open edges of patches, or ends of curves, in other places, and not on edges cut otherwise."""
    one, other = (
        [Patch([0, 1], edge_curve(m[k], e).ends) if m.dimension == 1 else m[k].boundary(e) for k, e in m.joints.open]
        for m in models
    )
    both = bool(one and other)
    are_other = shape_distance(Model(one), Model(other)).distance > allowed if both else bool(one or other)
    what = "edges of patches" if models[0].dimension == 2 else "ends of curves"
    return (f"{len(one)} open {what} against {len(other)}" + ", in other places" * both,) * are_other


def _digest(path: str) -> bytes:
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").digest()
    except OSError as error:
        raise GtbError(f"{path}: {error.strerror or error}") from None


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


def made_with(spec: Spec, cells: int) -> int | None:
    """Return the resolution with which a spec has so many cells, or None."""
    most = 4096  # segments of an edge
    found = 1 + bisect_left(range(1, most), cells, key=lambda resolution: Recipe(resolution).faces(spec))
    return found if Recipe(found).faces(spec) == cells else None
