"""Pictures in Python: names and numbers are checked, and `what` is what is drawn."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from gtb_cli import DomainError, Patch
from gtb_cli.pictures.look import Camera, Look
from tests.marks import long
from tests.patches import bicubic, cubic_curve, pentagon
from tests.shell import SPECS
from tests.specs import load


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"what": "nonsense"}, "what: expected curve, surface, .* got 'nonsense'"),
        ({"camera": "above"}, "camera: expected a Camera, or azimuth and elevation, got 'above'"),
        ({"camera": (1, 2, 3)}, "camera: expected a Camera, or azimuth and elevation"),
        ({"camera": (1, float("nan"))}, "camera: expected a Camera, or azimuth and elevation"),
        ({"resolution": 0}, "resolution: expected a whole number of at least 1, got 0"),
        ({"resolution": True}, "resolution: expected a whole number of at least 1, got True"),
        ({"isolines": -1}, "isolines: expected a whole number of at least 0, got -1"),
        ({"curvature": "most"}, "curvature: expected one of gaussian, mean, got 'most'"),
        ({"colour_map": "jet"}, "colour_map: expected one of PuOr, .* got 'jet'"),
        ({"indices": (99,)}, "indices: are of basis functions, and this is a picture of a surface"),
        ({"view": "above"}, "options: expected some of size, .* got 'view'"),
    ],
    ids=str,
)
def test_names_and_numbers_of_a_picture_are_checked(options, message):
    with pytest.raises(DomainError, match=message):
        pentagon().plot(**options)


def test_an_unknown_picture_is_refused_of_models_and_curves_too():
    for shape in (load(SPECS / "teapot.toml"), cubic_curve()):
        with pytest.raises(DomainError, match="what: expected curve"):
            shape.plot(what="nonsense")


def test_a_camera_may_be_a_pair():
    assert Look(camera=(20, 50)).camera == Look(camera=np.array([20.0, 50.0])).camera == Camera(20.0, 50.0)


@pytest.mark.parametrize("patch", [bicubic(), cubic_curve()], ids=lambda patch: patch.name)
@long
def test_a_sequence_and_its_distances_are_drawn(patch: Patch):
    """Of the patch's own lifting: panels for three x and the limit; distances that fall."""
    patch = patch.replace(lifting=[0.0, 1.0, *[0.0] * (len(patch.knots) - 2)])
    panels = patch.plot(what="sequence", resolution=2).figure.axes
    assert [ax.get_title() for ax in panels] == ["x = 1", "x = 10", "x = 100", "limit"]
    ax = patch.plot(what="distance", resolution=2)
    x, distances = ax.get_lines()[0].get_data()
    assert (x[0], x[-1]) == (1, 10**4)
    assert (np.diff(distances) < 0).all()


def test_a_sequence_is_of_a_patch_with_a_lifting_and_makes_its_own_figure():
    for shape, ax, message in (
        (load(SPECS / "teapot.toml"), None, "`what` sequence is for one"),
        (pentagon().replace(lifting=np.arange(len(pentagon().knots))), Figure().add_subplot(), "figure of its own"),
        (pentagon(), None, "lifting"),
    ):
        with pytest.raises((DomainError, ValueError), match=message):
            shape.plot(ax, what="sequence")


def test_graphs_of_basis_functions_are_no_finer_than_pixels(monkeypatch):
    from gtb_cli.pictures import bases

    asked = []
    tessellate = bases.tessellate
    monkeypatch.setattr(bases, "tessellate", lambda *args, **how: asked.append(args[1]) or tessellate(*args, **how))
    from gtb_cli.pictures.figures import figure_of

    patch = pentagon()
    figure_of(patch, "basis", Look(size=(1.0, 1.0), dpi=40, resolution=1000))
    assert asked == [int(np.ceil(40 / len(patch.knots) ** 0.5))]
