"""Regression: small meshes that this program made, kept in `golden/`; their numbers are its own, not a reference.

To renew one after a change that is meant: `gtb mesh specs/NAME.toml -n N -o tests/golden/NAME.obj`.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.shell import SPECS, gtb

GOLDEN = sorted((Path(__file__).parent / "golden").glob("*.obj"))


@pytest.mark.parametrize("golden", GOLDEN, ids=lambda path: path.stem)
def test_the_mesh_of_a_spec_stays_what_it_was(golden):
    resolution = 2 if golden.stem == "box-corner" else 3
    result = gtb("diff", golden, SPECS / f"{golden.stem}.toml", "-n", resolution)
    assert result.status == 0, result.text
    assert gtb("mesh", SPECS / f"{golden.stem}.toml", "-n", resolution).out.count(b"\n") == golden.read_bytes().count(
        b"\n"
    )


def test_a_different_mesh_would_be_noticed():
    assert gtb("diff", GOLDEN[0].with_name("pentagon.obj"), SPECS / "pentagon.toml", "-n", 4).status == 1
