"""`gtb view`: what a page holds; what it shows is in `test_browser`."""

import base64
import json
import re

import numpy as np
import pytest

import gtb_cli
from gtb_cli.meshes.measures import measure
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.pages.page import page_data
from gtb_cli.pages.page_scene import PAGE_TOLERANCE, content_of, content_of_mesh, sides
from gtb_cli.plots.shape_figures import with_normals
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.theory.patch import Patch
from tests.marks import long, mostly_long
from tests.shell import SPECS, gtb
from tests.surfaces import box


def data_of(page: str) -> dict:
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])


def floats(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(-1, 3)


def page(*arguments: object) -> dict:
    return data_of(gtb("view", *arguments, "-o", "-", status=0).text)


def test_vertices_and_normals_are_the_surfaces():
    data = page(SPECS / "pentagon.toml", "-n", "8")
    patch = gtb_cli.load(SPECS / "pentagon.toml")
    mesh = gtb_cli.tessellate(patch, 8, parametrization="linear")
    frame = data["frames"][0]
    cloud = np.concatenate([mesh.vertices, patch.control_points])
    middle, size = (cloud.min(axis=0) + cloud.max(axis=0)) / 2, np.linalg.norm(np.ptp(cloud, axis=0))
    np.testing.assert_allclose(floats(frame["positions"]) * size + middle, mesh.vertices, atol=1e-6)
    np.testing.assert_allclose(floats(frame["normals"]), mesh.normals, atol=1e-6)
    np.testing.assert_allclose(floats(frame["net"]) * size + middle, patch.control_points, atol=1e-6)
    assert data["knots"]["names"][3] == "a₃ = (1.14286, 1.14286), ω = 7"


def test_a_name_like_a_place_of_the_template_is_a_title(tmp_path):
    for name in ("@SCRIPT@", "@DATA@"):
        (tmp_path / f"{name}.toml").write_bytes((SPECS / "bicubic.toml").read_bytes())
        text = gtb("view", tmp_path / f"{name}.toml", "-n", "2", "-o", "-", status=0).text
        assert f"<title>{name}</title>" in text
        assert data_of(text)["frames"]


def test_it_needs_no_network_and_is_the_same_again():
    text = gtb("view", SPECS / "bicubic.toml", "-n", "4", "-o", "-").text
    assert text == gtb("view", SPECS / "bicubic.toml", "-n", "4", "-o", "-").text
    assert not re.findall(r"https?://(?!www\.w3\.org)|src=|@import|url\(", text)
    assert "default-src 'none'" in text
    assert len(re.search(r"<script>(.*)</script>", text, re.DOTALL)[1]) < 60_000


@long
def test_a_teapot_with_its_net_is_below_two_megabytes():
    text = gtb("view", SPECS / "teapot.toml", "-o", "-").text
    assert len(text) < 2_000_000
    assert len(data_of(text)["groups"]) == 32


@pytest.mark.parametrize(("scale", "shift"), mostly_long([(1.0, 1e7), (1e-9, 0.0), (1e9, 0.0)]))
def test_size_and_place_change_nothing(scale, shift):
    patch = gtb_cli.load(SPECS / "pentagon.toml")
    moved = gtb_cli.Patch(patch.knots, patch.control_points * scale + shift, patch.weights)
    one, other = (data_of(gtb_cli.page(shape))["frames"][0] for shape in (patch, moved))
    for key in ("positions", "normals", "net"):
        np.testing.assert_allclose(floats(one[key]), floats(other[key]), atol=2e-6)


def test_a_far_control_point_of_small_weight_leaves_the_surface_large():
    far = Patch([[0, 0], [1, 0], [0, 1], [0.5, 0.25]], [[0, 0, 0], [1, 0, 0], [0, 1, 0], [999, 0, 0]], [1, 1, 1, 1e-9])
    data = page_data(content_of(far))
    assert data["size"] == pytest.approx(2**0.5, rel=1e-5)
    assert floats(data["frames"][0]["net"]).max() > 600  # it is there all the same


def test_open_sides_and_patches_of_a_model():
    assert len(content_of(Model(box().patches[:5]), Recipe(2)).lines["open"]) == 2 * 4
    closed = content_of(gtb_cli.load(SPECS / "hebesphenorotunda.toml"), Recipe(1)).lines
    assert len(closed["open"]) == 0
    assert len(closed["border"]) > 0
    assert len(closed["folds"]) == 0


def test_a_fold_within_a_patch_is_marked():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.7, 0.01]])
    mesh = with_normals(gtb_cli.Mesh(vertices, np.array([[0, 1, 2], [2, 1, 3]])))
    assert sides(mesh, [("all", 0, 2)])["folds"].tolist() == [[1, 2, 0, 0]]
    lines = sides(mesh, [("one", 0, 1), ("other", 1, 2)])
    assert (lines["border"].tolist(), len(lines["folds"])) == ([[1, 2, 0, 1]], 0)


