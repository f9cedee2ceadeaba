"""Files compared, one with one or folder with folder: meshes and specs by their shapes, others by their bytes."""

from __future__ import annotations

import filecmp
import json
import os
import re
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from gtb_cli.errors import Fault, GtbError
from gtb_cli.files import read_file, sha256_of
from gtb_cli.language.reading import AS_SEEN, Reading
from gtb_cli.shell.faults import faults_about
from gtb_cli.shell.folders import pairs
from gtb_cli.shell.streams import is_regular, opened, shown_input
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.verdicts.verdict import Verdict
from gtb_cli.vocabulary import FORMATS, SEQUENCE_RECORD, SPEC_FORMATS, Aspect, Comparison, suffix_of

if TYPE_CHECKING:
    from gtb_cli.distances.operands import Operand
    from gtb_cli.meshes.mesh import Mesh


@dataclass(frozen=True)
class Comparing:
    """How files are compared: the arguments of `gtb_cli.diff`."""

    recipe: Recipe = field(default_factory=Recipe)
    tolerance: float | str | None = None
    kind: Comparison = "auto"
    ignore: Aspect | Collection[Aspect] = ()
    reading: Reading = AS_SEEN

    def files(self, first: str, second: str) -> Verdict:
        """Compare two files, or standard input with a file; raises `GtbError` if one of them cannot be read."""
        shown = shown_input(first), shown_input(second)
        verdict = Verdict(os.path.basename(shown[1]), shown, "same")
        if _are_equal_meshes(first, second):
            return verdict
        from gtb_cli.distances.diff_and_distance import compared

        a, b = self.read(first), self.read(second)
        found = compared(a, b, self.tolerance, self.kind, self.ignore)
        formats = [each.known.format.upper() for each in (a, b) if each.spec is None]
        if suffix_of(first) == suffix_of(second) != "" and len({*formats}) > 1:  # other programs go by the name
            found = replace(found, values=(*found.values, f"format: {' against '.join(formats)}"))
        verdict = replace(verdict, found=found, warnings=found.limits)
        if found.same:
            return verdict
        return replace(verdict, word="different", meshes=(_mesh_of(lambda: a), _mesh_of(lambda: b)))

    def each(self, a: str, b: str) -> Iterator[Verdict]:
        """Compare all files of two folders that have the same name, sorted by name; or two files."""
        if not os.path.isdir(a) or not os.path.isdir(b):
            shown = shown_input(a), shown_input(b)
            are_records = {os.path.basename(a), os.path.basename(b)} == {SEQUENCE_RECORD}
            compare = partial(self._pair, a, b, True) if are_records else partial(self.files, a, b)
            yield self._attempted(os.path.basename(shown[1]), shown, compare)
            return
        matched, unreadable = pairs(a, b)
        has_meshes = any(suffix_of(path) in FORMATS for pair in matched.values() for path in pair if path)
        same_as = _renamed(matched)
        for name in sorted({*unreadable, *matched}):
            first, second = matched.get(name, (None, None))
            paths = first or os.path.join(a, name), second or os.path.join(b, name)
            if name in unreadable:
                yield Verdict(name, paths, "unreadable", errors=tuple(GtbError(unreadable[name]).faults))
            elif first is None or second is None:
                yield Verdict(name, paths, "extra" if first is None else "missing", renamed=same_as.get(name, ""))
            else:
                yield self._attempted(name, paths, partial(self._pair, *paths, has_meshes))

    def _attempted(self, name: str, paths: tuple[str, str], compare: Callable[[], Verdict]) -> Verdict:
        """Return the verdict on two files, also that they cannot be compared."""
        try:
            return replace(compare(), name=name)
        except (GtbError, OSError) as error:
            return Verdict(name, paths, "unreadable", errors=tuple(faults_about(error)))
        except Exception as error:  # noqa: BLE001 -- others are still compared, also where scipy is missing
            reason = f"{paths[0]} and {paths[1]}: cannot be compared: {faults_about(error)[0].message}"
            return Verdict(name, paths, "unreadable", errors=(Fault(reason),))

    def _pair(self, first: str, second: str, has_meshes: bool) -> Verdict:
        for path in (first, second):
            if os.path.exists(path) and not os.path.isfile(path):  # reading a pipe would wait for its writer
                raise GtbError(f"{path}: is not a file")
        suffixes = {suffix_of(first), suffix_of(second)}
        specs_count = not has_meshes or len(suffixes) > 1
        is_read = suffixes <= FORMATS.keys() or (suffixes <= {*SPEC_FORMATS, *FORMATS} and specs_count)
        if is_read and not _are_equal_texts(first, second):  # some may be read only by what includes or uses them
            return self.files(first, second)
        is_equal = _are_equal(first, second)
        is_rounded = not is_equal and os.path.basename(first) == SEQUENCE_RECORD and _are_alike(first, second)
        return Verdict("", (first, second), "same" if is_equal or is_rounded else "different", is_rounded=is_rounded)

    def shown(self, verdict: Verdict) -> Verdict:
        """Return a verdict with the meshes that there are of a file, if it could not be compared."""
        if verdict.word == "different":
            return verdict
        one, other = (
            _mesh_of(partial(self.read, path)) if suffix_of(path) in FORMATS and os.path.isfile(path) else None
            for path in verdict.paths  # a pipe would wait for its writer
        )
        return replace(verdict, meshes=(one, other))

    def read(self, path: str) -> Operand:
        """Read a mesh file, or a spec, which becomes a mesh where one is needed."""
        from gtb_cli.distances.operands import decoded

        return decoded(mesh_or_spec(path), shown_input(path), self.recipe, self.reading)


