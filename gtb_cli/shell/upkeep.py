"""Files that a manifest shows to be up to date, and dependencies for make."""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from typing import Any

from gtb_cli.errors import ExportError


def input_sums(path: str, spec_format: str | None) -> dict[str, str]:
    """Return checksums of the files of a spec, by path relative to its folder; none if one cannot be read."""
    from gtb_cli.language.includes import sources

    start = len(path) - len(os.path.basename(path))
    files = sources(path, spec_format)  # type: ignore[arg-type]
    sums = {file[start:].replace(os.sep, "/"): sum_of(file) for file in files}
    return {name: found for name, found in sums.items() if found is not None} if all(sums.values()) else {}


def known_entries(manifest: str, versions: Mapping[str, object], options: Mapping[str, object]) -> dict[str, Any]:
    """Read the entries of an old manifest by file name; just the checksum where other versions or options made one."""
    try:
        with open(manifest, "rb") as file:
            record = json.load(file)
        is_like = record["versions"] == versions and record["options"] == json.loads(json.dumps(options))
        known: dict[str, Any] = {}
        for entry in [*record["files"], *record.get("earlier", ())]:
            match entry:
                case {"file": str(name), "sha256": str(found)}:
                    known[name] = entry if is_like and "versions" not in entry else {"sha256": found}
        return known
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return {}  # a manifest that cannot be read shows nothing


def is_up_to_date(entry: Mapping[str, Any], spec: str, output: str) -> bool:
    """Tell whether a file, and the files that it was made from, are what its entry says."""
    match entry:
        case {"vertices": int(), "warnings": [*warnings], "inputs": dict(inputs), "faces": int()} | {
            "vertices": int(),
            "warnings": [*warnings],
            "inputs": dict(inputs),
            "segments": int(),
        } if all(isinstance(warning, str) for warning in warnings):
            folder = os.path.dirname(spec) or os.curdir
            sums = (sum_of(os.path.join(folder, name)) == found for name, found in inputs.items())
            is_its_own = next(iter(inputs), None) == os.path.basename(spec)
            return is_its_own and sum_of(output) == entry["sha256"] and all(sums)
    return False


def sum_of(path: str) -> str | None:
    """Return the sha256 of a regular file, or None if there is no such file."""
    read_bytes = 1 << 20  # bytes read at a time
    if not os.path.isfile(path):
        return None
    found = hashlib.sha256()
    try:
        with open(path, "rb") as file:
            while block := file.read(read_bytes):
                found.update(block)
    except OSError:
        return None
    return found.hexdigest()


def rules(targets: Iterable[tuple[str, str]], spec_format: str | None) -> str:
    """Write rules for make: each output depends on its spec and the included files, which have rules of their own.

    A rule without prerequisites and recipe lets make go on after an included file has been deleted.
    """
    from gtb_cli.language.includes import sources

    text, included = "", dict[str, None]()
    for output, spec in targets:
        files = sources(spec, spec_format)  # type: ignore[arg-type]
        included |= dict.fromkeys(files[1:])
        text += f"{_target(output)}: {' '.join(map(_escaped, files))}\n"
    return text + "".join(f"{_target(name)}:\n" for name in included)


def _target(name: str) -> str:
    """Name a target as make reads it: not as a pattern."""
    return _escaped(name).replace("%", "\\%")


def _escaped(name: str) -> str:
    """Name a file as make reads it, or refuse a name that make would take for something else, such as a recipe."""
    # Characters that mean something to make, and that a backslash does not quote everywhere
    make_signs = frozenset(";:=|*?[~")
    if not name.isprintable() or not make_signs.isdisjoint(name):
        raise ExportError(
            f"--deps: make cannot name {name!r}: expected no control characters, and none of ; : = | * ? [ ~"
        )
    kept = name.replace("\\", "\\\\") if any(c in name for c in " #") else name
    for mark in " #":
        kept = kept.replace(mark, f"\\{mark}")
    return kept.replace("$", "$$")