@pytest.mark.parametrize("name", ["bicubic", "hexagon"])
def test_what_a_screen_shows_is_smooth(name):
    """Edges are no farther from the surface than twice the tolerance, and not needlessly near."""
    patch = gtb_cli.load(SPECS / f"{name}.toml")
    found = content_of(patch)
    resolution = round((len(found.cells) / len(gtb_cli.tessellate(patch, 1).cells)) ** 0.5)
    mesh = gtb_cli.tessellate(patch, resolution)
    assert len(mesh.cells) == len(found.cells)
    ends = mesh.edges
    middle = patch.evaluate(mesh.parameters[ends].mean(axis=1), parametrization="linear")
    apart = np.abs(((middle - mesh.vertices[ends].mean(axis=1)) * mesh.normals[ends].mean(axis=1)).sum(axis=1)).max()
    size = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    assert 0.2 * PAGE_TOLERANCE < apart / size < 2 * PAGE_TOLERANCE


def test_a_page_shows_the_mesh_of_a_recipe_and_measures_it():
    spec = SPECS / "bicubic.toml"
    data = page(spec, "--thickness", "0.1", "-n", "6", "--unit", "in")
    mesh, remarks = Recipe(6, thickness=0.1).mesh(gtb_cli.load(spec))
    found = measure(mesh)
    measures = dict(data["measures"])
    assert measures["volume"] == f"{found.volume:.6g} in³"
    assert measures["surface"] == f"{found.area:.6g} in²"
    assert data["remarks"] == remarks
    assert (data["closed"], sorted(data["scalars"])) == (True, ["wall"])
    assert data["scalars"]["wall"]["high"] == pytest.approx(0.3)  # three times the thickness
    assert data["facts"] == f"{len(mesh.cells)} triangles"
    assert "volume" not in dict(page(spec, "-n", "6")["measures"])
    assert gtb_cli.page(gtb_cli.load(spec), Recipe(6, thickness=0.1)).count(data["cells"]) == 1
    tube = page(SPECS / "cubic-bezier.toml", "--radius", "0.1", "-n", "8")
    assert (tube["closed"], tube["curve"]) == (True, False)
    assert tube["scalars"]["wall"]["high"] == pytest.approx(0.4, rel=0.05)
    inwards = page_data(content_of_mesh(Mesh(mesh.vertices, mesh.cells[:, ::-1]), "inwards"))
    assert inwards["measures"][-1] == ("", "Its faces look inwards.")


def test_sequences_and_meshes(tmp_path):
    assert gtb("degenerate", SPECS / "example-3.4.toml", "-x", "2", "-n", "8", "-o", tmp_path / "s").status == 0
    data = page(tmp_path / "s")
    assert [frame["label"] for frame in data["frames"]] == ["x = 2", "limit"]
    for suffix in ("obj", "stl"):
        assert gtb("mesh", SPECS / "box-corner.toml", "-n", "2", "-o", tmp_path / f"m.{suffix}").status == 0
    data = page(tmp_path / "m.obj", tmp_path / "m.stl")
    assert data["groups"][0][0] == "m: hole"
    assert data["scalars"] == {}


def test_options_of_a_limit_make_a_sequence_with_exact_normals():
    data = page(SPECS / "bicubic.toml", "--lifting", "knot:5", "-x", "1", "-x", "9", "-n", "2")
    assert [frame["label"] for frame in data["frames"]] == ["x = 1", "x = 9", "limit"]
    patch = gtb_cli.load(SPECS / "bicubic.toml")
    lifting = [float(i == 5) for i in range(len(patch.knots))]
    weights = patch.weights * np.where(lifting, 9.0, 1.0)
    mesh = gtb_cli.tessellate(patch.replace(weights=weights), 40)
    sizes = [np.ptp(floats(frame["positions"]), axis=0) for frame in data["frames"]]
    extent = np.ptp(mesh.vertices, axis=0)
    np.testing.assert_allclose(sizes[1] / sizes[1][0], extent / extent[0], atol=0.05)
    data = page(SPECS / "example-4.2.toml", "--merge", "3:1", "--steps", "0,0.5", "-n", "2")
    assert [frame["label"] for frame in data["frames"]] == ["step = 0", "step = 0.5", "limit"]
    assert len(floats(data["frames"][0]["net"])) == 7


def test_python_draws_and_shows_itself():
    patch = gtb_cli.load(SPECS / "bicubic.toml")
    model = gtb_cli.load(SPECS / "box-corner.toml")
    mesh = gtb_cli.tessellate(patch, 3)
    for thing in (patch, model, mesh):
        text = thing._repr_html_()
        assert text.startswith("<iframe srcdoc=")
        assert text.count('"') == 4
    ax = patch.plot(what="domain")
    assert patch.plot(ax=ax, what="domain") is ax
    assert len(mesh.plot(dpi=40).images) == 1
    for thing, what in ((mesh, "domain"), (patch, "nothing")):
        with pytest.raises(gtb_cli.DomainError, match=f"'{what}'"):
            thing.plot(what=what)