def _mesh_of(read: Callable[[], Operand]) -> Mesh | None:
    """Return the mesh of what is read; None where that fails, or a spec has too many patches for one."""
    with suppress(Exception):
        return read().known.mesh
    return None


def _are_alike(first: str, second: str) -> bool:
    """Tell whether two files of JSON hold the same but for last digits, which other processors find otherwise."""
    from gtb_cli.formats.meshfiles import read_mesh
    from gtb_cli.language.document import MAX_BYTES

    def near(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        """To six digits where distances are concerned, which are known to less, others to twelve."""
        for k, (key, value) in enumerate(pairs):
            if isinstance(value, float):
                is_far = key.startswith("distance")
                rounded = 0.0 if is_far and abs(value) <= none else float(f"{value:.{6 if is_far else 12}g}")
                pairs[k] = key, int(rounded) if rounded.is_integer() else rounded  # JavaScript writes 5 for 5.0
        if len(dict(pairs)) < len(pairs):
            raise ValueError("a key is there twice")
        return dict(pairs)

    none = 0.0  # the largest distance that is rounding
    with suppress(ValueError, RecursionError):
        texts = [read_file(path, MAX_BYTES) for path in (first, second)]
        with suppress(GtbError, LookupError, TypeError):  # a sequence without files of meshes
            mesh = os.path.join(os.path.dirname(first), os.path.basename(json.loads(texts[0])["meshes"][-1]["file"]))
            none = 1e-14 * float(abs(read_mesh(mesh).bounds).max()) if os.path.isfile(mesh) else none
        one, other = (json.dumps(json.loads(text, object_pairs_hook=near), sort_keys=True) for text in texts)
        return one == other  # as texts: True is 1
    return False


def _renamed(matched: Mapping[str, tuple[str | None, str | None]]) -> dict[str, str]:
    """By the names of files that only one folder has, those of files with equal bytes that only the other has."""
    lone = [(name, path, k) for name, pair in matched.items() for k, path in enumerate(pair) if path and None in pair]
    alike: dict[tuple[str, bytes], tuple[list[str], list[str]]] = defaultdict(lambda: ([], []))
    for name, path, k in lone if len({k for *_, k in lone}) == 2 else ():
        if os.path.isfile(path):
            with suppress(OSError):
                alike[suffix_of(name), sha256_of(path)][k].append(name)
    found = [pair for names in alike.values() for pair in zip(*names, strict=False)]
    return dict([*found, *((new, old) for old, new in found)])


def mesh_or_spec(path: str) -> bytes:
    """Read a mesh file, or a spec, or standard input; at most one byte more than it may have."""
    from gtb_cli.distances.operands import read_content
    from gtb_cli.formats.meshfiles import MAX_FILE_BYTES, MAX_STREAM_BYTES

    with opened(path) as file:
        most = MAX_FILE_BYTES if is_regular(file) else MAX_STREAM_BYTES
        data = read_content(file, path, most)
    if len(data) > most == MAX_STREAM_BYTES:
        raise GtbError(f"{shown_input(path)}: does not end within {most >> 20} MB; more is read only from files")
    return data


def _are_equal_texts(first: str, second: str) -> bool:
    """Tell whether two files with suffixes of specs have equal bytes, which name no other file."""
    if not {suffix_of(first), suffix_of(second)} <= {*SPEC_FORMATS} or not _are_equal(first, second):
        return False
    return not re.search(rb"include|\\", read_file(first, os.path.getsize(first)))


def _are_equal(first: str, second: str) -> bool:
    """Tell whether two files have equal bytes; those of /proc, some of which never end, count as empty."""
    return os.path.getsize(first) == os.path.getsize(second) == 0 or filecmp.cmp(first, second, shallow=False)


def _are_equal_meshes(first: str, second: str) -> bool:
    """Tell whether two files have equal bytes and are meshes; specs with equal bytes may include other files."""
    from gtb_cli.formats.meshfiles import format_of, size_limit

    if suffix_of(first) in SPEC_FORMATS or not os.path.isfile(first) or not os.path.isfile(second):
        return False
    with opened(first) as file:
        start = file.read(1 << 16)
    is_mesh = format_of(start) is not None or size_limit(start, 0) == os.path.getsize(first)  # binary STL
    if not is_mesh or not filecmp.cmp(first, second, shallow=False):
        return False
    with opened(first) as file:  # in another folder there may be other materials and pictures
        names = re.compile(rb'mtllib|maplib|_obj|(?i:texturefile)|"uri"|\\u00')
        return os.path.dirname(first) == os.path.dirname(second) or not any(map(names.search, file))
