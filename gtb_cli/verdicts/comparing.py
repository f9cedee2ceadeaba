"""Files compared, one with one or folder with folder: meshes and specs by their shapes, others by their bytes."""

from __future__ import annotations

import filecmp
import os
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

from gtb_cli.errors import Fault, GtbError
from gtb_cli.shell.faults import faults_about
from gtb_cli.shell.folders import pairs
from gtb_cli.shell.streams import is_regular, opened, shown_input
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.vocabulary import FORMATS, SPEC_FORMATS, suffix_of

if TYPE_CHECKING:
    from gtb_cli.distances.comparison import Operand
    from gtb_cli.meshes.difference import Aspect, Difference, Kind
    from gtb_cli.meshes.mesh import Mesh

Verdict: TypeAlias = Literal["same", "different", "missing", "extra", "unreadable"]


@dataclass(frozen=True)
class Answer:
    """The answer about two files; without `found` if only their bytes were compared, or one is missing."""

    name: str  # of the two in their folders; of the second, if these are not folders
    paths: tuple[str, str]  # as messages show them; also of a file that is missing
    verdict: Verdict
    found: Difference | None = None
    warnings: tuple[str, ...] = ()  # where the answer does not quite fit the question
    notes: tuple[str, ...] = ()  # what else could be asked
    errors: tuple[Fault, ...] = ()  # why a file is unreadable
    meshes: tuple[Mesh | None, Mesh | None] = (None, None)  # None if they are the same, or not meshes

    @property
    def same(self) -> bool:
        """Whether the files are the same within the tolerance."""
        return self.verdict == "same"


@dataclass(frozen=True)
class Comparing:
    """How files are compared: the arguments of `gtb_cli.diff`."""

    recipe: Recipe = field(default_factory=Recipe)
    tolerance: float | str | None = None
    kind: Kind = "auto"
    ignore: Aspect | Collection[Aspect] = ()
    spec_format: str | None = None

    def files(self, first: str, second: str) -> Answer:
        """Compare two files, or standard input with a file; raises `GtbError` if one of them cannot be read."""
        shown = shown_input(first), shown_input(second)
        answer = Answer(os.path.basename(shown[1]), shown, "same")
        if _are_equal_meshes(first, second):
            return answer
        from gtb_cli.distances.comparison import compared, made_with

        a, b = self.read(first), self.read(second)
        found = compared(a, b, self.tolerance, self.kind, self.ignore)
        notes = []
        if self.kind == "auto" and not found.same and a.spec is not None and b.spec is not None:
            other = compared(a, b, self.tolerance, "surface")
            did = "vertex by vertex" if found.method == "vertices" else "as surfaces"
            themselves = f"the surfaces themselves (--as surface) are {other.distance:.3g} apart"
            notes.append(f"their meshes were compared {did}; {themselves}")
        if self.kind == "auto" and found.method == "surface" and found.same_kind and self.recipe.tolerance is None:
            made = made_with(a, b)
            if made not in (None, self.recipe.resolution):
                spec, mesh = answer.paths if a.spec is not None else answer.paths[::-1]
                notes.append(
                    f"{mesh} has as many cells as {spec} has with -n {made}: -n {made} compares their vertices"
                )
        answer = replace(answer, found=found, warnings=found.limits, notes=tuple(notes))
        return answer if found.same else replace(answer, verdict="different", meshes=(a.known.mesh, b.known.mesh))

    def folders(self, a: str, b: str) -> Iterator[Answer]:
        """Compare all files of two folders that have the same name, sorted by name."""
        matched, unreadable = pairs(a, b)
        has_meshes = any(suffix_of(path) in FORMATS for pair in matched.values() for path in pair if path)
        for name in sorted({*unreadable, *matched}):
            first, second = matched.get(name, (None, None))
            paths = first or os.path.join(a, name), second or os.path.join(b, name)
            if name in unreadable:
                yield Answer(name, paths, "unreadable", errors=tuple(GtbError(unreadable[name]).faults))
                continue
            if first is None or second is None:
                yield Answer(name, paths, "extra" if first is None else "missing")
                continue
            try:
                yield replace(self._pair(first, second, has_meshes), name=name)
            except (GtbError, OSError) as error:
                yield Answer(name, paths, "unreadable", errors=tuple(faults_about(error)))

    def _pair(self, first: str, second: str, has_meshes: bool) -> Answer:
        for path in (first, second):
            if os.path.exists(path) and not os.path.isfile(path):  # reading a pipe would wait for its writer
                raise GtbError(f"{path}: is not a file")
        suffixes = {suffix_of(first), suffix_of(second)}
        specs_count = not has_meshes or len(suffixes) > 1
        if suffixes <= FORMATS.keys() or (suffixes <= {*SPEC_FORMATS, *FORMATS} and specs_count):
            return self.files(first, second)
        same = filecmp.cmp(first, second, shallow=False)
        return Answer("", (first, second), "same" if same else "different")

    def read(self, path: str) -> Operand:
        """Read a mesh file, or a spec, which becomes a mesh where one is needed."""
        from gtb_cli.distances.comparison import decoded

        return decoded(mesh_or_spec(path), shown_input(path), self.recipe, self.spec_format)  # type: ignore[arg-type]


def mesh_or_spec(path: str) -> bytes:
    """Read a mesh file, or a spec, or standard input; at most one byte more than it may have."""
    from gtb_cli.distances.comparison import BEGINNING_BYTES, bytes_at_most
    from gtb_cli.files import read_up_to
    from gtb_cli.formats.meshfiles import MAX_STREAM_BYTES

    with opened(path) as file:
        start = file.read(BEGINNING_BYTES)
        limit = bytes_at_most(path, start)
        stream = not is_regular(file)
        if stream:
            limit = min(limit, MAX_STREAM_BYTES)
        if file.seekable():  # so that a large file is in memory only once
            file.seek(-len(start), os.SEEK_CUR)
            start = b""
        data = start + read_up_to(file, limit + 1 - len(start))
    if stream and len(data) > MAX_STREAM_BYTES:
        limit = MAX_STREAM_BYTES >> 20
        raise GtbError(f"{shown_input(path)}: does not end within {limit} MB; more is read only from files")
    return data


def _are_equal_meshes(first: str, second: str) -> bool:
    """Tell whether two files have equal bytes and are meshes; specs with equal bytes may include other files."""
    from gtb_cli.formats.meshfiles import format_of, size_limit

    if suffix_of(first) in SPEC_FORMATS or not os.path.isfile(first) or not os.path.isfile(second):
        return False
    with opened(first) as file:
        start = file.read(1 << 16)
    is_mesh = format_of(start) is not None or size_limit(start, 0) == os.path.getsize(first)  # binary STL
    return is_mesh and filecmp.cmp(first, second, shallow=False)
