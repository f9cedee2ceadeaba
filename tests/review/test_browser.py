"""The page of what changed, in a real browser."""

import re
import shutil

import numpy as np
import pytest

from tests.shell import SPECS, gtb
from tests.tools.browser import WINDOW

pytestmark = pytest.mark.long

HOSTILE = "<img src=x onerror=alert(1)>\n|`\u202e.obj"
SHOWN = "<img src=x onerror=alert(1)>\\n|`\\u202e.obj"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Five changes: an unreadable file, turned faces, a hostile name, a curve, and a missing file."""
    folder = tmp_path_factory.mktemp("pages")
    golden, out = folder / "golden", folder / "out"
    names = ("pentagon", "cubic-bezier", "bicubic", "rounded-cube")
    gtb("mesh", *(SPECS / f"{name}.toml" for name in names), "-n", "4", "-q", "-o", f"{golden}/", status=0)
    shutil.copy(golden / "pentagon.obj", golden / HOSTILE)
    shutil.copytree(golden, out)
    (out / "bicubic.obj").unlink()
    (out / "pentagon.obj").write_text("v 0 0 nan\n")
    for name, moved in ((HOSTILE, "v 1 1 4"), ("cubic-bezier.obj", "v 1.5 0 0")):
        (out / name).write_text(re.sub("^v .*$", moved, (golden / name).read_text(), count=1, flags=re.MULTILINE))
    lines = (golden / "rounded-cube.obj").read_text().splitlines()
    turned = [" ".join(np.array(line.split())[[0, 1, 3, 2]]) if line.startswith("f ") else line for line in lines]
    (out / "rounded-cube.obj").write_text("\n".join(turned) + "\n")
    gtb("diff", golden, out, "--report", folder / "page.html", status=2)
    return (folder / "page.html").as_uri()


@pytest.fixture
def show(browser, page):
    def shown(change: int) -> np.ndarray:
        browser.open(f"{page}#{change}")
        return browser.picture()

    browser.size(*WINDOW)
    yield shown
    assert browser.complaints() == []


def name(browser) -> str:
    return browser.run("return $('name').textContent")


def coloured(image: np.ndarray) -> np.ndarray:
    """(3,) the part of the pixels in each of the three views that is not grey."""
    stage = image[80:260].astype(int)
    colours = np.ptp(stage, axis=2) > 40
    return np.array([part.mean() for part in np.array_split(colours, 3, axis=1)])


def test_keys_and_the_table_step_through_the_changes(browser, show):
    show(1)
    names = browser.run("return data.changes.map(change => change.name)")
    assert names == ["pentagon.obj", "rounded-cube.obj", SHOWN, "cubic-bezier.obj", "bicubic.obj"]
    for key, place in (
        ("j", 1),
        ("j", 2),
        ("k", 1),
        ("k", 0),
        ("k", 0),
        ("n", 1),
        ("\ue010", 4),
        ("j", 4),
        ("\ue011", 0),
    ):
        browser.keys(key)
        assert name(browser) == names[place]
        assert browser.run("return document.querySelectorAll('tr.chosen').length") == 1
        assert browser.run("return location.hash") == f"#{place + 1}"
    browser.run("document.querySelectorAll('tbody tr')[3].click()")
    assert name(browser) == names[3]
    browser.run("$('before').click()")
    assert name(browser) == names[2]
    for wrong in ("x", "99", "-3", "1.5", ""):
        browser.run(f"location.hash = '{wrong}'")
        browser.settle()
        assert name(browser) in names


def test_no_name_is_markup(browser, show):
    show(3)
    assert name(browser) == SHOWN
    assert browser.run("return document.querySelectorAll('img').length") == 0
    assert browser.run("return document.querySelectorAll('tbody tr')[2].cells[0].textContent") == SHOWN


def test_each_side_that_there_is_is_drawn(browser, show):
    for change, sides in ((1, "o"), (2, "onc"), (3, "onc"), (4, "onc"), (5, "o")):
        seen = coloured(show(change))
        assert "".join(side for side, part in zip("onc", seen, strict=True) if part > 0.002) == sides, change
        assert browser.run("draw(); return gl.getError()") == 0
    assert browser.run("return $('no-new').textContent") == "there is none"


def test_the_mark_is_where_the_largest_distance_is(browser, show):
    show(3)
    assert "most at 1 1 4" in browser.run("return $('facts').textContent")
    box = browser.run("const b = $('spot').getBoundingClientRect(); return [b.left + b.width/2, b.top + b.height/2]")
    image = show(3)
    x, y = (round(each * image.shape[0] / browser.run("return innerHeight")) for each in box)
    stage = np.ptp(image[y - 4 : y + 5, x - 4 : x + 5].astype(int), axis=2)
    assert stage.max() > 60
    show(2)
    assert browser.run("return $('spot').hidden && $('scale').hidden")
    assert "turned over" in browser.run("return $('third').textContent")


def test_turning_moves_all_views_alike(browser, show):
    before = show(3)
    browser.mouse((100, 160), (180, 160), drag=True)
    after = browser.picture()
    changes = (np.abs(before.astype(int) - after).max(axis=2) > 16)[60:300]
    assert all(part.mean() > 0.01 for part in np.array_split(changes, 3, axis=1))
    browser.keys("f")
    inside = browser.run("const b = $('spot').getBoundingClientRect(); return b.left > 0 && b.right < innerWidth")
    assert inside


def test_dark_and_narrow(browser, show):
    try:
        browser.prefer("dark")
        browser.size(420, 700)
        image = show(3)
        assert image[5, -5].max() < 60
        assert browser.run("return document.documentElement.scrollWidth <= innerWidth")
        assert browser.run("return $('stage').clientHeight") >= 220
    finally:
        browser.prefer("light")
