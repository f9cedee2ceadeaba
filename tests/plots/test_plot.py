"""`gtb plot`."""

import io
import re
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import gtb_cli
from gtb_cli.plots.look import Camera
from gtb_cli.plots.palette import OPEN, TWO_SIDED, scale_of
from gtb_cli.plots.scene import ShadedTriangles, plain, space_views
from gtb_cli.vocabulary import COLOUR_MAPS
from tests.marks import long, mostly_long
from tests.plots.images import near, pixels
from tests.shell import PENTAGON, SPECS, environment, gtb, process

SMALL = ("--size", "2.4,1.8", "--dpi", "60", "-n", "6")


def png(*arguments: object) -> np.ndarray:
    return pixels(gtb("plot", *arguments, status=0).out)


ALL = sorted(path.name for path in SPECS.glob("*.toml"))
SHOWN = ["example-3.1.toml", "pentagon.toml", "bezier-triangle.toml"]


def kinds(name: str) -> list[str]:
    """What there is to draw of a spec."""
    text = (SPECS / name).read_text(encoding="utf-8")
    if "[[patches]]" in text:
        return ["surface"]
    what = ["curve" if "knots = [0" in text else "surface", "basis", "domain"]
    return what + ["decomposition"] * ("\nlifting" in text)


@pytest.mark.parametrize(
    ("name", "what"),
    [(name, what) for name in SHOWN for what in kinds(name)]
    + mostly_long([(name, kinds(name)[k % len(kinds(name))]) for k, name in enumerate(ALL) if name not in SHOWN], 0),
)
def test_every_spec_is_drawn(name, what):
    image = png(SPECS / name, "--what", what, *SMALL)
    assert image.shape == (108, 144, 3)
    assert (image != 255).any(axis=2).mean() > 0.02
    assert (image == 255).all(axis=2).mean() > 0.2


@pytest.mark.parametrize(
    ("name", "what", "width"),
    [
        ("cubic-bezier", "domain", 6),
        *mostly_long([("hexagon", "basis", 4), ("hexagon", "domain", 6), ("pentagon", "decomposition", 4)], 0),
    ],
)
def test_texts_do_not_cover_each_other(name, what, width):
    figure = gtb_cli.load(SPECS / f"{name}.toml").plot(what=what, size=(width, 0.75 * width), dpi=100).figure
    FigureCanvasAgg(figure).draw()
    texts = [text for ax in figure.axes for text in (*ax.texts, ax.title) if text.get_text()]
    assert len(texts) > 3
    boxes = [text.get_window_extent() for text in texts]
    for text, one in zip(texts, boxes, strict=True):
        others = [other.get_text() for other, box in zip(texts, boxes, strict=True) if box.overlaps(one)]
        assert others == [text.get_text()]
        assert one.x0 > 0
        assert one.x1 < 100 * width


@pytest.mark.parametrize("kind", mostly_long(["png", "svg", "pdf"], 2))
def test_the_same_bytes_again(kind, tmp_path):
    once, again = tmp_path / f"a.{kind}", tmp_path / f"b.{kind}"
    for path in (once, again):
        assert gtb("plot", SPECS / "example-3.1.toml", "-o", path).status == 0
    assert once.read_bytes() == again.read_bytes()
    assert b"20" + b"26" not in once.read_bytes()  # no date


def test_svg_has_text_and_a_shading_that_is_an_image():
    text = gtb("plot", SPECS / "pentagon.toml", "-f", "svg", *SMALL).text
    assert ">b₃</text>" in text
    assert text.count("<image") == 1
    assert len(text) < 100_000


@long
def test_no_window_is_asked_for(tmp_path):
    result = process("plot", PENTAGON, *SMALL, "-o", tmp_path / "x.png", MPLBACKEND="nonsense")
    assert (result.status, (tmp_path / "x.png").exists()) == (0, True), result.err


@long
def test_open_edges_of_a_model_are_red_and_those_of_a_patch_are_not():
    box, named = (png(SPECS / "box-corner.toml", "--camera", "40,28", *SMALL, *more) for more in ((), ["--labels"]))
    assert 60 < near(box, OPEN).sum() != near(named, OPEN).sum()
    names = re.findall(">(edge .)<", gtb("plot", PENTAGON, "--labels", "-f", "svg").text)
    assert names == [f"edge {k}" for k in range(5)]


