"""`--manifest`: a file with checksums, sizes and measures of mesh files, and the options that made them."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Any

import click

from gtb_cli.errors import ExportError
from gtb_cli.shell.console import STANDARD
from gtb_cli.shell.streams import is_device, write_blocks, write_text
from gtb_cli.shell.upkeep import is_up_to_date, known_entries
from gtb_cli.version import __version__

if TYPE_CHECKING:
    from gtb_cli.files import StagedFiles
    from gtb_cli.meshes.measures import Measures

PACKAGES = ("numpy", "trimesh")  # packages whose versions may change bytes


@dataclass
class Entry:
    """A mesh file in the manifest.

    Attributes
    ----------
    file : str
        Its name.
    settings : mapping
        The options that differ from file to file.
    measures : Measures
        Measures of the mesh, before numbers are rounded to what the format holds.
    inputs : mapping
        Checksums of the files that it is made from, by path relative to the spec's folder.
    warnings : list of str
    """

    file: str
    settings: Mapping[str, object]
    measures: Measures
    inputs: Mapping[str, str]
    warnings: list[str]
    _bytes: int = 0
    _sum: Any = field(default_factory=hashlib.sha256)

    def over(self, blocks: Iterable[bytes]) -> Iterator[bytes]:
        """Yield the blocks of the file, and update its size and checksum."""
        for block in blocks:
            self._bytes += len(block)
            self._sum.update(block)
            yield block

    def record(self) -> dict[str, object]:
        """Return the entry as plain data, once all blocks have passed."""
        passed = {"file": self.file, "sha256": self._sum.hexdigest(), "bytes": self._bytes}
        made = {"inputs": self.inputs, "warnings": self.warnings}
        return {**passed, **self.settings, **self.measures.record(), **made}


class Manifest:
    """A manifest that is being made.

    Parameters
    ----------
    path : str
        Where the manifest goes; ``"-"`` is standard output.
    settings : mapping
        The options that all files share, as plain data.
    output : str
        The file or folder of the meshes.
    resume : bool
        Whether an old manifest of this name may show that files are up to date.
    """

    def __init__(self, path: str, settings: Mapping[str, object], output: str, *, resume: bool = False) -> None:
        if path == output == STANDARD:
            raise click.UsageError("--manifest -: meshes already go to standard output; send them elsewhere with -o")
        self.path = path
        self._settings = settings
        self._is_direct = path == STANDARD or is_device(path)
        self._entries: dict[str, Entry | Mapping[str, Any]] = {}
        self._known = known_entries(path, versions(PACKAGES), settings) if resume else {}
        folder = os.path.dirname(path) or os.curdir
        self._folder = os.curdir if self._is_direct else folder
        # Checked before the work, not after it; the folder of the meshes is made if missing.
        if not self._is_direct and not os.path.isdir(folder) and os.path.abspath(folder) != os.path.abspath(output):
            raise ExportError(f"cannot write {path}: the folder {folder} does not exist")

    def recorded(self, output: str, entry: Callable[[str], Entry], blocks: Iterable[bytes]) -> Iterator[bytes]:
        """Yield the blocks of a file; once all have passed, record the entry that `entry` makes from its name."""
        name = self._name(output)
        made = entry(name)
        yield from made.over(blocks)
        self._entries[name] = made

    def kept(self, output: str, spec: str) -> Mapping[str, Any] | None:
        """Record a file with its old entry and return this; None if the file has to be made again."""
        name = self._name(output)
        entry: Mapping[str, Any] | None = self._known.get(name)
        if entry is None or not is_up_to_date(entry, spec, output):
            return None
        self._entries[name] = entry
        return entry

    def sort(self, outputs: Iterable[str]) -> None:
        """Sort the recorded files into the order of `outputs`."""
        order = {self._name(output): place for place, output in enumerate(outputs)}
        self._entries = dict(sorted(self._entries.items(), key=lambda item: order.get(item[0], len(order))))

    def replace(self) -> None:
        """Write the manifest as it is now."""
        write_text(self.path, self._text())

    def write_with(self, output: str, blocks: Iterable[bytes]) -> None:
        """Write a single mesh, which is already recorded, and the manifest."""
        if self._is_direct or output == STANDARD or is_device(output):
            write_blocks(output, blocks)
            write_text(self.path, self._text())
            return
        from gtb_cli.files import StagedFiles

        with StagedFiles(os.curdir) as files:
            files.add_path(output, blocks)
            self.stage(files)

    def stage(self, files: StagedFiles) -> None:
        """Add the manifest to files that appear together."""
        if not self._is_direct:
            files.add_path(self.path, [self._text().encode("utf-8")])

    def finish(self) -> None:
        """Write the manifest after its files, if it could not be staged with them."""
        if self._is_direct:
            write_text(self.path, self._text())

    def _name(self, output: str) -> str:
        """Name a file relative to the manifest's folder, or without a folder: no path of this machine."""
        if output == STANDARD:
            return output
        folder = os.path.realpath(os.path.dirname(output) or os.curdir)
        name = os.path.relpath(os.path.join(folder, os.path.basename(output)), os.path.realpath(self._folder))
        if name.split(os.sep, 1)[0] == os.pardir or os.path.isabs(name):
            name = os.path.basename(output)
        return name.replace(os.sep, "/")

    def _text(self) -> str:
        record = {
            "versions": versions(PACKAGES),
            "options": self._settings,
            "files": [entry.record() if isinstance(entry, Entry) else entry for entry in self._entries.values()],
        }
        return json.dumps(record, indent=2, allow_nan=False) + "\n"


class OneByOne:
    """Files of a folder, each of which appears when it is made; the manifest is written now and then and at the end.

    Parameters
    ----------
    folder : str
    manifest : Manifest
    outputs : list of str
        All files to be made, in the order of the manifest.
    """

    def __init__(self, folder: str, manifest: Manifest, outputs: list[str]) -> None:
        self._folder = folder
        self._manifest = manifest
        self._outputs = outputs
        self._last = 0.0

    def __enter__(self) -> OneByOne:
        return self

    def add(self, name: str, blocks: Iterable[bytes]) -> None:
        """Write a file into the folder."""
        renewal_seconds = 2.0  # seconds between two versions of a growing manifest
        from gtb_cli.files import StagedFiles

        with StagedFiles(self._folder) as files:
            files.add(name, blocks)
        if time.monotonic() - self._last > renewal_seconds:
            self._replace()
            self._last = time.monotonic()

    def _replace(self) -> None:
        self._manifest.sort(self._outputs)
        self._manifest.replace()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if os.path.isdir(self._folder):  # otherwise nothing was made
            self._replace()


def versions(packages: Iterable[str]) -> dict[str, str | None]:
    """Return the versions of this program and of packages, without importing them; None: not installed."""
    from importlib.metadata import PackageNotFoundError, version

    found: dict[str, str | None] = {"gtb": __version__}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = None
    return found
