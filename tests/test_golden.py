"""Regression: the meshes of `specs/`, which this program made; their numbers are its own, not a reference.

These are the commands of the README's "In CI". `make golden` renews the meshes after a change that is meant.
"""

import numpy as np

from gtb_cli.language.writer import dump
from gtb_cli.models.model import Model
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from tests.marks import long
from tests.shell import REPOSITORY, gtb
from tests.specs import GOOD_SPECS, load

OPTIONS = ("-n", 3)


def test_the_meshes_of_the_specs_stay_what_they_were(tmp_path):
    golden = REPOSITORY / "tests" / "golden"
    assert gtb("mesh", *GOOD_SPECS, *OPTIONS, "-o", tmp_path, "-q").status == 0
    result = gtb("diff", golden, tmp_path)
    assert result.status == 0, result.text
    assert result.text.startswith(f"{len(GOOD_SPECS)} same")


def test_they_are_renewed_with_the_same_options():
    command = f"gtb_cli mesh $(SPECS) {' '.join(map(str, OPTIONS))} -o tests/golden"
    assert command in (REPOSITORY / "Makefile").read_text(encoding="utf-8")


def nudged(spec: Patch | Model) -> Patch | Model:
    """The spec with that control point of its first patch moved which moves the surface least."""
    millionth = 1e-6  # fraction of the model's size: a control point that moves by this is not a rounding error
    first, *others = spec.patches
    influence = first.basis(tessellate(first, 8).parameters).max(axis=0)
    size = np.linalg.norm(np.ptp(np.vstack([patch.control_points for patch in spec.patches]), axis=0))
    points = first.control_points.copy()
    points[influence.argmin(), 1] += millionth * size
    moved = first.replace(control_points=points)
    return Model((moved, *others), name=spec.name) if isinstance(spec, Model) else moved


@long
def test_a_control_point_that_moves_by_a_millionth_shows_in_every_spec(tmp_path):
    folders = {name: tmp_path / name for name in ("specs", "golden", "out")}
    folders["specs"].mkdir()
    for path in GOOD_SPECS:
        (folders["specs"] / path.name).write_text(dump(nudged(load(path))), encoding="utf-8")
    options = ("-n", 4, "-q")
    assert gtb("mesh", *GOOD_SPECS, *options, "-o", folders["golden"]).status == 0
    assert gtb("mesh", *folders["specs"].iterdir(), *options, "-o", folders["out"]).status == 0
    result = gtb("diff", folders["golden"], folders["out"])
    assert result.status == 1
    assert result.text.splitlines()[-1].startswith(f"0 same, {len(GOOD_SPECS)} different")
