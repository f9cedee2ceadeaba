"""What specs/GUIDE.md says is so: its commands run and print that, and its pictures are those that they draw."""

import re

import numpy as np

from tests.marks import long
from tests.plots.images import pixels
from tests.tools.guide import GUIDE, LARGEST, PICTURES, PREFIX, pictures, run, steps, text
from tests.transcripts import matches


@long
def test_its_commands_do_what_it_shows(tmp_path):
    seen = 0
    for step, done in run(tmp_path):
        assert (done.status != 0) == step.fails, done
        assert "warning" not in done.err, done
        assert not step.lines or matches(step.lines, done.text + done.err), (step, done.text + done.err)
        seen += 1
    assert seen >= len(steps()) - 2 > 25  # those of OpenSCAD
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
