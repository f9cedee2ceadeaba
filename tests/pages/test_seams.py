"""Normals at seams: two squares that meet at an angle, in every output."""

import base64
import io
import math
import re

import numpy as np
import pytest
import trimesh

from gtb_cli import Mesh, Model, Patch, read_mesh, tessellate, write_mesh
from gtb_cli.formats.export import warnings_for
from gtb_cli.meshes.shading import facet_normals
from gtb_cli.pages.page import page_data
from gtb_cli.pages.page_scene import content_of, content_of_mesh
from gtb_cli.tessellation.recipe import Recipe
from tests.marks import mostly_long
from tests.shell import SPECS
from tests.specs import load
from tests.surfaces import assert_closed

ANGLES = (0, 1, 30, 90)
SIDES = 4  # segments of each edge
UNIT = 1e-6  # a few roundings of 32-bit numbers


def bent(angle: float) -> Model:
    """Two unit squares that meet at x = 0, the second turned down from flat by an angle in degrees."""
    a = math.radians(angle)
    far = np.array([math.cos(a), 0, -math.sin(a)])
    left = Patch([[0, 0], [1, 0], [0, 1], [1, 1]], [[-1, 0, 0], [0, 0, 0], [-1, 1, 0], [0, 1, 0]], name="left")
    points = [[0, 0, 0], far, [0, 1, 0], far + np.array([0, 1, 0])]
    right = Patch([[0, 0], [1, 0], [0, 1], [1, 1]], points, name="right")
    return Model((left, right), name="bent")


def own(angle: float) -> np.ndarray:
    """(2, 3) normals of the two squares."""
    a = math.radians(angle)
    return np.array([[0, 0, 1.0], [math.sin(a), 0, math.cos(a)]])


def written(mesh: Mesh, kind: str) -> bytes:
    file = io.BytesIO()
    write_mesh(mesh, file, kind, normals=True)
    return file.getvalue()


@pytest.mark.parametrize("angle", ANGLES)
def test_a_mesh_has_each_patch_s_normals_at_its_corners(angle):
    mesh = tessellate(bent(angle), SIDES)
    seam = SIDES + 1
    assert (len(mesh.vertices), len(mesh.normals)) == (45, 45 + (seam if angle else 0))
    assert mesh.exact_normals
    for (_, start, stop), normal in zip(mesh.groups, own(angle), strict=True):
        expected = np.broadcast_to(normal, (stop - start, 3, 3))
        np.testing.assert_allclose(mesh.normals[mesh.normal_of[start:stop]], expected, atol=1e-12)
    assert mesh.largest_split == pytest.approx(angle, abs=1e-9)
    split = mesh.split
    assert (split.vertices[split.cells] == mesh.vertices[mesh.cells]).all()
    assert (split.normals[split.cells] == mesh.normals[mesh.normal_of]).all()


@pytest.mark.parametrize("angle", ANGLES)
def test_obj_refers_to_several_normals_of_one_vertex(angle):
    text = written(tessellate(bent(angle), SIDES), "obj").decode()
    normals = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("vn ")], dtype=float)
    assert sum(line.startswith("v ") for line in text.splitlines()) == 45
    groups = re.split(r"(?m)^g .*$", text)[1:]
    for lines, normal in zip(groups, own(angle), strict=True):
        corners = np.array(re.findall(r"(\d+)//(\d+)", lines), dtype=int)
        assert len(corners) == 3 * 2 * SIDES**2
        np.testing.assert_allclose(normals[corners[:, 1] - 1], normal + np.zeros((len(corners), 3)), atol=1e-8)
    assert (corners[:, 0] != corners[:, 1]).any() == bool(angle)


@pytest.mark.parametrize("angle", ANGLES)
def test_nodes_of_glb_have_their_own_normals(angle):
    scene = trimesh.load_scene(io.BytesIO(written(tessellate(bent(angle), SIDES), "glb")), "glb", process=False)
    for name, normal in zip(("left", "right"), own(angle), strict=True):
        node = scene.geometry[name]
        assert len(node.vertices) == (SIDES + 1) ** 2
        x, y, z = normal
        np.testing.assert_allclose(node.vertex_normals, [[x, z, -y]] * 25, atol=UNIT)


