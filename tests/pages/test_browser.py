"""Pages of `gtb view` in a real browser."""

import re
import subprocess

import numpy as np
import pytest

from tests.plots.images import near
from tests.shell import SPECS, command, environment, gtb, until
from tests.specs import load
from tests.tools.browser import WINDOW, Browser

pytestmark = pytest.mark.long


PLATE = """knots = [[0, 0], [1, 0], [0, 1], [1, 1]]
control_points = [[0, 0, 0], [40, 0, 0], [0, 30, 0], [40, 30, 0]]
"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    for name in ("teapot", "bicubic", "box-corner", "example-3.1"):
        gtb("view", SPECS / f"{name}.toml", "-o", folder / f"{name}.html", status=0)
    bicubic = SPECS / "bicubic.toml"
    gtb("degenerate", bicubic, "--lifting", "knot:5", "-x", "1", "-n", "2", "-o", folder / "s", status=0)
    gtb("view", folder / "s", "-o", folder / "sequence.html", status=0)
    (folder / "plate.toml").write_text(PLATE, encoding="utf-8")
    gtb("view", folder / "plate.toml", "--thickness", "2", "-n", "4", "-o", folder / "plate.html", status=0)
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


def background(image: np.ndarray) -> np.ndarray:
    """An empty page beside an image."""
    return np.broadcast_to(image[-1, -1], image.shape)


@pytest.mark.parametrize(
    ("name", "least"),
    [("teapot", 0.1), ("bicubic", 0.1), ("box-corner", 0.1), ("sequence", 0.1), ("example-3.1", 0.01)],
)
def test_it_draws_more_than_the_background(browser, name, least, show):
    image = show(name, axes="false")[:, 260:]
    assert changed(image, background(image)) > least
    assert browser.run("draw(); return gl.getError()") == 0


def in_view(browser: Browser) -> bool:
    """Whether all texts are within the window."""
    return browser.run(
        "return [...document.querySelectorAll('#marks span, .card')].map(e => e.getBoundingClientRect())"
        ".every(b => b.left >= 0 && b.top >= 0 && b.right <= innerWidth && b.bottom <= innerHeight)"
    )


def test_all_of_it_is_in_view(browser, show):
    for name, net in (("teapot", "false"), ("teapot", "true"), ("sequence", "true"), ("example-3.1", "true")):
        show(name, net=net, mode="mean")
        assert browser.run("return document.querySelectorAll('#marks span').length") >= 3
        assert in_view(browser), name
        assert browser.run(
            "const clouds = scene.frames.flatMap(f => [f.positions, state.net && f.net || []]);"
            "const ends = clouds.flatMap(cloud => Array.from(cloud));"
            "return ends.every((_, k) => { if (k % 3) return true; const [x, y] = project(...ends.slice(k, k + 3));"
            "return x >= 0 && y >= 0 && x <= innerWidth && y <= innerHeight; })"
        ), name


def test_switches_show_and_hide(browser, show):
    before = show("teapot")
    red = near(before, "#d6001c").sum()
    assert red > 100
    browser.keys("o")
    assert near(browser.picture(), "#d6001c").sum() < red / 20
    browser.keys("o")
    for key in "nkcebal":
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


def test_a_wheel_zooms_about_the_pointer(browser, show):
    show("bicubic")
    place = "return project(...scene.frames[0].positions.subarray(0, 3)).slice(0, 2)"
    x, y = browser.run(place)
    browser.wheel((round(x), round(y)), -200)
    browser.settle()
    assert browser.run("return state.zoom") > 1.2
    assert np.hypot(*np.subtract(browser.run(place), (x, y))) < 2


def test_one_finger_turns_and_two_zoom_and_move(browser, show):
    image = show("bicubic")
    least = "Math.min(canvas.clientWidth, canvas.clientHeight)"
    view = f"return [state.azimuth, state.elevation, state.zoom, state.panX * {least}, state.panY * {least}]"
    before = browser.run(view)
    browser.fingers([(400, 200), (420, 200), (450, 215)])
    turned = browser.run(view)
    assert turned[0] == pytest.approx(before[0] - 20, abs=1)
    assert turned[1] == pytest.approx(before[1] + 6, abs=1)
    assert turned[2:] == before[2:]
    assert changed(image, browser.picture()) > 0.02
    place = "return project(...scene.frames[0].positions.subarray(0, 3)).slice(0, 2)"
    x, y = (round(value) for value in browser.run(place))
    browser.fingers([(x - 50, y), (x - 70, y), (x - 100, y)], [(x + 50, y), (x + 70, y), (x + 100, y)])
    assert np.hypot(*np.subtract(browser.run(place), (x, y))) < 4  # what is between the fingers stays there
    apart = browser.run(view)
    assert apart[:2] == turned[:2]
    assert apart[2] == pytest.approx(2 * turned[2], rel=0.1)
    browser.fingers([(400, 150), (400, 170), (400, 190)], [(500, 150), (500, 170), (500, 190)])
    moved = browser.run(view)
    assert moved[2] == pytest.approx(apart[2], rel=0.05)
    assert moved[4] == pytest.approx(apart[4] - 40, abs=3)
    assert moved[3] == pytest.approx(apart[3], abs=3)


def test_keys_do_what_the_page_says(browser, show):
    keys = {
        "\ue014": "azimuth",  # right
        "\ue013": "elevation",  # up
        "+": "zoom",
        "-": "zoom",
        "2": "mode",
        "n": "net",
        "k": "knots",
        "e": "edges",
        "o": "open",
        "a": "axes",
        "p": "folds",
        "c": "patches",
    }
    show("bicubic")
    for key, name in keys.items():
        before = browser.run("return {...state}")
        browser.keys(key)
        after = browser.run("return {...state}")
        assert [other for other in before if before[other] != after[other]] == [name]
    help_ = browser.run("return document.getElementById('panel').textContent")
    words = "Arrows", "+ −", "1–7", "c n k e b o p a", "Space", "[ ]", "d: dark"
    assert [word for word in words if word not in help_] == []


def test_a_switch_that_has_the_focus_takes_the_space_bar(browser, show):
    show("sequence")
    browser.run("document.getElementById('axes').focus()")
    browser.keys(" ")
    assert browser.run("return [state.axes, playing]") == [False, False]


def test_names_are_under_the_pointer(browser, show):
    show("box-corner", azimuth=45, elevation=35)
    x, y = browser.run(
        "const [, a, b] = scene.groups.find(([name]) => name === 'hole'), v = scene.cells[3 * (a + b >> 1)];"
        "return project(...scene.frames[0].positions.subarray(3 * v, 3 * v + 3)).slice(0, 2).map(Math.round)"
    )
    browser.mouse((x - 1, y), (x, y))
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
    assert 0 < until(lambda: browser.run("return state.frame")) <= 1.7


def test_a_section_is_filled_where_it_is_inside(browser, show):
    """A plate of 40 × 30 × 2 from the front, cut in its middle: the cut is as high as the plate, and as wide."""
    whole = show("plate", azimuth=-90, elevation=0, axes="false", edges="false")
    assert near(whole, "#e69976").sum() == 0
    show("plate", azimuth=-90, elevation=0, axes="false", edges="false", section="y")
    hatched = browser.picture()
    pixels = near(hatched, "#e69976") | near(hatched, "#9e4d33")
    width, height = (np.ptp(np.flatnonzero(pixels.any(axis=axis))) + 1 for axis in (0, 1))
    assert width / height == pytest.approx(20, rel=0.15)
    assert pixels.sum() > 0.7 * width * height
    assert browser.run("const h = hit(canvas.clientWidth / 2 + 60, canvas.clientHeight / 2); return h && h.group") == -1
    show("bicubic", section="x")
    assert near(browser.picture(), "#e69976").sum() == 0  # an open surface has no inside
    assert browser.run("return sectionLines().length > 60 && gl.getError() === 0")
    browser.keys("x")
    assert browser.run("return state.section") == ""


def corner(browser: Browser, x: float, y: float, z: float) -> tuple[int, int]:
    """Place of a point of the model on the screen."""
    place = f"[{x}, {y}, {z}].map((x, i) => (x - scene.middle[i]) / scene.size)"
    left, top, _ = browser.run(f"return project(...{place})")
    return round(left), round(top)


def test_measuring_snaps_to_corners_and_edges_and_is_in_the_address(browser, show):
    show("plate", elevation=40)
    browser.keys("m")
    for place in ((0, 0, 2), (40, 30, 2)):
        x, y = corner(browser, *place)
        browser.mouse((x + 3, y + 2), (x + 4, y + 3))
        assert "corner" in browser.run("return $('tip').textContent")
        browser.mouse((x + 4, y + 3), drag=True)
    assert browser.run("return [state.from, state.to, measured().distance]") == ["0,0,2", "40,30,2", pytest.approx(50)]
    assert "distance 50 mm\ndx 40  dy 30  dz 0" in browser.run("return $('measured').textContent")
    browser.settle()  # the length is written where it is drawn
    assert browser.run("return [$('length').textContent, $('length').hidden]") == ["50 mm", False]
    x, y = corner(browser, 22, 0, 2)
    assert browser.run(f"const s = snap({x}, {y + 3}); return [s.kind, ...inModel(s.point)]") == [
        *("edge", pytest.approx(22, abs=0.5), pytest.approx(0, abs=1e-4), pytest.approx(2, abs=1e-4))
    ]
    x, y = corner(browser, 17, 11, 2)
    assert browser.run(f"const s = snap({x}, {y}); return [s.kind, ...inModel(s.point)]") == [
        *("surface", pytest.approx(17, abs=0.5), pytest.approx(11, abs=0.5), pytest.approx(2, abs=1e-4))
    ]
    browser.keys("\ue00c")  # Escape
    browser.settle()
    assert browser.run("return [state.from, state.measure, $('length').hidden]") == ["", False, True]


def test_a_link_shows_the_same(browser, show):
    browser.size(*WINDOW)
    show("box-corner")
    browser.keys("t\ue014\ue013e")
    browser.run("set({section: 'z', at: 0.4, flip: true, mode: 'zebra', from: '0,0,0', to: '1,1,1'})")
    image = browser.picture()[:, 270:]  # beside the panel, whose scroll bar comes and goes
    until(lambda: "section=z" in browser.run("return location.href"))
    address = browser.run("return location.href")
    browser.open(address)
    assert changed(image, browser.picture()[:, 270:]) < 0.001
    browser.keys("f")
    browser.run("remember()")
    assert "zoom" not in browser.run("return location.href")  # it fits another window, too
    browser.run("set({mode: 'shaded', zoom: 3, panX: 0.1}); remember()")
    image = browser.picture()[:, 270:]
    browser.open(browser.run("return location.href"))
    assert changed(image, browser.picture()[:, 270:]) < 0.001
    wrong = "mode=none&section=w&at=x&zoom=&explode=1e99&from=1,2&frame=NaN&nothing=1"
    browser.open(f"{address.partition('#')[0]}#{wrong}")
    seen = browser.run("return [state.mode, state.section, state.at, state.explode, measured()]")
    assert seen == ["shaded", "", 0.5, 1, None]


def test_patches_part_and_come_back(browser, show):
    image = show("teapot", axes="false")
    browser.keys("g")
    assert changed(image, browser.picture()) > 0.05
    assert browser.run(
        "return gather('border', 0, scene.frames[0].positions, scene.lines.border).length"
    ) > browser.run("return scene.lines.border.length * 3 / 2")
    browser.keys("g")
    assert changed(image, browser.picture()) < 0.001


def test_views_by_keys_and_buttons(browser, show):
    show("plate")
    views = {"t": (-90, 90), "T": (-90, -90), "v": (-90, 0), "V": (90, 0), "s": (0, 0), "S": (180, 0), "h": (-60, 30)}
    for key, view in views.items():
        browser.keys(key)
        assert tuple(browser.run("return [state.azimuth, state.elevation]")) == view, key
    browser.run("$('top').click()")
    assert browser.run("return [state.elevation, axisEdges().length]") == [90, 2]


def test_walls_and_overhangs_have_their_colours(browser, show):
    image = show("plate", mode="wall", elevation=40)
    assert near(image, "#f7935d").sum() > 1000  # 2 of 0 to 6, a third of the way between the first three colours
    assert browser.run("return [$('scale-low').textContent, $('scale-high').value]") == ["0.00", "6"]
    assert browser.run("return $('least').textContent") == "least 2.00"
    assert near(image, "#d6001c").sum() > 20  # the ring around the place
    browser.run("$('scale-high').value = 4; $('scale-high').oninput({target: $('scale-high')})")
    assert near(browser.picture(), "#fee090").sum() > 1000  # the middle of 0 to 4
    show("plate", mode="wall", scale=8, elevation=40)
    assert browser.run("return $('scale-high').value") == "8"
    x, y = corner(browser, 20, 15, 2)
    browser.mouse((x, y), (x + 1, y))
    assert "Wall thickness 2.000 mm" in browser.run("return $('tip').textContent")
    assert near(show("plate", mode="wall", thin=2.001, elevation=40), "#a50026").sum() > 1000
    assert browser.run("return $('thinner').textContent") == "24.00 cm² (89.6 %)"
    show("plate")
    beside = "corners().every(p => project(...p)[0] < $('scale').getBoundingClientRect().left)"
    assert browser.run(f"set({{ mode: 'wall' }}); return {beside}")
    show("plate", mode="overhangs", angle=30)
    assert browser.run("return $('steep').textContent") == "30° from upright: 0.000 mm² (0.0 %)"
    assert browser.run("scene.box.low[2] -= 1; made.clear(); return overhang()") == "12.00 cm² (44.8 %)"


def test_a_mode_that_a_page_lacks_is_named(browser, show):
    show("plate", mode="zebra")
    assert browser.run("return $('remarks').textContent") == ""
    show("plate", mode="mean")
    remark = "The address asks for mean curvature, which is shown of a spec's surface alone."
    assert browser.run("return [state.mode, $('remarks').textContent]") == ["shaded", remark]
    show("bicubic", mode="wall")
    remarks = browser.run("return $('remarks').textContent")
    assert "wall thickness, which is shown of a closed mesh, and this is none" in remarks
    disabled = browser.run("return [...$('mode').options].filter(o => o.disabled).map(o => o.value)")
    assert disabled == ["wall", "overhangs"]


def test_a_picture_has_twice_the_size_and_no_background_if_asked(browser, show):
    show("plate", mode="wall")
    assert browser.run(
        "const p = picture(); return [p.width / canvas.clientWidth, p.height / canvas.clientHeight]"
    ) == [*(pytest.approx(2 * browser.run("return devicePixelRatio"), rel=1e-3),) * 2]
    corner = "const p = picture(); return [...p.getContext('2d').getImageData(5, p.height - 5, 1, 1).data]"
    assert browser.run(corner)[3] == 255
    browser.run("set({back: false})")
    assert browser.run(corner) == [0, 0, 0, 0]
    click = "function () { window.saved = [this.download, this.href]; }"
    browser.run(f"HTMLAnchorElement.prototype.click = {click}; save()")
    saved = until(lambda: browser.run("return window.saved"))
    assert saved[0] == "plate.png"
    assert saved[1].startswith("blob:")


def test_dark_and_light(browser, show, pages):
    assert show("bicubic").mean() > 200
    browser.keys("d")
    assert browser.picture().mean() < 120
    browser.open((pages / "bicubic.html").as_uri())
    means = []
    for colours in ("dark", "light"):
        browser.prefer(colours)
        means.append(browser.picture().mean())
    assert means[0] < 120
    assert means[1] > 200


def test_what_a_graphics_card_forgets_is_drawn_again(browser, show):
    image = show("bicubic", net="true")
    browser.run("window.card = gl.getExtension('WEBGL_lose_context'); card.loseContext()")
    browser.settle()
    browser.run("card.restoreContext()")
    until(lambda: not browser.run("return gl.isContextLost()"))
    assert changed(image, browser.picture()) < 0.001
    browser.complaints()  # Chromium says that it was lost


def test_a_window_of_another_size(browser, show):
    wide = show("teapot")
    try:
        browser.size(500, 700)
        narrow = browser.picture()
        assert narrow.shape[:2] != wide.shape[:2]
        assert in_view(browser)
        assert changed(narrow, background(narrow)) > 0.05
        assert browser.run("return [canvas.width, canvas.height]") == list(narrow.shape[1::-1])
        show("teapot")
        assert browser.run("return document.getElementById('panel').open") is False
        assert in_view(browser)
    finally:
        browser.size(*WINDOW)
    show("teapot")


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
        assert soon(browser, "return scene && !scene.quick")
        first = browser.picture()
        spec.write_text(text.format("oops"), encoding="utf-8")
        assert soon(browser, "return !document.getElementById('error').hidden")
        assert "x.toml:2:" in browser.run("return document.getElementById('error').textContent")
        assert browser.run("return scene.name") == "x"
        spec.write_text(text.format(2), encoding="utf-8")
        assert soon(browser, "return scene.box.texts[2][1] === '2'")
        assert browser.run("return document.getElementById('error').hidden") is True
        assert changed(first, browser.picture()) > 0.005
        assert browser.complaints() == []
    finally:
        server.terminate()
        browser.open("about:blank")
        server.communicate(timeout=120)


def test_sliders_turn_the_numbers_of_a_spec(browser, tmp_path):
    """Five sliders of a bowl: each gives another shape, and the page says how to get it without gtb view."""
    spec = tmp_path / "bowl.toml"
    gtb("new", "bowl", "5", "-o", spec, status=0)
    text = spec.read_text(encoding="utf-8")
    server = subprocess.Popen(
        command("view", "--watch", "--no-open", "--set", "foot=50", "--fill", "wall edge 1=g0", spec),
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    try:
        browser.open(re.search(r"http://127\.0\.0\.1:\d+/", server.stderr.readline())[0])
        browser.run("window.firsts = []; const own = present; present = d => { firsts.push(d.quick); own(d); }")
        assert soon(browser, "return scene && !scene.quick && $('working').hidden")
        rows = "[...$('sliders').children]"
        names = browser.run(f"return {rows}.map(row => row.dataset.name)")
        assert names == ["sides", "width", "height", "foot", "belly", "roundness"]
        assert browser.run(f"return {rows}[3].querySelector('input').value") == "50"
        before, turns = browser.picture(), {"sides": 7, "width": 100, "height": 70, "foot": 40, "roundness": 1}
        for name, value in turns.items():
            old = browser.run(
                f"const s = {rows}.find(row => row.dataset.name === '{name}').querySelector('[type=range]');"
                f"const old = version; firsts = []; s.value = {value}; s.oninput({{target: s}}); return old"
            )
            assert soon(browser, f"return version > {old}"), name
            assert changed(before, before := browser.picture()) > 0.001, name
            assert browser.run("return firsts[0]"), name  # a quick picture, before the hole is filled
        assert browser.run("return $('working').textContent").endswith(": what was asked for follows …")
        assert soon(browser, "return !scene.quick && scene.box.texts[2][1] === '70'")
        browser.run("$('options').click()")
        options = browser.run("return $('said').textContent")
        assert options == "--set foot=40 --set sides=7 --set width=100 --set height=70 --set roundness=1"
        browser.run("$('edits').click()")
        lines = browser.run("return $('said').textContent").splitlines()
        assert lines[:2] == [
            "12: sides = 7  # 3 … 24",
            "13: width = 100  # 20 … 300: of the rim, from the middle of the bowl to a corner and back",
        ]
        assert spec.read_text(encoding="utf-8") == text
        mesh = [tmp_path / "one.obj", tmp_path / "two.obj"]
        gtb("mesh", spec, "-n", 4, "-o", mesh[0], *options.split(), status=0)
        for line in lines:  # and typing them into the file gives the same
            number, _, new = line.partition(": ")
            rows = spec.read_text(encoding="utf-8").split("\n")
            rows[int(number) - 1] = new
            spec.write_text("\n".join(rows), encoding="utf-8")
        gtb("mesh", spec, "-n", 4, "-o", mesh[1], status=0)
        assert mesh[0].read_bytes() == mesh[1].read_bytes()
        browser.run("$('reset').click()")
        assert soon(browser, "return Object.keys(chosen).length === 0")
        browser.run("const s = $('sliders').children[0].querySelector('input'); s.value = 4.5; s.oninput({target: s})")
        assert soon(browser, "return $('error').textContent.includes('repeat: must be a whole number')")
        assert browser.complaints() == []
    finally:
        server.terminate()
        browser.open("about:blank")
        server.communicate(timeout=120)


def soon(browser: Browser, script: str) -> object:
    return until(lambda: browser.run(script))


def test_a_notebook_shows_a_frame_without_scroll_bars(browser, tmp_path):
    page = tmp_path / "notebook.html"
    frame = load(SPECS / "teapot.toml")._repr_html_()
    page.write_text(f"<!doctype html><div id=output style='overflow: auto'>{frame}</div>", encoding="utf-8")
    browser.open(page.as_uri())
    sizes = "[o.scrollHeight - o.clientHeight, o.scrollWidth - o.clientWidth]"
    assert browser.run(f"const o = document.getElementById('output'); return {sizes}") == [0, 0]
    panel = "document.querySelector('iframe').contentDocument.getElementById('panel')"
    assert browser.run(f"const o = {panel}; return {sizes}") == [0, 0]
