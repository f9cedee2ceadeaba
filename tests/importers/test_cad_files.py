"""Parts from CAD programs, by Open CASCADE: faces and free edges are what the file says."""

import sys

import numpy as np
import pytest

import gtb_cli
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.filling.part_holes import part_hole
from gtb_cli.filling.sides import points_and_tangents, stations
from gtb_cli.importers.readers import import_data
from gtb_cli.models.model import Model
from tests.marks import long
from tests.shell import SPECS, gtb


def part_without(index: int, kind: str, folder) -> bytes:
    """The rounded cube without one of its patches, as a part."""
    cube = gtb_cli.load_model(SPECS / "rounded-cube.toml")
    gtb_cli.save(Model(cube.patches[:index] + cube.patches[index + 1 :]), folder / "open.toml")
    gtb("mesh", folder / "open.toml", "-o", folder / f"open.{kind}", status=0)
    return (folder / f"open.{kind}").read_bytes()


@pytest.mark.parametrize("kind", ["step", "iges", "brep"])
def test_faces_are_exact_patches(kind, tmp_path):
    given = gtb_cli.load_patch(SPECS / "bicubic.toml")
    gtb("mesh", SPECS / "bicubic.toml", "-o", tmp_path / f"x.{kind}", status=0)
    found = import_data(f"x.{kind}", (tmp_path / f"x.{kind}").read_bytes()).shape
    assert gtb_cli.distance(given, found).distance < 1e-9  # IGES has ten digits
    middle = [patch.domain.vertices.mean(axis=0) for patch in (given, found)]
    np.testing.assert_allclose(given.normals([middle[0]]), found.normals([middle[1]]), atol=1e-8)


def test_the_hole_of_a_part_has_its_edges_and_the_planes_of_its_faces(tmp_path):
    cube = gtb_cli.load_model(SPECS / "rounded-cube.toml")
    index = next(k for k, patch in enumerate(cube) if patch.name == "top")
    sides = part_hole(part_without(index, "step", tmp_path), "step", "open.step", None)
    assert len(sides) == 4
    for side, following in zip(sides, [*sides[1:], sides[0]], strict=True):
        np.testing.assert_allclose(side.ends[1], following.ends[0], atol=1e-6)
        points, tangents = points_and_tangents(side.curve, stations())
        normals = np.cross(tangents, side.across)
        centre = np.mean([patch.control_points.mean(axis=0) for patch in cube], axis=0)
        assert ((points - centre) * normals).sum(axis=1).min() > 0  # they point outwards, as those of the cube
        middle = np.mean([each.ends[0] for each in sides], axis=0)
        assert ((middle - points) * side.across).sum(axis=1).min() > 0


@long
def test_a_missing_corner_is_filled(tmp_path):
    cube = gtb_cli.load_model(SPECS / "rounded-cube.toml")
    index = next(k for k, patch in enumerate(cube) if patch.name == "corner")
    part_without(index, "step", tmp_path)
    filling = gtb_cli.fill(tmp_path / "open.step")
    assert filling.fault is None
    assert filling.angle < 1e-3
    assert gtb_cli.distance(filling.patch, cube.patches[index]).distance < 1e-3


def test_what_is_wrong_with_a_hole_is_said(tmp_path):
    data = part_without(0, "brep", tmp_path)
    with pytest.raises(DomainError, match=r"^hole: expected a point x,y,z near a hole of the part, got 'wall'"):
        part_hole(data, "brep", "x.brep", "wall")
    gtb("mesh", SPECS / "rounded-cube.toml", "-o", tmp_path / "whole.brep", status=0)
    with pytest.raises(DomainError, match=r"^hole: the part has no closed ring of edges with one face"):
        part_hole((tmp_path / "whole.brep").read_bytes(), "brep", "x.brep", None)


@pytest.mark.parametrize("kind", ["step", "iges", "brep"])
def test_without_the_extra_a_line_names_it(kind, monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "OCP"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "OCP", None)
    with pytest.raises(SpecError, match=r"^x: .* needs Open CASCADE, the extra gtb-cli\[cad\]"):
        import_data("x", b"", kind)