@pytest.mark.parametrize("angle", ANGLES)
def test_ply_has_the_mean_and_says_so(angle):
    mesh = tessellate(bent(angle), SIDES)
    read = trimesh.load(io.BytesIO(written(mesh, "ply")), "ply", process=False)
    mean = own(angle).sum(axis=0) / np.linalg.norm(own(angle).sum(axis=0))
    seam = np.abs(mesh.vertices[:, [0, 2]]).max(axis=1) < 1e-12
    assert seam.sum() == SIDES + 1
    np.testing.assert_allclose(read.vertex_normals[seam], np.zeros((SIDES + 1, 3)) + mean, atol=UNIT)
    said = [text for text in warnings_for(mesh, "ply", normals=True) if "several" in text]
    assert [text.split("up to ")[1].split(" ")[0] for text in said] == ([f"{angle}"] if angle > 1 else [])


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("source", ["spec", "file"])
def test_pages_shade_each_side_by_itself(angle, source):
    """A file has no normals: below 35 degrees its triangles look like one smooth surface."""
    mesh = tessellate(bent(angle), SIDES)
    if source == "spec":
        content = content_of(bent(angle), Recipe(SIDES))
    else:
        content = content_of_mesh(Mesh(mesh.vertices, mesh.cells), "file")
    data = page_data(content)
    positions, normals = (
        np.frombuffer(base64.b64decode(data["frames"][0][name]), "<f4").reshape(-1, 3)
        for name in ("positions", "normals")
    )
    cells = np.frombuffer(base64.b64decode(data["cells"]), "<u2").reshape(-1, 3)
    assert len(positions) == len(normals) == 45 + (5 if angle > (0 if source == "spec" else 35) else 0)
    assert data["facts"].startswith("64 triangles")
    wanted = np.repeat(own(angle), 32, axis=0)[:, None]
    error = np.abs(normals[cells] - wanted).max(axis=(1, 2))
    assert (error > UNIT).any() == (source == "file" and angle in (1, 30))
    assert base64.b64decode(data["lines"]["folds"]) == b""


@pytest.mark.parametrize("angle", mostly_long(ANGLES[::-1], 2))
@pytest.mark.parametrize("source", mostly_long(["file", "spec"]))
def test_pictures_shade_each_side_by_itself(angle, source):
    """From above, all pixels of a side have one colour."""
    thing = bent(angle) if source == "spec" else tessellate(bent(angle), SIDES, normals=False)
    resolution = SIDES if source == "spec" else None
    ax = thing.plot(size=(2, 2), dpi=100, camera=(20, 50), net=False, resolution=resolution)
    image = np.asarray(ax.get_images()[0].get_array())
    colours = np.unique(image[image[..., 3] == 255][:, :3], axis=0)
    smooth = source == "file" and angle == 30
    assert len(colours) > 20 if smooth else len(colours) < 20


def test_a_solid_has_sharp_rims_and_stays_closed():
    mesh, _ = Recipe(SIDES, thickness=0.1, normals=True).mesh(bent(90))
    assert_closed(mesh)
    assert not mesh.exact_normals
    facets = facet_normals(mesh.vertices, mesh.cells)
    np.testing.assert_allclose(mesh.normals[mesh.normal_of], facets.vectors[facets.corners], atol=1e-9)
    data = page_data(content_of_mesh(mesh, "solid"))
    assert base64.b64decode(data["lines"]["folds"]) == base64.b64decode(data["lines"]["open"]) == b""


def test_a_page_of_a_written_solid_is_closed_and_has_no_folds(tmp_path):
    """A GLB has a node for each patch, and STL has each triangle by itself."""
    mesh, _ = Recipe(6, thickness=0.1).mesh(bent(60))
    for kind in ("glb", "stl", "obj", "ply"):
        path = tmp_path / f"solid.{kind}"
        write_mesh(mesh, path)
        content = content_of_mesh(read_mesh(path), "solid")
        counts = {name: len(lines) for name, lines in content.lines.items() if name != "border"}
        assert counts == {"open": 0, "folds": 0, "net": 0}
        assert "open" not in page_data(content)["facts"]


def test_normals_turn_where_edges_are_sharper_than_35_degrees():
    for angle in (34.0, 36.0):
        mesh = tessellate(bent(angle), SIDES, normals=False)
        normals = facet_normals(mesh.vertices, mesh.cells)
        assert len(normals.vectors) == (45 if angle < 35 else 50)
        assert np.abs(np.linalg.norm(normals.vectors, axis=1) - 1).max() < 1e-12


def test_a_smooth_joint_has_one_normal_a_vertex():
    """So has a vertex without normals in several patches, where the means of their facets agree."""
    for name in ("teapot", "rounded-cube", "box-corner"):
        mesh = tessellate(load(SPECS / f"{name}.toml"), 3)
        assert len(mesh.normals) == len(mesh.vertices)
        assert warnings_for(mesh, "obj", normals=True) == []
    mesh = tessellate(bent(90), SIDES)
    assert any("meshio" in text for text in warnings_for(mesh, "obj", normals=True))
