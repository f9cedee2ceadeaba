"""Two things that are meshes, or become meshes, compared: files of meshes, specs, patches and models."""

from __future__ import annotations

import os
from typing import TypeAlias

from gtb_cli.errors import DomainError, GtbError
from gtb_cli.formats.meshfiles import decode_mesh, format_of, size_limit
from gtb_cli.language.document import MAX_BYTES as MAX_SPEC_BYTES
from gtb_cli.language.document import spec_format_of
from gtb_cli.language.loading import parse
from gtb_cli.language.scanner import Format
from gtb_cli.meshes.difference import Difference, difference
from gtb_cli.meshes.known import KnownMesh, known_exactly
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.shape import Shape, shape_of
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen
from gtb_cli.vocabulary import FORMATS, SPEC_FORMATS, suffix_of

BEGINNING_BYTES = 1 << 16  # bytes by which a mesh is told from a spec
MAX_RESOLUTION = 4096  # segments of an edge up to which the resolution of a mesh is looked for

Comparable: TypeAlias = Mesh | Shape


@frozen
class Side:
    """One of the two meshes that are compared.

    Attributes
    ----------
    known : KnownMesh
    spec : Patch, Model or None
        What it was made from, if not from a mesh file.
    """

    known: KnownMesh
    spec: Patch | Model | None = None


def diff(
    a: Comparable, b: Comparable, tolerance: float | str | None = None, *, recipe: Recipe | None = None
) -> Difference:
    """Compare two meshes, as ``gtb diff`` does.

    Parameters
    ----------
    a, b : Mesh, Patch, Model, several patches, or path of a mesh file or of a spec
    tolerance : float or str, optional
        Largest distance that counts as none, in model units, or as ``"1%"`` of the size; 0 is what the numbers in files
        can hold. Default: 1e-9 of the size.
    recipe : Recipe, optional
        How to mesh what is not a mesh.

    Returns
    -------
    Difference
        ``found.same``, ``found.distance``, where, and how.

    Raises
    ------
    GtbError
        A file cannot be read, or something cannot be compared.
    """
    recipe = recipe or Recipe()
    return difference(_side(a, recipe).known, _side(b, recipe).known, tolerance)


def _side(what: Comparable, recipe: Recipe) -> Side:
    if isinstance(what, Mesh):
        return Side(known_exactly(what))
    if not isinstance(what, str | os.PathLike):
        spec = shape_of(what)
        return Side(known_exactly(recipe.mesh(spec)[0]), spec)
    name = os.fspath(what)
    try:
        with open(name, "rb") as file:
            start = file.read(BEGINNING_BYTES)
            data = start + file.read(bytes_at_most(name, start) + 1 - len(start))
    except OSError as error:
        raise GtbError(f"{name}: {error.strerror or error}") from None
    return decoded(data, name, recipe)


def bytes_at_most(name: str, start: bytes) -> int:
    """How many bytes are read of a file with this name and beginning."""
    return MAX_SPEC_BYTES if suffix_of(name) in SPEC_FORMATS else size_limit(start, MAX_SPEC_BYTES)


def decoded(data: bytes, name: str, recipe: Recipe, spec_format: Format | None = None) -> Side:
    """Read a mesh, or make the mesh of a spec: what the content says, else the suffix of the name.

    Raises
    ------
    GtbError
        It is neither, or is damaged; the message has the name.
    """
    suffix = suffix_of(name)
    kind = None if suffix in SPEC_FORMATS else format_of(data) or (suffix if suffix in FORMATS else None)
    if kind is not None:
        return Side(decode_mesh(data, name, kind))
    if b"\0" in data[:BEGINNING_BYTES] and not spec_format:
        raise GtbError(f"{name}: is neither a mesh nor a spec")
    spec = parse(data, name, spec_format or spec_format_of(name))
    try:
        return Side(known_exactly(recipe.mesh(spec)[0]), spec)
    except GtbError as error:
        raise type(error)("\n".join(f"{name}: {line}" for line in str(error).split("\n"))) from error


def made_with(a: Side, b: Side) -> int | None:
    """The resolution with which the spec of one side has as many cells as the mesh of the other; None if none has."""
    if (a.spec is None) == (b.spec is None):
        return None
    spec, wanted = (a.spec, len(b.known.mesh.cells)) if a.spec is not None else (b.spec, len(a.known.mesh.cells))
    assert spec is not None
    low, high = 1, MAX_RESOLUTION
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if Recipe(middle).faces(spec) >= wanted else (middle + 1, high)
    try:
        return low if Recipe(low).faces(spec) == wanted else None
    except DomainError:
        return None
