"""Pictures of what changed: what is in them, wherever and however large the meshes are."""

import io
import sys

import numpy as np
import pytest

from gtb_cli import Mesh, diff
from gtb_cli.review.drawing import drawing
from tests.marks import long, mostly_long
from tests.review.test_changes import change, mesh_of, moved
from tests.shell import PENTAGON, gtb

pyplot = pytest.importorskip("matplotlib.pyplot")


def pixels(old: Mesh | None, new: Mesh | None) -> np.ndarray:
    found = diff(old, new) if old is not None and new is not None else None
    verdict = "extra" if old is None else "missing" if new is None else "different"
    return pyplot.imread(io.BytesIO(drawing(change("x.obj", verdict, old, new, found))), format="png")[..., :3]


def has(image: np.ndarray, part: slice, hue: str) -> bool:
    """Tell whether a part of the width has pixels of a colour: blue of old, orange of new, yellow of what is far."""
    red, green, blue = np.moveaxis(image[:, part], 2, 0)
    return {
        "blue": (blue > red + 0.1) & (green > red),
        "orange": (red > blue + 0.2) & (green < red - 0.1),
        "yellow": (red > 0.6) & (green > 0.6) & (blue < 0.4),
    }[hue].any()


@pytest.mark.parametrize(
    ("name", "factor"),
    mostly_long([("pentagon", 1e200), ("cubic-bezier", 1.0), ("pentagon", 1e-9), ("teapot", 1.0)], 2),
)
def test_old_is_blue_and_new_is_orange_beside_it(name, factor):
    old = mesh_of(name, 8)
    new = moved(old, 1.0)
    image = pixels(*(Mesh(factor * mesh.vertices, mesh.cells) for mesh in (old, new)))
    assert image.shape == (370, 1080, 3)
    first, second, third = (slice(360 * k, 360 * k + 350) for k in range(3))
    assert has(image, first, "blue")
    assert has(image, second, "orange")
    assert has(image, third, "yellow")
    assert not has(image, first, "orange")
    assert not has(image, second, "blue")


def test_turned_faces_are_yellow_and_a_lone_mesh_fills_its_picture():
    old = mesh_of("pentagon", 8)
    cells = old.cells.copy()
    cells[:80] = cells[:80, ::-1]
    image = pixels(old, Mesh(old.vertices, cells))
    assert has(image, slice(720, 1080), "yellow")
    alone = pixels(None, old)
    assert alone.shape == (370, 360, 3)
    assert has(alone, slice(360), "orange")


def test_a_dot_is_drawn_at_its_own_scale():
    old = mesh_of("pentagon", 8)
    image = pixels(Mesh(1e-6 * old.vertices, old.cells), old)
    areas = [(image[:, 360 * k : 360 * k + 360] < 0.95).any(axis=2).sum() for k in range(2)]
    assert 0.9 < areas[0] / areas[1] < 1.1


@long
def test_the_same_change_gives_the_same_bytes():
    old = mesh_of("pentagon", 8)
    found = change("x.obj", "different", old, moved(old, 1.0), diff(old, moved(old, 1.0)))
    assert drawing(found) == drawing(found)


def test_without_matplotlib_the_way_out_is_said_before_anything_is_compared(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    found = gtb("diff", PENTAGON, PENTAGON, "--pictures", tmp_path / "pictures", status=2)
    assert (found.out, "pip install 'gtb-cli[plot]'" in found.err) == (b"", True)
    assert list(tmp_path.iterdir()) == []
