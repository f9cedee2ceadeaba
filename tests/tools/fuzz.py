"""`python -m tests.tools.fuzz`: mutated specs through the command, inputs made by rules, and killed processes.

Prints what it did; exits 1 at the first thing that should not be, with how to have it again.
"""

import argparse
import contextlib
import json
import os
import random
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from gtb_cli.errors import SpecError
from gtb_cli.filling.hole_files import SUFFIXES, loop_from_text
from gtb_cli.importers.readers import import_data
from gtb_cli.language.writer import dump
from gtb_cli.vocabulary import SEQUENCE_RECORD, suffix_of
from tests import foreign
from tests.shell import REPOSITORY, SPECS, command, environment, gtb
from tests.tools.generators import model, overwriting_line
from tests.tools.mutations import mutated, mutation

SECONDS = 1.0  # longest that a spec may take, in processor time
SECONDS_OF_KERNEL = 20.0  # Open CASCADE reads in a process of its own, which loads it


MEGABYTES = 200  # memory that all specs together may need beyond what the program needs before the first


def judge(spec: Path, options: Iterable[str], folder: Path, limit: float = SECONDS) -> tuple[str | None, int]:
    """Mesh one spec into a folder; return what is wrong with how that went, and the status."""
    start = time.process_time()
    result = gtb("mesh", spec, "-o", f"{folder}/", *options)
    seconds = time.process_time() - start
    made = os.listdir(folder) if folder.exists() else []
    remove(folder)
    required = "--require" in options
    complaint = None
    if "Traceback" in result.err or "internal error" in result.err or "Warning" in result.err:
        complaint = f"not a message: {result.err}"
    elif result.status not in (0, 2) and not required:
        complaint = f"status {result.status}"
    elif len(made) != (result.status == 0):
        complaint = f"status {result.status}, made {made}"
    elif result.status == 2 and not result.err.startswith("gtb: error: "):
        complaint = f"no message: {result.err!r}"
    elif seconds > limit:
        complaint = f"{seconds:.2f} s"
    return complaint, result.status


