"""`python -m tests.tools.readers`: let other programs and libraries read every kind of file, and print tables.

They are installed below `build/readers` (from PyPI and npm, about 5 GB) or found on the PATH. The exit status is 1 if a
reader finds something else than a file contains, unless `roster` says so.
"""

import json
import os
import shutil
import subprocess
import sys
import venv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.shell import REPOSITORY
from tests.tools.readers.kinds import KINDS, Different, Kind, agreement
from tests.tools.readers.roster import LIBRARIES, PROGRAMS, WEB, Reader

BUILD = REPOSITORY / "build" / "readers"


class Missing(Exception):
    """A reader cannot be had."""


def installed(reader: Reader) -> tuple[list[str], Path]:
    """Install a reader; return the command that makes it read, and the folder to run it in.

    Each library has an environment of its own, for what one needs may be what another refuses.
    """
    here = Path(__file__).parent
    if reader in PROGRAMS:
        if shutil.which(reader.source) is None:
            raise Missing(f"there is no {reader.source} on the PATH")
        return [sys.executable, "-m", "tests.tools.readers.programs", reader.key], REPOSITORY
    if reader in WEB:
        folder = BUILD / "npm"
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / "node_modules" / reader.source).exists():
            _install(["npm", "install", "--no-audit", "--no-fund", "--prefix", str(folder), reader.source])
        return ["node", str(here / "node.mjs"), reader.key], folder
    packages = reader.source.split()
    folder = BUILD / reader.key
    python = str(folder / "bin" / "python")
    stamp = folder / "installed.txt"
    if not stamp.exists() or stamp.read_text() != reader.source:
        venv.create(folder, clear=True)
        _install([sys.executable, "-m", "pip", "--python", python, "install", "--only-binary", ":all:", *packages])
        stamp.write_text(reader.source)
    return [python, str(here / "libraries.py"), reader.key, packages[0]], REPOSITORY


def _install(command: list[str]) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise Missing(f"there is no {command[0]} on the PATH") from None
    if done.returncode:
        errors = [line for line in done.stderr.splitlines() if "error" in line.lower()]
        raise Missing(errors[-1] if errors else f"{command[0]}: status {done.returncode}")


def readings(reader: Reader, kinds: Sequence[Kind], files: Path) -> dict[str, dict[str, Any]]:
    """Let a reader read files in a process of its own, and in another one from where it crashes.

    What crashes it may be the file before, so that the one at which it does is tried again, as the first.
    """
    seconds = 180  # a reader that takes longer hangs; none takes 20 for all files
    # What a library says that lacks one of the system's
    not_loaded = ("ImportError", "ModuleNotFoundError", "cannot open shared object file")
    command, folder = installed(reader)
    results = BUILD / "results" / reader.key
    shutil.rmtree(results, ignore_errors=True)
    results.mkdir(parents=True)
    found: dict[str, dict[str, Any]] = {}
    left = list(kinds)
    while left:
        first = left[0]
        paths = [str(files / kind.file) for kind in left]
        try:
            done = subprocess.run(
                [*command, str(results), *paths],
                cwd=folder,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=seconds,
                check=False,
            )
            lines = done.stderr.splitlines() or [""]
            reason = f"crashes, status {done.returncode}: {lines[-1]}"
        except subprocess.TimeoutExpired:
            reason = "hangs"
        while left and (result := results / f"{left[0].file}.json").exists():
            found[left.pop(0).name] = json.loads(result.read_text(encoding="utf-8"))
        if left and left[0] is first:
            found[left.pop(0).name] = {"error": reason}
    errors = {result.get("error", "") for result in found.values()}
    if all(any(sign in error for sign in not_loaded) for error in errors):
        raise Missing(min(errors))
    return found


def main() -> int:
    """Print a table for each format."""
    enough = 5  # readers that each kind of file should have
    files = BUILD / "files"
    files.mkdir(parents=True, exist_ok=True)
    for kind in KINDS:
        (files / kind.file).write_bytes(kind.encoded())
    cells: dict[tuple[str, str], str] = {}
    versions: dict[str, str] = {}
    notes: list[str] = []
    bad = 0
    for reader in (*LIBRARIES, *PROGRAMS, *WEB):
        kinds = [kind for kind in KINDS if kind.format in reader.formats.split()]
        print(f"{reader.name} ...", file=sys.stderr, flush=True)
        try:
            found = readings(reader, kinds, files)
        except Missing as error:
            notes.append(f"{reader.name} is not installed: {error}")
            continue
        versions[reader.name] = max(result.get("version", "") for result in found.values())
        for kind in kinds:
            limit = reader.limits.get(kind.name)
            try:
                if "error" in found[kind.name]:
                    raise Different(found[kind.name]["error"])
                cells[reader.name, kind.name] = ": ".join(
                    filter(None, ["yes", ", ".join(agreement(kind, found[kind.name], reader.tolerance))])
                )
                if limit:
                    notes.append(f"{reader.name} now reads {kind.name}, which it is not known to: {limit}")
            except Different as error:
                cells[reader.name, kind.name] = f"no: {limit or 'WRONG'}"
                if not limit:
                    bad += 1
                    notes.append(f"{reader.name}: {kind.name}: {' '.join(str(error).split())[:300]}")
    _print_summary(cells, versions)
    for kind in KINDS:
        count = sum(cells.get((name, kind.name), "").startswith("yes") for name in versions)
        if count < enough:
            notes.append(f"{kind.name} has {count} readers")
    print("\n".join(notes))
    return 1 if bad else 0


def _print_summary(cells: dict[tuple[str, str], str], versions: dict[str, str]) -> None:
    """Print the table of the README beside this: what each reader keeps of each format, and what it passes over."""
    formats = list(dict.fromkeys(kind.format for kind in KINDS))
    print("| |", " | ".join(format.upper() for format in formats), "|")
    print("|---|" + "---|" * len(formats))
    for name, version in versions.items():
        row = []
        for format in formats:
            kept: dict[str, None] = {}
            refused: dict[str, list[str]] = {}
            for kind in KINDS:
                answer, _, details = (
                    cells.get((name, kind.name), "").partition(": ") if kind.format == format else ("",) * 3
                )
                if answer == "yes":
                    kept |= dict.fromkeys(detail.split()[-1] for detail in details.split(", ") if detail)
                elif answer:
                    refused.setdefault(details, []).append(kind.name.partition(" ")[2] or "plain")
            known = any((name, kind.name) in cells for kind in KINDS if kind.format == format)
            parts = ["yes" + (f": {', '.join(kept)}" if kept else "")] if known else []
            row.append("; ".join(parts + [f"not {', '.join(kinds)}: {reason}" for reason, kinds in refused.items()]))
        print(f"| {name} {version}".rstrip(), "|", " | ".join(row), "|")
    print()


if __name__ == "__main__":
    os.environ.pop("PYTHONPATH", None)
    sys.exit(main())