def test_names_stay_inside_the_frame_and_do_not_cover_each_other():
    figure = Figure(figsize=(2, 2), dpi=100)
    (view,) = space_views([figure.add_axes((0, 0, 1, 1))], Camera(), [None], [np.eye(3)])
    places = [view.seen(point)[:2] for point in (*np.eye(3), np.eye(3)[0])]
    view.names(["a long name of a patch", "b" * 20, "c", "d"], places)
    boxes = [text.get_window_extent() for text in view.ax.texts]
    assert [text.get_text()[0] for text in view.ax.texts] == ["a", "b", "c"]
    assert all(box.min.min() >= -1 and box.max.max() <= 201 for box in boxes)
    assert not near(png(SPECS / "pentagon.toml", *SMALL), OPEN).any()


def test_a_solid_is_drawn_where_a_thickness_or_a_radius_is_given():
    for spec, option in (("bicubic", "--thickness=1"), ("cubic-bezier", "--radius=0.3")):
        plain, solid = (png(SPECS / f"{spec}.toml", *SMALL, *more) for more in (["--no-net"], [option]))
        assert (solid < 255).any(axis=2).mean() > 1.2 * (plain < 255).any(axis=2).mean()


def test_an_edge_behind_a_surface_does_not_poke_out_where_it_ends():
    ax = Figure(figsize=(3, 3)).add_axes((0, 0, 1, 1))
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    surface = ShadedTriangles(square, np.array([[0, 1, 2], [0, 2, 3]]), None, plain(2))
    (view,) = space_views([ax], Camera(-60, 45), [surface])
    view.lines([np.array([[0.5, 0.5, 0], [0.5, 0.5, -0.5]]), np.array([[0.5, 0.5, 0], [0.5, 0.5, 0.5]])])
    (above,) = ax.collections[0].get_segments()
    assert np.ptp(above, axis=0).max() > 0.1


def test_an_absent_knot_is_hollow():
    image = png(SPECS / "example-3.4.toml", "--what", "decomposition", "--no-labels", "--size", "4,3", "--dpi", "100")
    # The knots lie on the floor: four filled dots and, second from the left, a hollow one.
    floor = 300 - 47
    dark = (image.max(axis=2) < 90)[floor - 6 : floor + 7]
    columns = [62 + 0.07 / 1.14 * 322 + x * 322 / 1.14 for x in (0, 2**0.5 / 4, 0.5, 2**0.5 / 2, 1)]
    filled = [bool(dark[5:8, round(x) - 1 : round(x) + 2].all()) for x in columns]
    assert filled == [True, False, True, True, True]
    assert dark[:, round(columns[1]) - 6 : round(columns[1]) + 7].any()


def test_axes_in_the_plane_hold_all_knots():
    knots = np.array([[9, 0], [12, 0], [9, 1]])
    ax = gtb_cli.plot(gtb_cli.Patch(knots, np.eye(3)), what="domain")
    low, high = np.transpose([ax.get_xlim(), ax.get_ylim()])
    assert ((low < knots) & (knots < high)).all()


def test_curvature_has_a_scale_with_zero_in_its_middle():
    image = png(SPECS / "bicubic.toml", "--curvature", "mean", "--no-net", *SMALL)
    purple, orange = near(image, "#542788", 60), near(image, "#b35806", 60)
    assert purple.sum() > 20
    assert orange.sum() > 20
    low, high = scale_of(np.array([-1.0, 0.2, 3.0] * 100), "PuOr")
    assert low == -high == -3.0


QUARTER_PIPE = """\
knots = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]
weights = [1, "sqrt(2)", 1, 1, "sqrt(2)", 1]
control_points = [[0, -1, 0], [0, -1, 1], [0, 0, 1], [2, -1, 0], [2, -1, 1], [2, 0, 1]]
"""


@long
def test_stripes_are_lamps_in_a_mirror(tmp_path):
    spec = tmp_path / "pipe.toml"
    spec.write_text(QUARTER_PIPE, encoding="utf-8")
    image = png(spec, "--what", "stripes", "--camera=-90,0", "--size", "4,3", "--dpi", "150", "-n", "8")
    column = image[:, 300, 0].astype(int)
    high, low = np.flatnonzero(column < 250)[[0, -1]]
    assert low - high > 100
    inside = column[high + 4 : low - 3] > 100  # without the outline, which covers the uppermost dark stripe
    starts, ends = np.flatnonzero(np.diff(inside.astype(int)))[:14].reshape(7, 2).T
    heights = (low - (high + 4 + (starts + ends) / 2)) / (low - high)
    # A normal that rises by a mirrors what is 90° - 2a from the zenith, where each eighth of 90° has a lamp.
    turned = np.radians(90 * np.arange(7, 0, -1) / 8)
    assert np.abs(heights - (np.sin(turned - np.pi / 64) + np.sin(turned + np.pi / 64)) / 2).max() < 0.01