def mutate(count: int, seed: int) -> str | None:
    """Judge mutated specs; the first complaint."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "out"
        judge(SPECS / "pentagon.toml", ["-n", "2"], folder)
        before = memory()
        for number in range(count):
            text, suffix = mutation(random.Random(f"{seed}-{number}"))
            spec = Path(name) / f"spec{suffix}"
            spec.write_bytes(text)
            complaint, _ = judge(spec, ["-n", "2"], folder)
            if complaint:
                return f"spec {number} of seed {seed}: {complaint}\n{text[:2000]!r}"
        grown = memory() - before
        if grown > MEGABYTES:
            return f"memory grew by {grown:.0f} MB"
    print(f"{count} mutated specs: no traceback, no partial file, none over {SECONDS:g} s, {grown:.0f} MB more")
    return None


def models(count: int, seed: int) -> str | None:
    """Mesh models made by rules; the first complaint. A refusal is an answer, too: thickness has limits."""
    model_seconds = 5.0  # longest that a model of up to six patches may take, in processor time
    with tempfile.TemporaryDirectory() as name:
        spec = Path(name) / "model.json"
        statuses = Counter[int]()
        for number in range(count):
            text, options = model(random.Random(f"{seed}-{number}"))
            spec.write_bytes(text)
            complaint, status = judge(spec, options, Path(name) / "out", model_seconds)
            statuses[status] += 1
            if complaint:
                return f"model {number} of seed {seed}: {complaint}\n{' '.join(options)}\n{text.decode()}"
    print(f"{count} models with degenerate patches: {statuses[0]} meshes, {count - statuses[0]} refused in words")
    return None


def foreign_files() -> dict[str, bytes]:
    """A file of each format that is imported."""
    loops = {name: (REPOSITORY / "tests/filling" / name).read_bytes() for name in ("cagd86.gbp", "pocket3sided.lop")}
    return foreign.FILES | loops


def imports(count: int, seed: int, names: Iterable[str] | None = None) -> str | None:
    """Read mutated files of other programs; the first complaint. Time and memory are those of all processes."""
    files = foreign_files()
    for name in files if names is None else names:
        read_foreign(name, files[name])
        before = memory()
        words = 0
        for number in range(count):
            data = mutated(random.Random(f"{name} {seed}-{number}"), files[name])
            start, complaint = sum(os.times()[:4]), None
            try:
                read_foreign(name, data)
            except SpecError as error:
                words += 1
                if not all(line.startswith(name) for line in str(error).splitlines()):
                    complaint = f"not a message: {error}"
            except Exception as error:  # noqa: BLE001 -- whatever it is, it is not for a user
                complaint = repr(error)
            seconds, grown = sum(os.times()[:4]) - start, memory() - before
            if seconds > (SECONDS_OF_KERNEL if name.endswith(".igs") else SECONDS) or grown > MEGABYTES:
                complaint = f"{seconds:.2f} s, {grown:.0f} MB"
            if complaint:
                with tempfile.NamedTemporaryFile(prefix="gtb-", suffix=name, delete=False) as kept:
                    kept.write(data)
                return f"{name} {number} of seed {seed}, {kept.name}: {complaint}"
        print(f"{name}: {count} mutated files, {words} refused in words, none over {SECONDS:g} s, {grown:.0f} MB more")
    return None


def read_foreign(name: str, data: bytes) -> None:
    """Do what `gtb import` does, but fill no hole."""
    if suffix_of(name) in SUFFIXES:
        loop_from_text(data, name)
    else:
        dump(import_data(name, data).shape)


def memory() -> float:
    """The most megabytes that this process, or one that it started, has needed so far."""
    return max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1024


def overwriting(count: int, seed: int) -> str | None:
    """Run command lines whose output is an input; the first that is not refused, or changes a file."""
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        triangle = {"knots": [[0, 0], [1, 0], [0, 1]], "control_points": [[0, 0], [1, 0], [0, 1]]}
        Path("s.toml").write_text(json.dumps(triangle), encoding="utf-8")
        Path("p.txt").write_bytes(b"0.1 0.2\n0.3 0.1\n")
        Path("meshes").mkdir()
        Path("meshes/s.obj").write_text(json.dumps(triangle), encoding="utf-8")
        Path("up").symlink_to(".")
        for file in ("s.toml", "p.txt", "meshes/s.obj"):
            Path(f"to-{file.replace('/', '-')}").symlink_to(file)
        before = contents(Path())
        for number in range(count):
            line = overwriting_line(random.Random(f"{seed}-{number}"))
            result = gtb(*line)
            if result.status != 2 or "would be overwritten" not in result.err or contents(Path()) != before:
                return f"line {number} of seed {seed}: {shlex.join(line)}: status {result.status}, {result.err}"
    print(f"{count} command lines that name an input as output: all refused, and nothing is changed")
    return None


def contents(folder: Path) -> dict[Path, bytes]:
    """Every file below a folder."""
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


MESH = ("mesh", SPECS / "pentagon.toml", "-n", 150)
DEGENERATE = ("degenerate", SPECS / "example-3.4.toml", "-n", 2000)
KNOT_LIMIT = ("knot-limit", SPECS / "example-3.1.toml", "--merge", "1:2", "-n", 2000)

# By what they write: the command that is killed, and that which made what was there before
VICTIMS: dict[str, tuple[tuple[object, ...], tuple[object, ...]]] = {
    **{f"mesh.{kind}": (MESH, (*MESH[:-1], 120)) for kind in ("obj", "ply", "stl", "glb")},
    "degenerate": ((*DEGENERATE, "-x5", "-x100"), (*DEGENERATE, "-x7", "-x100")),
    "knot-limit": ((*KNOT_LIMIT, "--steps", "0.5,0.9"), (*KNOT_LIMIT, "--steps", "0,0.9", "--normals")),
}


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
                if is_torn(found, there, there | whole):
                    sizes = {key: len(value) for key, value in found.items()}
                    return f"{name}: torn in trial {trial} of seed {seed}: {sizes}"
                if trial % 10 == 9 and (started(new, place).wait() or content(place) != there | whole):
                    return f"{name}: trial {trial} of seed {seed}: the next run failed"
                for rest in hidden(place):
                    remove(rest)
        print(f"{name}: {trials} processes killed, nothing torn", flush=True)
    return None


def is_torn(found: dict[str, bytes], old: dict[str, bytes], new: dict[str, bytes]) -> bool:
    """Whether a killed process left something else than the old, the new, or files of both without a record."""
    mixture = set(found.items()) <= {*old.items(), *new.items()}
    unfinished = mixture and SEQUENCE_RECORD in new and SEQUENCE_RECORD not in found
    return found not in (old, new) and not unfinished


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
    """Run all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--specs", type=int, default=20_000)
    parser.add_argument("--made", type=int, default=5_000, help="of each kind that is made by rules")
    parser.add_argument("--files", type=int, default=2_000, help="of each format that is imported")
    parser.add_argument("--kills", type=int, default=200, help="for each format, and each kind of sequence")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    complaint = mutate(options.specs, options.seed)
    for judged in (models, overwriting):
        complaint = complaint or judged(options.made, options.seed)
    complaint = complaint or imports(options.files, options.seed)
    complaint = complaint or kill(options.kills, options.seed)
    if complaint:
        sys.exit(complaint)


if __name__ == "__main__":
    main()
