"""`--manifest` and `--resume`: mesh files as records of what made them."""

import hashlib
import json
import math
import os
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any

import click

from gtb_cli.errors import ExportError
from gtb_cli.process.versions import versions
from gtb_cli.shell.messages import STANDARD
from gtb_cli.shell.streams import is_device, write_blocks
from gtb_cli.vocabulary import SCHEMA, SpecFormat


class Manifest:
    """The manifest of meshes that are being made, for a path (``"-"``: standard output).

    `settings` are the options that all files share, as plain data, and `output` is their file or folder. With `resume`,
    an old manifest of this name may show that files are up to date.
    """

    def __init__(self, path: str, settings: Mapping[str, object], output: str, *, resume: bool = False) -> None:
        if path == output == STANDARD:
            raise click.UsageError("--manifest -: meshes already go to standard output; send them elsewhere with -o")
        self.path = path
        self.is_direct = path == STANDARD or is_device(path)
        self._settings = settings
        self._entries: dict[str, Mapping[str, Any] | None] = {}
        self._known = _known_entries(path, settings) if resume else {}
        self._written = -math.inf
        self._folder = os.curdir if self.is_direct else os.path.dirname(path) or os.curdir
        # Checked before the work, not after it; the folder of the meshes is made if missing.
        if not os.path.isdir(self._folder) and os.path.abspath(self._folder) != os.path.abspath(output):
            raise ExportError(f"cannot write {path}: the folder {self._folder} does not exist")

    def kept(self, output: str, spec: str) -> Mapping[str, Any] | None:
        """Record a file with its old entry and return this; None if the file has to be made again."""
        name = self._name(output)
        entry: Mapping[str, Any] | None = self._known.get(name)
        if entry is None or not _is_up_to_date(entry, spec, output):
            return None
        self._entries[name] = entry
        return entry

    def expect(self, outputs: Iterable[str]) -> None:
        """List files in this order, once they are recorded."""
        self._entries = {name: self._entries.get(name) for name in map(self._name, outputs)}

    def recorded(self, output: str, facts: Mapping[str, object], blocks: Iterable[bytes]) -> Iterator[bytes]:
        """Yield the blocks of a file; once all have passed, record it with its size, checksum and `facts`."""
        size, digest = 0, hashlib.sha256()
        for block in blocks:
            size += len(block)
            digest.update(block)
            yield block
        name = self._name(output)
        entry = {"file": name, "sha256": digest.hexdigest(), "bytes": size, **facts}
        if entry.get("versions") == versions():  # unless another machine made it
            del entry["versions"]
        self._entries[name] = entry

    def write(self) -> None:
        """Write the manifest as it is now."""
        write_blocks(self.path, self.blocks())
        self._written = time.monotonic()

    def write_one(self, output: str, blocks: Iterable[bytes]) -> None:
        """Write a file, which appears at once, and now and then the manifest."""
        from gtb_cli.files import StagedFiles

        with StagedFiles(os.path.dirname(output)) as files:
            files.add(output, blocks)
        if time.monotonic() - self._written > 2.0:  # seconds: the text of a long manifest takes longer than a mesh
            self.write()

    def blocks(self) -> list[bytes]:
        """Return the bytes of the manifest as it is now."""
        record = {
            "schema": SCHEMA,
            "versions": versions(),
            "options": self._settings,
            "files": [entry for entry in self._entries.values() if entry is not None],
        }
        return [f"{json.dumps(record, indent=2, allow_nan=False)}\n".encode()]

    def _name(self, output: str) -> str:
        """Name a file relative to the manifest's folder, or without a folder: no path of this machine."""
        if output == STANDARD:
            return output
        folder = os.path.realpath(os.path.dirname(output) or os.curdir)
        name = os.path.relpath(os.path.join(folder, os.path.basename(output)), os.path.realpath(self._folder))
        if name.split(os.sep, 1)[0] == os.pardir or os.path.isabs(name):
            name = os.path.basename(output)
        return name.replace(os.sep, "/")


def input_sums(path: str, spec_format: SpecFormat | None) -> dict[str, str]:
    """Return checksums of the files of a spec, by path relative to its folder; none if one cannot be read."""
    from gtb_cli.language.includes import sources

    start = len(path) - len(os.path.basename(path))
    sums = {file[start:].replace(os.sep, "/"): _sum_of(file) for file in sources(path, spec_format)}
    return {name: found for name, found in sums.items() if found is not None} if all(sums.values()) else {}


def _known_entries(manifest: str, options: Mapping[str, object]) -> dict[str, Any]:
    """Read the entries of an old manifest by file name; just the checksum where other versions or options made one."""
    with suppress(OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        with open(manifest, "rb") as file:
            record = json.load(file)
        is_like = record["versions"] == versions() and record["options"] == json.loads(json.dumps(options))
        known: dict[str, Any] = {}
        for entry in record["files"]:
            match entry:
                case {"file": str(name), "sha256": str(found)}:
                    known[name] = entry if is_like and "versions" not in entry else {"sha256": found}
        return known
    return {}  # a manifest that cannot be read shows nothing


def _is_up_to_date(entry: Mapping[str, Any], spec: str, output: str) -> bool:
    """Tell whether a file, and the files that it was made from, are what its entry says."""
    counts = (entry.get("vertices"), entry.get("faces", entry.get("segments")))
    match entry:
        case {"warnings": [*texts], "inputs": dict(inputs)} if all(isinstance(text, str) for text in texts):
            folder = os.path.dirname(spec) or os.curdir
            sums = (_sum_of(os.path.join(folder, name)) == found for name, found in inputs.items())
            is_its_own = next(iter(inputs), None) == os.path.basename(spec) and _sum_of(output) == entry["sha256"]
            return is_its_own and all(isinstance(count, int) for count in counts) and all(sums)
    return False


def _sum_of(path: str) -> str | None:
    """Return the sha256 of a regular file, or None if there is no such file."""
    from gtb_cli.files import sha256_of

    with suppress(OSError):
        return sha256_of(path).hex() if os.path.isfile(path) else None
    return None