def test_no_line_hides_a_seam_of_stripes(tmp_path):
    flat = tmp_path / "flat.toml"
    flat.write_text(
        "".join(
            f"[[patches]]\nknots = [[0, 0], [1, 0], [0, 1], [1, 1]]\n"
            f"control_points = [[{x}, 0, 0], [{x + 1}, 0, 0], [{x}, 1, 0], [{x + 1}, 1, 0]]\n"
            for x in (0, 1)
        ),
        encoding="utf-8",
    )
    inside = png(flat, "--what", "stripes", "--camera", "-90,90", *SMALL)[45:63, 30:114]
    assert len(np.unique(inside)) == 1
    assert len(np.unique(png(flat, "--what", "surface", "--camera", "-90,90", *SMALL)[45:63, 30:114])) > 1


@pytest.mark.usefixtures("measured_roughly")
@long
def test_a_sequence_has_a_panel_for_each_x():
    text = gtb("plot", SPECS / "example-3.4.toml", "-x", "2", "-x", "8", "-f", "svg").text
    assert [title in text for title in (">x = 2<", ">x = 8<", ">limit<")] == [True] * 3


def test_a_film_is_drawn():
    options = ("--merge", "3:1", "--steps", "0.9", "--camera", "15,25", "-n", "4", "--size", "3,2", "--dpi", "60")
    image = png(SPECS / "example-4.2.toml", *options)
    orange = (image[..., 0] > 1.5 * image[..., 2].astype(int)) & (image[..., 0] > 60)
    half = image.shape[1] // 2
    assert orange[:, half:].sum() > 30
    assert not orange[:, :half].any()


def test_the_last_frame_of_a_film_is_the_limit_and_stays():
    with Image.open(io.BytesIO(gtb("plot", SPECS / "example-4.4.toml", "-x5", *SMALL, "-f", "gif").out)) as film:
        frames = [(film.seek(k), film.info["duration"], np.asarray(film.convert("RGB")))[1:] for k in (0, 1)]
        assert film.n_frames == 2
    assert [(duration, image.any()) for duration, image in frames] == [(120, True), (1500, True)]


def test_anywhere_and_of_any_size_it_is_the_same_picture(tmp_path):
    text = "knots = [[0, 0], [1, 0], [0, 1]]\ncontrol_points = [[{0}, {0}, {0}], [{1}, {0}, {0}], [{0}, {1}, {1}]]\n"
    images = []
    for number, (scale, shift) in enumerate([(1, 0), (1e-9, 0), (1e9, 0), (1, 2**23)]):
        spec = tmp_path / f"{number}.toml"
        spec.write_text(text.format(shift, shift + scale), encoding="utf-8")
        images.append(png(spec, *SMALL).astype(int))
    for image in images[1:]:
        assert (np.abs(image - images[0]).max(axis=2) > 8).mean() < 0.002


def test_without_matplotlib_the_way_out_is_said(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = gtb("plot", SPECS / "pentagon.toml", "-o", tmp_path / "x.png", status=2)
    assert "pip install matplotlib" in result.err
    assert not list(tmp_path.iterdir())


def test_it_offers_the_maps_that_there_are():
    from matplotlib import colormaps

    assert set(TWO_SIDED) < set(COLOUR_MAPS) <= set(colormaps)


@long
def test_a_curve_needs_no_slow_packages(tmp_path):
    """Neither a window system nor what the import of figures does not need."""
    code = (
        "from gtb_cli.commands.cli import run; import sys; "
        f"run(['plot', {str(SPECS / 'example-3.1.toml')!r}, '-q', '-o', 'x.png']); print(*sys.modules, sep='\\n')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment(), capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert "matplotlib.figure" in loaded
    assert not loaded & {"matplotlib.pyplot", "tkinter", "scipy", "trimesh"}


@long
def test_a_plate_shows_all_decompositions_or_the_first_hundred():
    curve, pentagon = (gtb_cli.load(SPECS / f"{name}.toml") for name in ("example-3.4", "pentagon"))
    for patch, shown, title in (
        (curve, 27, "27 regular decompositions"),
        (pentagon.part(np.arange(7)), 100, "The first 100 of 221 regular decompositions"),
    ):
        figure = gtb_cli.plot(patch, what="decompositions").figure
        assert len(figure.axes) == shown
        assert [text.get_text() for text in figure.texts] == [title, *map(str, range(shown))]
    with pytest.raises(gtb_cli.DomainError, match="makes a figure of its own"):
        gtb_cli.plot(curve, gtb_cli.plot(curve), what="decompositions")
