"""Pictures in Python: names and numbers are checked, and `what` is what is drawn."""

import ast
import re
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from gtb_cli import DomainError, check, degeneration, regular_decomposition
from gtb_cli.plots.look import Camera, Look
from tests.marks import long, mostly_long
from tests.patches import cubic_curve, pentagon
from tests.shell import SPECS, gtb
from tests.specs import load

FAULTS = re.findall(
    r"^(\{.*)\n> (.*)$", (Path(__file__).parent / "faults.txt").read_text(encoding="utf-8"), re.MULTILINE
)


@pytest.mark.parametrize(("options", "message"), FAULTS)
def test_names_and_numbers_of_a_picture_are_checked(options, message):
    with pytest.raises(DomainError, match=message):
        pentagon().plot(**ast.literal_eval(options))
    with pytest.raises(DomainError, match="camera: expected 2 numbers"):
        pentagon().plot(camera=(1, float("nan")))


def test_an_unknown_picture_is_refused_of_models_and_curves_too():
    for shape in (load(SPECS / "teapot.toml"), cubic_curve()):
        with pytest.raises(DomainError, match="what: expected curve"):
            shape.plot(what="nonsense")


def test_a_camera_may_be_a_pair():
    assert Look(camera=(20, 50)).camera == Look(camera=np.array([20.0, 50.0])).camera == Camera(20.0, 50.0)


@long
def test_a_sequence_and_its_distances_are_drawn():
    """Of the patch's own lifting: panels for three x and the limit; distances as measured."""
    patch = cubic_curve().replace(lifting=[0.0, 1.0, 0.0, 0.0])
    panels = patch.plot(what="sequence", resolution=2).figure.axes
    assert [ax.get_title() for ax in panels] == ["x = 1", "x = 10", "x = 100", "limit"]
    x, distances = patch.plot(what="distance", resolution=2).get_lines()[0].get_data()
    assert (x[0], x[-1]) == (1, 10**4)
    np.testing.assert_allclose(distances, degeneration(patch, x, resolution=2).distances[:-1], rtol=1e-9)
    steps = patch.plot(what="distance", merge={1: 2}, steps=[0, 0.75], resolution=2)
    assert [*steps.lines[0].get_xdata()] == [1, 0.25]


def test_a_sequence_is_of_a_patch_with_a_lifting_and_makes_its_own_figure():
    for shape, ax, message in (
        (load(SPECS / "teapot.toml"), None, "`what` sequence is for one"),
        (pentagon().replace(lifting=np.arange(len(pentagon().knots))), Figure().add_subplot(), "figure of its own"),
        (pentagon(), None, "lifting"),
        (pentagon(), Figure().add_subplot(projection="polar"), "expected axes as of figure.add_subplot"),
    ):
        with pytest.raises((DomainError, ValueError), match=message):
            shape.plot(ax, what="sequence")


def test_graphs_of_basis_functions_are_no_finer_than_pixels(monkeypatch):
    from gtb_cli.plots import bases

    asked = []
    tessellate = bases.tessellate
    monkeypatch.setattr(bases, "tessellate", lambda *args, **how: asked.append(args[1]) or tessellate(*args, **how))
    patch = pentagon()
    patch.plot(what="basis", size=(1.0, 1.0), dpi=40, resolution=1000)
    assert asked == [int(np.ceil(40 / len(patch.knots) ** 0.5))]


def test_one_function_of_a_surface_is_drawn_on_given_axes():
    ax = Figure(dpi=30).add_subplot()
    assert pentagon().plot(ax, "basis", index=3, resolution=2) is ax
    assert len(ax.images) == 1
    with pytest.raises(DomainError, match="ax: 'basis' makes a figure of its own"):
        pentagon().plot(ax, "basis", index=(3, 4))


@pytest.mark.parametrize("what", mostly_long(["basis", "surface"]))
def test_a_number_of_a_surface_varies_in_panels_of_one_scale(what):
    axes = pentagon().plot(what=what, vary={"weights[3]": [1, 50]}, resolution=4, size=(4, 2), dpi=30).figure.axes
    assert [ax.get_title().split(":")[0] for ax in axes] == ["ω₃ = 1", "ω₃ = 50"]
    assert axes[0].get_xlim() == axes[1].get_xlim()
    one, other = (np.asarray(ax.images[0].get_array()) for ax in axes)
    assert (one != other).any()


def test_before_a_knot_moves_the_net_is_the_patchs_own():
    patch = pentagon().replace(weights=np.arange(1.0, 9))
    axes = patch.plot(merge={3: 1}, steps=[0, 0.5], resolution=2, size=(6, 2), dpi=30).figure.axes
    assert [ax.get_title() for ax in axes] == ["step = 0", "step = 0.5", "limit"]
    counts = [sum(len(line.get_xdata()) for line in ax.get_lines()) for ax in axes]
    assert counts == [8, 7, 7]  # control points


@long
def test_a_film_shows_each_mesh_once(tmp_path):
    films = [tmp_path / f"{name}.gif" for name in "ab"]
    for film in films:
        gtb("plot", SPECS / "example-3.4.toml", "-x", 2, "-x", 9, "--size", "2,1", "-o", film, status=0)
    assert films[0].read_bytes() == films[1].read_bytes()
    with Image.open(films[0]) as image:
        assert (image.n_frames, image.size) == (3, (300, 150))
        pictures = []
        for number in range(3):
            image.seek(number)
            pictures.append(np.asarray(image.convert("RGB")).copy())
    assert all((one != other).any() for one, other in pairwise(pictures))


def test_decompositions_domains_and_reports_show_themselves():
    knots = np.array([[0, 0], [4, 0], [0, 2], [1, 1], [1, 0.5]]) * 1e9 + 1e7
    found = regular_decomposition(knots, [0, 0, 0, 2, 0])
    picture = ElementTree.fromstring(found._repr_html_())
    polygons, spots = ([*picture.iter(f"{{http://www.w3.org/2000/svg}}{kind}")] for kind in ("polygon", "circle"))
    assert (len(polygons), len(spots)) == (3, 5)
    assert [spot.get("fill") == "white" for spot in spots] == [i in found.absent for i in range(5)]
    x, y = (np.array([float(spot.get(key)) for spot in spots]) for key in ("cx", "cy"))
    np.testing.assert_allclose(np.column_stack([x - x[0], y[0] - y]), (knots - knots[0]) * 55e-9, atol=0.11)
    for shape in (pentagon(), cubic_curve()):
        domain = ElementTree.fromstring(shape.domain._repr_html_())
        assert len([*domain.iter("{http://www.w3.org/2000/svg}circle")]) == len(shape.knots)
    report = check(cubic_curve().replace(name="<b>"))
    table = ElementTree.fromstring(report._repr_html_())
    assert table.find("caption").text.startswith("<b>: ")
    assert [row[1].text for row in table.find("tbody")] == [found.name for found in report.findings]
