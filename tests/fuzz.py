"""`python -m tests.fuzz`: many mutated specs through the command, and many commands killed while they write.

Prints what it did; exits 1 at the first thing that should not be, with how to have it again.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.mutations import mutation
from tests.shell import SPECS, gtb

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


def kill(trials: int, seed: int, kinds: tuple[str, ...] = ("obj", "ply", "stl", "glb")) -> str | None:
    """Kill processes while they write over an old file, which must then be old or new, and whole."""
    rng = random.Random(seed)
    spec = str(SPECS / "pentagon.toml")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for kind in kinds:
            target = folder / f"mesh.{kind}"
            command = [sys.executable, "-m", "gtb_cli", "mesh", "-q", spec, "-n", "150", "-o", str(target)]
            start = time.perf_counter()
            subprocess.run(command, check=True)
            usual = time.perf_counter() - start
            whole = target.read_bytes()
            replaced = 0
            for trial in range(trials):
                target.write_bytes(b"old")
                process = subprocess.Popen(command)
                time.sleep(rng.uniform(0.2, 1.1) * usual)
                process.send_signal(signal.SIGKILL)
                process.wait()
                content = target.read_bytes()
                if content not in (b"old", whole):
                    return f"{kind}: torn after {trial} trials: {len(content)} of {len(whole)} bytes"
                replaced += content == whole
                for rest in folder.glob(".gtb-*"):  # what a killed process cannot remove
                    rest.unlink()
            print(f"{kind}: {trials} processes killed, {replaced} after the file was replaced, none torn")
    return None


def main() -> None:
    """Run both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--specs", type=int, default=20_000)
    parser.add_argument("--kills", type=int, default=200, help="for each format")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    complaint = mutate(options.specs, options.seed) or kill(options.kills, options.seed)
    if complaint:
        sys.exit(complaint)


if __name__ == "__main__":
    main()
