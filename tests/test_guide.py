"""What specs/GUIDE.md says is so: its commands run and print that, and its pictures are those that they draw."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

from tests.marks import long
from tests.plots.images import pixels
from tests.shell import REPOSITORY
from tests.tools.guide import GUIDE, LARGEST, PICTURES, PREFIX, Step, pictures, steps, text
from tests.transcripts import matches


def ran(folder: Path) -> list[Step]:
    """Run its commands with what `make mesh` installs; each does what the guide shows."""
    command = [sys.executable, "-m", "tests.tools.guide", str(folder)]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    expected = {step.command: step for step in steps()}
    found = []
    for line in map(json.loads, done.stdout.splitlines()):
        step, text = expected[line["command"]], line["text"]
        assert (line["status"] != 0) == step.fails, line
        assert "warning" not in text, line
        assert not step.lines or matches(step.lines, text), line
        found.append(step)
    return found


@long
def test_its_commands_do_what_it_shows(tmp_path):
    assert len(ran(tmp_path)) >= len(steps()) - 2 > 25  # those of OpenSCAD
    assert {frozenset(), frozenset({"cad"})} <= {step.extras for step in steps()}
    for name in pictures():
        there, drawn = (pixels(path.read_bytes()) for path in (PICTURES / f"{PREFIX}{name}", tmp_path / name))
        assert there.shape == drawn.shape
        assert (np.abs(there.astype(int) - drawn).max(axis=2) > 60).mean() <= 0.03  # other fonts change 1 or 2 %


def test_its_pictures_are_there_and_small():
    there = {path.name.removeprefix(PREFIX): path.stat().st_size for path in PICTURES.glob(f"{PREFIX}*")}
    assert sorted(there) == sorted(pictures())
    assert max(there.values()) <= LARGEST
    drawn = {step.command.split(" -o ")[1] for step in steps() if step.command.startswith("gtb plot")}
    assert drawn == set(there)


def test_its_links_lead_somewhere_and_lines_are_short():
    for target in re.findall(r"\]\(([^)#]+)", text()):
        assert (GUIDE.parent / target).exists(), target
    assert max(map(len, text().splitlines())) <= 120
