"""What happens to people who start: each accident with the sentence that helps, and no file where it is an error."""

import pytest

from gtb_cli.language.loading import load
from gtb_cli.tessellation.doubtful_corners import doubtful_corners
from gtb_cli.theory.patch import Patch
from tests.specs import GOOD_SPECS


@pytest.mark.parametrize("path", GOOD_SPECS, ids=lambda path: path.stem)
def test_no_corner_of_a_good_spec_is_doubtful(path):
    assert doubtful_corners(load(path)) == []


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9, 1e90])
def test_exchanged_corners_are_found_at_any_scale_and_place(scale):
    around = [[1, 0, 0], [2, 0, 1], [3, 2, 0], [1, 3, 0], [0, 2, 1]]
    for order, sentence in (([0, 1, 2, 3, 4], None), ([0, 1, 2, 4, 3], "control points 3 and 4 were exchanged")):
        points = [[scale * x + 1e7 * scale for x in around[k]] for k in order]
        knots = [[x, y] for x, y, _ in around]
        found = doubtful_corners(Patch(knots, points))
        assert [line.split("as if ")[-1] for line in found] == ([sentence] if sentence else [])
