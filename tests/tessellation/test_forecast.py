"""Cells that a tolerance will need, foreseen from larger ones, against meshes that were made."""

import pytest

from gtb_cli.errors import ToleranceError
from gtb_cli.tessellation import forecast
from gtb_cli.tessellation.forecast import cells_foreseen
from gtb_cli.tessellation.tessellate import tessellate
from tests.shell import PENTAGON
from tests.specs import load


@pytest.mark.parametrize("surplus", [0.0, 40.0])
def test_cells_of_an_area_and_of_a_crease_are_told_apart(surplus):
    """Cells over an area fall with the tolerance, those along a line with its root."""
    foreseen = cells_foreseen(lambda factor: round(64e6 / factor + surplus * (64e6 / factor) ** 0.5))
    assert foreseen == pytest.approx(64e6 + surplus * 8e3, rel=0.01)


def test_a_mesh_of_somewhat_too_many_faces_is_given_up_early(monkeypatch):
    """11,556 faces are needed, 1.5 times as many as are allowed; it was seen when the mesh had 3,599 and doubled."""
    monkeypatch.setattr(forecast, "WORTH_TRIALS", 1000)
    with pytest.raises(ToleranceError, match=r"needs about 1e\+04 faces, more than 7704; with 1\d\d\d the"):
        tessellate(load(PENTAGON), tolerance=4e-4, max_faces=7704)
