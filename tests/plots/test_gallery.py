"""The gallery of specs/README.md: every picture is there, small, and what its command draws."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from gtb_cli.plots import panels
from gtb_cli.sequences.sequence import Accuracy
from tests.marks import long
from tests.plots.images import pixels
from tests.tools import guide, stripes
from tests.tools.gallery import LARGEST, PICTURES, README, REPORT, STRIPES, pictures

PICTURES_OF_PAGE = pictures()

# Commands of pictures that are drawn at once
QUICK = re.compile("domain|decomposition --size|curve|example-3.1.toml --size|--vary")

# Steps of 255 by which a pixel is another colour: smoothing of lines and letters changes less from machine to machine,
# but for letters that stand elsewhere
DIFFERENT = 60

# Part of the pixels that may be others. Other fonts change 1 or 2 %, a curve or a panel that is missing more.
FEW = 0.03


def others(one: Path, other: Path) -> float:
    """Part of the pixels that differ between two pictures of one size."""
    there, drawn = pixels(one.read_bytes()), pixels(other.read_bytes())
    assert there.shape == drawn.shape
    return otherness(there, drawn)


def otherness(one: np.ndarray, other: np.ndarray) -> float:
    """Part of the pixels that differ; or more, if these are more than half of those that are not white in either."""
    differ = np.abs(one.astype(int) - other).max(axis=2) > DIFFERENT
    ink = (np.minimum(one, other).min(axis=2) < 255 - DIFFERENT).sum()
    return float(max(differ.mean(), 2 * FEW * differ.sum() / max(ink, 1)))


def test_every_figure_of_the_paper_is_there():
    text = README.read_text(encoding="utf-8")
    rows = {int(number) for number in re.findall(r"^\| (\d+)[ |]", text, re.MULTILINE)}
    assert rows == set(range(1, 17))
    shown = re.findall(r"!\[[^\]]*\]\(pictures/([\w.-]+)\)", text)
    assert shown == [*(picture.name for picture in PICTURES_OF_PAGE), STRIPES.name, REPORT.name]
    assert set(shown) == {path.name for path in PICTURES.iterdir() if not path.name.startswith(guide.PREFIX)}


def test_pictures_are_small():
    assert {path.name: path.stat().st_size for path in PICTURES.iterdir() if path.stat().st_size > LARGEST} == {}


@pytest.mark.parametrize(
    "picture",
    [
        pytest.param(picture, id=picture.name, marks=() if QUICK.search(" ".join(picture.arguments)) else long)
        for picture in PICTURES_OF_PAGE
    ],
)
def test_a_picture_is_what_its_command_draws(picture, tmp_path, monkeypatch):
    rough = Accuracy(chord_error=5e-3, cells=64, points_in_all=1000)  # nobody sees better distances in a picture
    monkeypatch.setattr(panels, "knot_sequence", partial(panels.knot_sequence, accuracy=rough))
    target = tmp_path / "picture.png"
    assert picture.draw(target) == 0
    assert others(picture.path, target) <= FEW


@pytest.mark.parametrize(("panel", "kind", "place"), [(stripes.of_a_cube, "g2", 1), (stripes.of_a_loop, "g1", 2)])
@long
def test_stripes_are_those_of_fills(panel, kind, place):
    """One picture of each shape, and one of each continuity, of the four."""
    there = np.split(pixels(STRIPES.read_bytes()), 4, axis=1)[place]
    assert otherness(there, np.asarray(panel(kind).convert("RGB"))) <= FEW


@pytest.mark.parametrize("picture", PICTURES_OF_PAGE, ids=lambda picture: picture.name)
def test_a_blank_picture_is_seen(picture):
    there = pixels(picture.path.read_bytes())
    assert otherness(there, np.full_like(there, 255)) > FEW


def test_another_picture_is_seen():
    assert others(PICTURES / "figure-3.png", PICTURES / "figure-4.png") > FEW
