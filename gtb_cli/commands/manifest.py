"""What was written: sums, sizes and measures of mesh files, and what they were made with."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gtb_cli import __version__

if TYPE_CHECKING:
    from gtb_cli.meshes.measures import Measures

PACKAGES = ("numpy", "trimesh")
"""Packages whose versions may change bytes."""


@dataclass
class Entry:
    """A mesh file that is written.

    Attributes
    ----------
    file : str
        Its name.
    settings : mapping
        What is particular to it among the options.
    measures : Measures
        Of the mesh, before numbers are rounded to what the format holds.
    """

    file: str
    settings: Mapping[str, object]
    measures: Measures
    _bytes: int = 0
    _sum: Any = field(default_factory=hashlib.sha256)

    def over(self, blocks: Iterable[bytes]) -> Iterator[bytes]:
        """Yield the blocks of the file, and note what passes."""
        for block in blocks:
            self._bytes += len(block)
            self._sum.update(block)
            yield block

    def record(self) -> dict[str, object]:
        """Plain data, once all blocks have passed."""
        passed = {"file": self.file, "sha256": self._sum.hexdigest(), "bytes": self._bytes}
        return {**passed, **self.settings, **self.measures.record()}


def manifest_text(options: Mapping[str, object], entries: Sequence[Entry]) -> str:
    """JSON of files, with the options and versions that they were made with; no time and no place."""
    record = {
        "versions": versions(PACKAGES),
        "options": options,
        "files": [entry.record() for entry in entries],
    }
    return json.dumps(record, indent=2, allow_nan=False) + "\n"


def versions(packages: Iterable[str]) -> dict[str, str | None]:
    """Versions of this program and of installed packages, which are not imported for that; None: not there."""
    from importlib.metadata import PackageNotFoundError, version

    found: dict[str, str | None] = {"gtb": __version__}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = None
    return found
