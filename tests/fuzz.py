"""`python -m tests.fuzz`: many mutated specs through the command, and many commands killed while they write.

Prints what it did; exits 1 at the first thing that should not be, with how to have it again.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from gtb_cli.shell.sequences import RECORD
from tests.mutations import mutation
from tests.shell import SPECS, command, environment, gtb

SECONDS = 1.0
"""Longest that a spec may take, in processor time."""

MEGABYTES = 200
"""Memory that all specs together may need beyond what the program needs before the first."""


def judge(text: bytes, suffix: str, folder: Path) -> str | None:
    """Mesh one spec; say what is wrong with how that went."""
    spec, target = folder / f"spec{suffix}", folder / "out.obj"
    spec.write_bytes(text)
    start = time.process_time()
    result = gtb("mesh", spec, "-n", "2", "-o", target)
    seconds = time.process_time() - start
    made = target.exists()
    target.unlink(missing_ok=True)
    left = [name for name in os.listdir(folder) if name.startswith(".gtb-")]
    if "Traceback" in result.err or "internal error" in result.err:
        return f"not a message: {result.err}"
    if result.status not in (0, 2):
        return f"status {result.status}"
    if made != (result.status == 0) or left:
        return f"status {result.status}, file there: {made}, left over: {left}"
    if result.status == 2 and not result.err.startswith("gtb: error: "):
        return f"no message: {result.err!r}"
    return f"{seconds:.2f} s" if seconds > SECONDS else None


def mutate(count: int, seed: int) -> str | None:
    """Judge mutated specs; the first complaint."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        judge((SPECS / "pentagon.toml").read_bytes(), ".toml", folder)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        for number in range(count):
            text, suffix = mutation(random.Random(f"{seed}-{number}"))
            complaint = judge(text, suffix, folder)
            if complaint:
                return f"spec {number} of seed {seed}: {complaint}\n{text[:2000]!r}"
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
        if grown > MEGABYTES:
            return f"memory grew by {grown:.0f} MB"
    print(f"{count} mutated specs: no traceback, no partial file, none over {SECONDS:g} s, {grown:.0f} MB more")
    return None


MESH = ("mesh", SPECS / "pentagon.toml", "-n", 150)
DEGENERATE = ("degenerate", SPECS / "example-3.4.toml", "-n", 2000)
KNOT_LIMIT = ("knot-limit", SPECS / "example-3.1.toml", "--merge", "1:2", "-n", 2000)

VICTIMS: dict[str, tuple[tuple[object, ...], tuple[object, ...]]] = {
    **{f"mesh.{kind}": (MESH, (*MESH[:-1], 120)) for kind in ("obj", "ply", "stl", "glb")},
    "degenerate": ((*DEGENERATE, "-x5", "-x100"), (*DEGENERATE, "-x7", "-x100")),
    "knot-limit": ((*KNOT_LIMIT, "--steps", "0.5,0.9"), (*KNOT_LIMIT, "--steps", "0,0.9", "--normals")),
}
"""By what they write: the command that is killed, and that which made what was there before."""


def content(place: Path) -> dict[str, bytes]:
    """Everything that is to be seen of an output."""
    if place.is_file():
        return {"": place.read_bytes()}
    return {path.name: path.read_bytes() for path in place.glob("[!.]*")}


def hidden(place: Path) -> list[Path]:
    """What a killed process could not remove, beside a file or in a folder."""
    return [*place.parent.glob(".gtb-*"), *place.glob(".gtb-*")]


def started(arguments: tuple[object, ...], place: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(command(*arguments, "-q", "-o", place), env=environment())


def wait_for_hidden(process: subprocess.Popen[bytes], place: Path) -> None:
    while process.poll() is None and not hidden(place):
        time.sleep(0.0005)


def kill(trials: int, seed: int, victims: Iterable[str] = tuple(VICTIMS)) -> str | None:
    """Kill processes at random times, half of them while they write: what is there then is old or new, and whole.

    Every second trial has nothing there before; after every tenth the command runs to its end among what was left.
    """
    rng = random.Random(seed)
    for name in victims:
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder) / name
            new, old = VICTIMS[name]
            started(old, place).wait()
            before = content(place)
            remove(place)
            start = time.perf_counter()
            process = started(new, place)
            wait_for_hidden(process, place)
            middle = time.perf_counter()
            failed = process.wait()
            end = time.perf_counter()
            whole = content(place)
            if failed or not before or whole == before:
                return f"{name}: not as it should be without a kill"
            counts = Counter()
            for trial in range(trials):
                remove(place)
                there = before if trial % 2 else {}
                restore(place, there)
                process = started(new, place)
                if trial % 4 < 2:
                    time.sleep(rng.uniform(0.2, 1.1) * (end - start))
                else:
                    wait_for_hidden(process, place)
                    time.sleep(rng.uniform(0, 1.1) * (end - middle))
                process.send_signal(signal.SIGKILL)
                process.wait()
                found = content(place)
                state = state_of(found, there, there | whole)
                if state is None:
                    sizes = {key: len(value) for key, value in found.items()}
                    return f"{name}: torn in trial {trial} of seed {seed}: {sizes}"
                counts[state] += 1
                counts["rests"] += bool(hidden(place))
                if trial % 10 == 9 and (started(new, place).wait() or content(place) != there | whole):
                    return f"{name}: trial {trial} of seed {seed}: the next run failed"
                for rest in hidden(place):
                    remove(rest)
        print(
            f"{name}: {trials} processes killed: the old was there {counts['old']} times, the new {counts['new']}, "
            f"files without a record {counts['unfinished']}; .gtb-* was left {counts['rests']} times",
            flush=True,
        )
    return None


def state_of(found: dict[str, bytes], old: dict[str, bytes], new: dict[str, bytes]) -> str | None:
    """What a killed process left, or None where it is torn: files of two times, and a record that says otherwise."""
    if found == old:
        return "old"
    if found == new:
        return "new"
    mixture = set(found.items()) <= {*old.items(), *new.items()}
    return "unfinished" if mixture and RECORD in new and RECORD not in found else None


def remove(place: Path) -> None:
    if place.is_dir():
        shutil.rmtree(place)
    else:
        place.unlink(missing_ok=True)


def restore(place: Path, files: dict[str, bytes]) -> None:
    """Make an output what it was, as `content` told."""
    for name, data in files.items():
        if name:
            place.mkdir(exist_ok=True)
        (place / name if name else place).write_bytes(data)


def main() -> None:
    """Run both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--specs", type=int, default=20_000)
    parser.add_argument("--kills", type=int, default=200, help="for each format, and each kind of sequence")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    complaint = mutate(options.specs, options.seed) or kill(options.kills, options.seed)
    if complaint:
        sys.exit(complaint)


if __name__ == "__main__":
    main()
