"""Starter specs, completion, and coefficients."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from gtb_cli.checks.properties import check
from gtb_cli.errors import SpecError
from gtb_cli.formats.meshfiles import read_mesh
from gtb_cli.language.loading import parse
from gtb_cli.language.starter import template
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.vocabulary import SHELLS, TEMPLATES
from tests.marks import mostly_long
from tests.shell import gtb

RING = "ring", 12  # a fill of ten seconds; its wall alone is meshed
THINGS = [("bowl", 5), ("ring", 4), ("shade", 6), ("joint", 3), ("handle", None)]
PATCHES = ["curve", "triangle", "rectangle", "pentagon", "model"]
ALL = [*THINGS, *((name, None) for name in PATCHES), *(("n-gon", n) for n in (3, 4, 5, 6, 7, 12, 100))]


@pytest.mark.parametrize(("name", "sides"), mostly_long([*ALL[len(THINGS) :], *THINGS, RING], len(ALL) - len(THINGS)))
def test_a_template_meshes_and_has_the_properties(name, sides):
    result = gtb("new", *filter(None, (name, sides)), status=0)
    assert result.err == ""
    shape = parse(result.text)
    n = 4 if (sides or 0) < 50 else 1
    assert tessellate(shape, n).bounds.shape == (2, 3)
    assert gtb("mesh", "-", "-n", n, stdin=result.out).status == 0
    if (sides or 0) < 50:
        assert check(shape).holds
    # No line of it is left to the defaults that is there to be changed, and lines can be read.
    assert result.text.startswith("#:schema ./spec-schema.json\n# ")
    assert re.search(r"^# .*Mesh it with: gtb mesh \S+\.toml( .*)? -o \S+\.(obj|stl)$", result.text, re.MULTILINE)
    if sides != 100:
        assert max(map(len, result.text.splitlines())) <= 110  # that people read
    assert result.text.count("#") >= 4


def test_things_are_named_with_the_numbers_of_sides_that_they_may_have():
    assert {name for name, _ in ALL} == set(TEMPLATES)
    assert {name for name, most in TEMPLATES.items() if most} == {"n-gon", *(name for name, n in THINGS if n)}


COARSE = ["--tolerance", 0.8]
EXTREMES = [(name, n, COARSE) for name, most in TEMPLATES.items() if most and name != "n-gon" for n in (3, most)]
EXTREMES = [case for case in EXTREMES if case[:2] != RING]


@pytest.mark.parametrize(
    ("name", "sides", "coarse"),
    [
        *((*thing, COARSE) for thing in THINGS if thing[0] != "ring"),
        *mostly_long([("ring", 4, COARSE), *((*thing, []) for thing in THINGS), *EXTREMES], 0),
    ],
)
def test_things_are_solid_by_their_own_command(name, sides, coarse, tmp_path, monkeypatch):
    """With the thickness or radius of their first line they are of the height of their table, and stand level."""
    monkeypatch.chdir(tmp_path)
    made = gtb("new", *filter(None, (name, sides)), "-o", f"{name}.toml", status=0)
    words = re.search(r"Mesh it with: gtb (.*)", Path(f"{name}.toml").read_text(encoding="utf-8"))[1].split()
    assert made.err.strip().endswith(f": gtb {' '.join(words)} meshes it")
    done = gtb(*words, *coarse, "--require", "solid", status=0)
    assert coarse or "warning" not in done.err
    mesh = read_mesh(f"{name}.stl")
    low, high = mesh.bounds
    height = {"bowl": 45, "ring": 45.1, "shade": 110, "joint": 17, "handle": 37}[name]
    assert high[2] - low[2] == pytest.approx(height, abs=0.9)
    feet = np.isclose(mesh.vertices[:, 2], low[2], atol=1e-5)[mesh.faces].all(axis=1)
    assert feet.sum() > 4 or name == "joint"  # an area, not a line


def test_the_wall_of_a_ring_has_its_height():
    low, high = tessellate(parse(template("ring", 4)), 2).bounds
    assert high[2] - low[2] == pytest.approx(34)


@pytest.mark.parametrize(("name", "sides"), [thing for thing in THINGS if thing[0] in ("bowl", "joint")])
def test_seams_of_things_are_smooth(name, sides):
    angles = {seam.name(model): seam.angle for model in [parse(template(name, sides))] for seam in model.seams}
    assert len(angles) >= 10
    assert max(angles.values()) < 1e-9


@pytest.mark.parametrize("arms", range(3, 9))
def test_rods_fit_into_a_joint(arms):
    """Its tubes are nowhere narrower than the rod with its play, nor wider than half a millimetre near their ends."""
    patch = parse(template("joint", arms)).patches[0]
    t = np.linspace(0, 3, 31)
    points = patch.evaluate(np.stack(np.meshgrid(t, t), axis=-1).reshape(-1, 2))
    radii = np.hypot(points[:, 1], points[:, 2])
    assert radii.min() > 6.1 - 1e-12
    assert radii[points[:, 0] > points[:, 0].max() - 20].max() < 6.1 + 0.35


def test_templates_are_what_they_are_called():
    patches = {name: parse(template(name)) for name in ("curve", "triangle", "rectangle", "pentagon")}
    sides = {name: len(patch.domain.vertices) for name, patch in patches.items()}
    assert sides == {"curve": 2, "triangle": 3, "rectangle": 4, "pentagon": 5}
    for n in (3, 4, 5, 6, 7, 12, 100):
        patch = parse(template("n-gon", n))
        assert (len(patch.domain.vertices), len(patch.knots)) == (n, 2 * n + 1)
        # A regular polygon: rotated by an angle of its own, the corners are the same.
        turn = 2 * np.pi / n
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        np.testing.assert_allclose(patch.knots[:n] @ rotation.T, np.roll(patch.knots[:n], -1, axis=0), atol=1e-14)
    assert patches["triangle"].coefficients.tolist() == [1, 2, 1, 2, 2, 1]
    assert patches["pentagon"].lifting is not None
    with pytest.raises(SpecError, match="template: expected one of curve, triangle"):
        template("octagon")


@pytest.mark.parametrize("name", SHELLS)
def test_a_shell_understands_its_script(name, tmp_path, monkeypatch):
    path = tmp_path / "script"
    with monkeypatch.context() as alone:
        alone.setattr(os, "environ", {})  # the script is made without the shell
        path.write_bytes(gtb("completion", name, status=0).out)
    assert f"_GTB_COMPLETE={name}_complete" in path.read_text()
    if shutil.which(name):
        done = subprocess.run([name, "-n", path], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
