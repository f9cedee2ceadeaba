"""Parts from CAD programs, by Open CASCADE: faces and free edges are what the file says."""

import re
import sys

import numpy as np
import pytest

import gtb_cli
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.filling.part_holes import part_hole
from gtb_cli.filling.sides import points_and_tangents, stations
from gtb_cli.formats.cad_seams import uses_of_edges
from gtb_cli.importers.cad_files import face_pieces, kernel, parts, read_shape
from gtb_cli.importers.readers import import_data
from tests.marks import long
from tests.shell import SPECS, gtb


@pytest.mark.parametrize("kind", ["step", "iges", "brep"])
def test_faces_are_exact_patches(kind, tmp_path):
    given = gtb_cli.load_patch(SPECS / "bicubic.toml")
    gtb("mesh", SPECS / "bicubic.toml", "-o", tmp_path / f"x.{kind}", status=0)
    found = import_data(f"x.{kind}", (tmp_path / f"x.{kind}").read_bytes()).shape
    assert gtb_cli.distance(given, found).distance < 1e-9  # IGES has ten digits
    middle = [patch.domain.vertices.mean(axis=0) for patch in (given, found)]
    np.testing.assert_allclose(given.normals([middle[0]]), found.normals([middle[1]]), atol=1e-8)


def test_rectangles_have_the_orientation_of_their_faces():
    for face in parts(kernel("BRepPrimAPI").BRepPrimAPI_MakeBox(1, 1, 1).Shape(), "FACE"):
        (net,) = face_pieces(face)
        ways = [net[-1, 0] - net[0, 0], net[0, -1] - net[0, 0]]
        assert np.cross(ways[0][:3], ways[1][:3]) @ (net.mean(axis=(0, 1))[:3] - 0.5) > 0


def box_without_a_corner(radii):
    """A box of side 10 whose three edges at a corner are rounded, without the face where they meet."""
    room, each = kernel("BRepFilletAPI"), kernel("BRepPrimAPI").BRepPrimAPI_MakeBox(10, 10, 10).Shape()
    corner, maker, left = kernel("gp").gp_Pnt(10, 10, 10), room.BRepFilletAPI_MakeFillet(each), list(radii)
    for edge in parts(each, "EDGE"):
        curve = kernel("BRepAdaptor").BRepAdaptor_Curve(edge)
        ends = [curve.Value(at).Distance(corner) for at in (curve.FirstParameter(), curve.LastParameter())]
        if min(ends) < 1e-9 and left and not maker.Contour(edge):
            maker.Add(left.pop(), edge)
    shell, builder = kernel("TopoDS").TopoDS_Shell(), kernel("BRep").BRep_Builder()
    builder.MakeShell(shell)

    def away(face):
        measured = kernel("GProp").GProp_GProps()
        kernel("BRepGProp").BRepGProp.SurfaceProperties_s(face, measured)
        return measured.CentreOfMass().Distance(corner)

    for face in sorted(parts(maker.Shape(), "FACE"), key=away)[1:]:
        builder.Add(shell, face)
    return shell


def written(shape, folder):
    kernel("BRepTools").BRepTools.Write_s(shape, str(folder / "open.brep"))
    return folder / "open.brep"


@pytest.mark.parametrize(
    ("radii", "volume", "raises", "kind"),
    [
        ((2, 2, 2), 975.187, 0, "brep"),
        pytest.param((2, 2, 2), 975.587, None, "iges", marks=long),
        pytest.param((3, 2, 1), 971.06, None, "step", marks=long),
    ],
)
def test_a_filled_part_is_a_solid_with_smooth_seams(radii, volume, raises, kind, tmp_path):
    """The shape that the file holds is valid, and its seams are what the message says."""
    out = tmp_path / f"filled.{kind}"
    elevated = [] if raises is None else ["--elevate", raises]
    result = gtb("fill", written(box_without_a_corner(radii), tmp_path), *elevated, "-o", out, status=0)
    said = re.search(
        r"1 solid, seams to the part within (\S+) degrees and (\S+), between new faces (\S+) degr", result.err
    )
    assert [float(word) < most for word, most in zip(said.groups(), (1e-3, 1e-6, 1e-3), strict=True)] == [True] * 3
    assert float(said[1]) > 0
    assert out.stat().st_size < 250_000
    shape = read_shape(out.read_bytes(), kind, out.name)
    assert kernel("BRepCheck").BRepCheck_Analyzer(shape).IsValid()
    measured = kernel("GProp").GProp_GProps()
    kernel("BRepGProp").BRepGProp.VolumeProperties_s(shape, measured)
    assert measured.Mass() == pytest.approx(volume, abs=0.02)
    assert all(len(uses) == 2 for uses in uses_of_edges(shape).values()) or kind == "iges"


def test_a_cad_file_of_a_fill_keeps_what_is_asked_for_or_is_refused(tmp_path):
    part, out = written(box_without_a_corner((2, 2, 2)), tmp_path), tmp_path / "filled.step"
    result = gtb("fill", part, "--elevate", 0, "--angle", 1e-9, "-o", out, status=2)
    assert re.search(r"tangent planes of fitted surfaces still differ by \S+ degrees, more than 1e-09", result.err)
    assert not out.exists()
    near = gtb("fill", part, "--elevate", 0, "--angle", 1e-4, "-o", out, status=0)  # 1e-3 is had without
    assert max(float(word) for word in re.findall(r"(\S+) degrees and", near.err)) < 1e-4
    assert "are for an output that is a CAD file" in gtb("fill", part, "--tolerance", 1, status=2).err


def test_the_hole_of_a_part_has_its_edges_and_the_planes_of_its_faces():
    sides = part_hole(box_without_a_corner((2, 2, 2)), None)
    assert len(sides) == 3
    middle = np.mean([each.ends[0] for each in sides], axis=0)
    for side, following in zip(sides, [*sides[1:], sides[0]], strict=True):
        np.testing.assert_allclose(side.ends[1], following.ends[0], atol=1e-6)
        points, tangents = points_and_tangents(side.curve, stations())
        normals = np.cross(tangents, side.across)
        from_axis = points - 8  # of a fillet, whose normals have no part along the edge of the box
        from_axis[:, np.ptp(points, axis=0) < 1e-9] = 0
        np.testing.assert_allclose(np.cross(normals, from_axis), 0, atol=1e-6 * np.abs(normals).max())
        assert (from_axis * normals).sum(axis=1).min() > 0  # outwards
        assert ((middle - points) * side.across).sum(axis=1).min() > 0


def test_what_is_wrong_with_a_hole_is_said():
    part = box_without_a_corner((2, 2, 2))
    with pytest.raises(DomainError, match=r"^hole: expected a point x,y,z near a hole of the part, got 'wall'"):
        part_hole(part, "wall")
    with pytest.raises(DomainError, match=r"^hole: the part has no closed ring of edges with one face"):
        part_hole(kernel("BRepPrimAPI").BRepPrimAPI_MakeBox(1, 2, 3).Shape(), None)


@pytest.mark.parametrize("kind", ["step", "iges", "brep"])
def test_without_the_extra_a_line_names_it(kind, monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "OCP"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "OCP", None)
    with pytest.raises(SpecError, match=r"^x: .* needs Open CASCADE, the extra gtb-cli\[cad\]"):
        import_data("x", b"", kind)
