"""Pages of `gtb view` in a real browser."""

import re
import subprocess
import time

import numpy as np
import pytest

from tests.pictures.browser import Browser
from tests.pictures.images import near
from tests.shell import SPECS, command, environment, gtb

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile")) as made:
        yield made


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    for name in ("teapot", "bicubic", "box-corner", "example-3.1"):
        assert gtb("view", SPECS / f"{name}.toml", "-o", folder / f"{name}.html").status == 0
    assert (
        gtb(
            "degenerate", SPECS / "bicubic.toml", "--lifting", "knot:5", "-x", "1", "-n", "2", "-o", folder / "s"
        ).status
        == 0
    )
    assert gtb("view", folder / "s", "-o", folder / "sequence.html").status == 0
    return folder


@pytest.fixture
def show(browser, pages):
    def shown(name: str, **state: object) -> np.ndarray:
        text = "&".join(f"{key}={value}" for key, value in state.items())
        browser.open(f"{(pages / name).as_uri()}.html#theme=light&{text}")
        return browser.picture()

    yield shown
    assert browser.complaints() == []


def changed(one: np.ndarray, other: np.ndarray) -> float:
    """Part of the pixels that are others."""
    return float((np.abs(one.astype(int) - other).max(axis=2) > 16).mean())


@pytest.mark.parametrize("name", ["teapot", "bicubic", "box-corner", "example-3.1", "sequence"])
def test_it_draws_more_than_the_background(name, show):
    image = show(name)
    assert changed(image[:, 260:], np.broadcast_to(image[-1, -1], image[:, 260:].shape)) > 0.01


def test_switches_show_and_hide(browser, show):
    before = show("teapot")
    red = near(before, "#d6001c").sum()
    assert red > 100
    browser.keys("o")
    assert near(browser.picture(), "#d6001c").sum() < red / 20
    browser.keys("o")
    for key in "nkcea":
        one = browser.picture()
        browser.keys(key)
        assert changed(one, browser.picture()) > 0.001, key
        browser.keys(key)
        assert changed(one, browser.picture()) == 0, key


def test_zebra_stripes_change_when_it_is_turned_and_are_black_and_white(browser, show):
    image = show("bicubic", mode="zebra", axes="false")
    assert near(image, "#111111").mean() > 0.01
    browser.keys("\ue014")  # right
    assert changed(image, browser.picture()) > 0.02
    other = show("bicubic", mode="isophotes", axes="false")
    assert changed(image, other) > 0.02


def test_curvature_has_its_colours_and_a_scale(browser, show):
    image = show("bicubic", mode="mean")
    assert near(image, "#5b3a8c").sum() > 200
    assert near(image, "#c06a10").sum() > 200
    assert browser.run("return document.getElementById('scale').hidden") is False


def test_mouse_turns_wheel_zooms_and_fit_brings_back(browser, show):
    image = show("bicubic")
    browser.mouse((500, 250), (540, 250), drag=True)
    turned = browser.picture()
    assert changed(image, turned) > 0.02
    browser.keys("+++")
    assert changed(turned, browser.picture()) > 0.02
    browser.mouse((500, 250), (460, 250), drag=True)
    browser.keys("f")
    assert changed(image, browser.picture()) < 0.02


def test_names_are_under_the_pointer(browser, show):
    show("box-corner", azimuth=45, elevation=35)
    browser.mouse((480, 250), (481, 251))
    assert browser.run("const t = document.getElementById('tip'); return t.hidden ? '' : t.textContent") == "hole"
    browser.mouse((740, 400))
    assert browser.run("return document.getElementById('tip').hidden") is True


def test_the_slider_changes_the_shape_and_it_plays(browser, show):
    image = show("sequence")
    browser.run("const s = document.getElementById('slider'); s.value = 1; s.oninput({target: s})")
    assert changed(image, browser.picture()) > 0.02
    assert browser.run("return document.getElementById('value').textContent") == "limit"
    browser.keys("[")
    assert changed(image, browser.picture()) < 0.001
    browser.keys(" ")
    time.sleep(0.5)
    assert 0 < browser.run("return state.frame") <= 1.7


def test_dark_and_light_and_a_small_window(browser, show):
    assert show("bicubic").mean() > 200
    browser.keys("d")
    assert browser.picture().mean() < 120
    browser.size(420, 640)
    narrow = show("bicubic")
    assert narrow.shape[1] < 560
    assert browser.run("return document.getElementById('panel').open") is False
    browser.size(760, 560)
    assert changed(narrow[:, :1], np.broadcast_to(narrow[-1, -1], narrow[:, :1].shape)) == 0  # all of it is in view


def test_watch_follows_an_edit_and_shows_an_error(browser, tmp_path):
    spec = tmp_path / "x.toml"
    text = "knots = [[0, 0], [1, 0], [0, 1]]\ncontrol_points = [[0, 0, 0], [1, 0, 0], [0, 1, {}]]\n"
    spec.write_text(text.format(0), encoding="utf-8")
    server = subprocess.Popen(
        command("view", "--watch", "--no-open", spec), stderr=subprocess.PIPE, text=True, env=environment()
    )
    try:
        address = re.search(r"http://127\.0\.0\.1:\d+/", server.stderr.readline())[0]
        browser.open(address)
        first = browser.picture()
        spec.write_text(text.format("oops"), encoding="utf-8")
        assert within_a_second(browser, "return !document.getElementById('error').hidden")
        assert "x.toml:2:" in browser.run("return document.getElementById('error').textContent")
        assert browser.run("return scene.name") == "x"
        spec.write_text(text.format(2), encoding="utf-8")
        assert within_a_second(browser, "return scene.box.texts[2] === 'z 2'")
        assert browser.run("return document.getElementById('error').hidden") is True
        assert changed(first, browser.picture()) > 0.005
        assert browser.complaints() == []
    finally:
        server.terminate()
        browser.open("about:blank")
        server.communicate(timeout=20)


def within_a_second(browser: Browser, script: str) -> bool:
    """Whether a script says yes soon: a second on a machine that does nothing else, ten on one that does."""
    end = time.monotonic() + 10
    while time.monotonic() < end:
        if browser.run(script):
            return True
        time.sleep(0.05)
    return False
