"""Scripts of a page, run by node in a document that has whatever is asked for and does nothing."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gtb_cli
from gtb_cli.pages.page import page_data
from gtb_cli.pages.page_scene import content_of
from gtb_cli.theory.patch import Patch
from tests.shell import SPECS

pytestmark = pytest.mark.skipif(not shutil.which("node"), reason="needs node")

DOCUMENT = """
const any = own => new Proxy(Object.assign(function () {}, own), {
  get: (t, k) => k === Symbol.toPrimitive ? () => 1 : k === "length" ? 0 : Object.hasOwn(t, k) ? t[k] : (t[k] = any()),
  set: (t, k, v) => { t[k] = v; return true; }, apply: () => any(), construct: () => any() });
const ids = {}, document = any({ getElementById: id => ids[id] ??= any(), querySelectorAll: () => [] });
const [addEventListener, matchMedia, requestAnimationFrame, history, location] = [any(), any(), any(), any(), any()];
const window = {}, innerWidth = 800, innerHeight = 600, Option = any(), URLSearchParams = Array;
"""


def answer(script: str, *data: dict[str, Any]) -> Any:
    """What a script, the body of a function of data, returns where the page's own have run."""
    folder = Path(gtb_cli.__file__).parent / "pages"
    own = "".join(
        (folder / f"{name}.js").read_text("utf-8") for name in ("common", "page", "drawing", "measuring", "watch")
    )
    found = f"(async data => {{ {script} }})({json.dumps(data)})"
    code = f"{DOCUMENT}{own}{found}.then(found => {{ console.log(JSON.stringify(found)); process.exit(); }});"
    return json.loads(subprocess.run(["node", "-"], input=code.encode(), stdout=subprocess.PIPE, check=True).stdout)


def test_patches_are_taken_apart_and_the_section_is_flipped():
    found = answer(
        "scene = { centres: [[1, 2, 3]], box: { low: [0, 0, 0], high: [4, 4, 4] } };"
        "const some = [{ explode: 0 }, { explode: 0.5 }, { section: 'x', flip: false }, { section: 'x', flip: true }];"
        "return some.map(each => { Object.assign(state, { at: 0.25 }, each);"
        "return [...shiftOf(0), cutPlane().n[0], cutPlane().d]; });"
    )
    np.testing.assert_allclose([row[:3] for row in found[:2]], [[0, 0, 0], [0.5, 1, 1.5]])
    np.testing.assert_allclose([row[3:] for row in found[2:]], [[1, 1], [-1, -1]], atol=1e-6)


def test_an_error_is_shown_that_stays_and_a_page_is_working_as_soon_as_the_file_can_be_read():
    data = page_data(content_of(gtb_cli.load(SPECS / "bicubic.toml")))
    quick, whole = ({"error": "", "data": data | {"quick": quick}} for quick in ("quickly", ""))
    news = [{"error": "is empty"}, quick, whole, *[{"error": "line 2", "version": 5}] * 3, quick, *[{"error": "x"}] * 2]
    news = [{"version": 2 + min(k, 7)} | each for k, each in enumerate(news)]
    script = (
        "const asked = []; pause = async () => {}; complain(''); present(data.pop());"
        "return new Promise(done => { fetch = async address => { const facts = $('facts').textContent.split(':')[0];"
        "asked.push([address.includes('quick'), $('error').textContent, !$('working').hidden, facts]);"
        "if (asked.length > data.length) done(asked);"
        "return { json: async () => data[asked.length - 1] }; }; watch(1); })"
    )
    found, text = answer(script, *news, data), "quickly"
    assert [row[:3] for row in found] == [
        *([False, "", False], [True, "", False], [False, "", True]),  # nothing is said of an empty file
        *([False, "", False], [True, "", False], [True, "line 2", False], [True, "line 2", False]),
        *([False, "", True], [True, "", True], [True, "x", False]),
    ]
    assert [row[3] == text for row in found] == [k in (2, 7, 8, 9) for k in range(10)]


def test_a_failing_quick_picture_is_told_while_a_slider_moves_and_the_last_good_one_stays():
    """Its list of modes has the one that the address asks for, which comes with the whole picture."""
    data = page_data(content_of(gtb_cli.load(SPECS / "bicubic.toml"))) | {"quick": "quickly"}
    news = [{"version": k, "error": error, "data": data} for k, error in enumerate(("too thick", "", "x"), 2)]
    del news[0]["data"], news[2]["data"]
    script = (
        "const asked = []; let n; pause = async () => { turnedAt = performance.now(); }; complain('');"
        "location.hash = { slice: () => ['mode', 'mean'] }; $('mode').replaceChildren = (...all) => n = all.length;"
        "present(data.pop()); return new Promise(done => { fetch = async address => {"
        "asked.push([address.includes('quick'), $('error').textContent, $('working').hidden, version]);"
        "if (asked.length > data.length) done([n, modes(), state.mode, ...asked]);"
        "return { json: async () => data[asked.length - 1] }; }; watch(1); })"
    )
    told = [["", False, 1], ["too thick", True, 1], ["", False, 2], ["x", True, 2]]
    assert answer(script, *news, data) == [2, ["shaded", "mean"], "mean", *([True, *each] for each in told)]


def test_a_model_that_leaves_the_window_or_becomes_small_is_fitted_again_unless_the_user_has_zoomed():
    def tower(height: float, scale: float = 1.0) -> dict[str, Any]:
        points = scale * np.array([[0, 0, 0], [1, 0, 0], [0, 1, height]])
        return page_data(content_of(Patch([[0, 0], [1, 0], [0, 1]], points, [1, 1, 1])))

    low, others = tower(1), [tower(1.05), tower(2.4), tower(1, 0.32)]
    script = (
        "Object.assign(canvas, { clientWidth: 800, clientHeight: 600 });"
        "return [false, true].map(own => data.slice(1).map(each => { present(data[0]); fit(); set({ azimuth: -50 });"
        "present(data[1]);"
        "if (own) zoomAt(400, 300, 1.03); const { zoom } = state, old = scene.size; present(each);"
        "return [state.zoom / (zoom * scene.size / old), strays(), state.azimuth]; }))"
    )
    fitted, kept = answer(script, low, *others)
    assert [(round(row[0], 9) == 1, *row[1:]) for row in fitted] == [(k == 0, False, -50) for k in range(3)]
    assert [(round(row[0], 9), *row[1:]) for row in kept] == [(1, False, -50), (1, True, -50), (1, True, -50)]


def test_lines_of_a_net_to_far_points_are_left_out():
    far = Patch([[0, 0], [1, 0], [0, 1], [0.5, 0.25]], [[0, 0, 0], [1, 0, 0], [0, 1, 0], [999, 0, 0]], [1, 1, 1, 1e-9])
    script = (
        "present(data[0]); return [scene.lines.net.length, decoded(data[0].lines.net, Uint32Array).length, scene.facts]"
    )
    left, there, facts = answer(script, page_data(content_of(far)))
    assert (left, there) == (6, 12)
    assert facts.endswith("the control net without its farthest points")
    near = page_data(content_of(far.replace(control_points=far.control_points / [999, 1, 1])))
    left, there, facts = answer(script, near)
    assert (left, there, "farthest" in facts) == (12, 12, False)


def test_names_of_edges_stay_in_the_window_and_do_not_cover_each_other():
    data = page_data(content_of(gtb_cli.load(SPECS / "bicubic.toml")))
    assert [len(data["edges"]["names"]), *data["edges"]["names"][:2]] == [4, "edge 0", "edge 1"]
    script = (
        "Object.assign(canvas, { clientWidth: 800, clientHeight: 600 }); const all = [];"
        "ids.labels = any({ children: all, append: x => all.push(x) });"
        "document.createElement = () => any({ offsetWidth: 80, offsetHeight: 20 }); present(data[0]);"
        "return [0.001, 1, 5].map(zoom => { Object.assign(state, { names: true, zoom }); markNames();"
        "return all.filter(s => !s.hidden).map(s => [parseFloat(s.style.left), parseFloat(s.style.top)]); });"
    )
    one, some, beyond = answer(script, data)
    assert (len(one), len(some), len(beyond)) == (1, 4, 4)
    assert all(40 <= x <= 760 and 10 <= y <= 590 for x, y in beyond)
