"""Parts from CAD programs, by Open CASCADE: faces and free edges are what the file says."""

import json
import re
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import gtb_cli
from gtb_cli.cad import cad_writing
from gtb_cli.cad.bspline_surfaces import spline_surfaces
from gtb_cli.cad.cad_seams import along_edge
from gtb_cli.cad.cad_writing import encode_cad
from gtb_cli.cad.kinds_of_surfaces import encode_surfaces
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.filling.fill import filled
from gtb_cli.filling.holes import one_ring
from gtb_cli.filling.part_holes import Part, part_of
from gtb_cli.filling.sides import points_and_tangents, stations
from gtb_cli.importers import cad_files
from gtb_cli.importers.cad_files import edge_pieces, edge_uses, extent_of, face_forms, kernel, parts, read_shape
from gtb_cli.importers.readers import import_data
from tests.marks import long, mostly_long
from tests.shell import SPECS, gtb

pytestmark = pytest.mark.usefixtures("probed_here")


@pytest.mark.parametrize("kind", mostly_long(["brep", "step", "iges"]))
def test_faces_are_exact_patches(kind, tmp_path):
    given = gtb_cli.load_patch(SPECS / "bicubic.toml")
    gtb("mesh", SPECS / "bicubic.toml", "-o", tmp_path / f"x.{kind}", status=0)
    found = import_data(f"x.{kind}", (tmp_path / f"x.{kind}").read_bytes()).shape
    assert gtb_cli.distance(given, found).distance < 1e-9  # IGES has ten digits
    normals = [patch.normals([patch.domain.vertices.mean(axis=0)]) for patch in (given, found)]
    np.testing.assert_allclose(*normals, atol=1e-8)


def test_rectangles_have_the_orientation_of_their_faces():
    for face in parts(kernel("BRepPrimAPI").BRepPrimAPI_MakeBox(1, 1, 1).Shape(), "FACE"):
        (net,) = cad_files.face_pieces(face)
        ways = [net[-1, 0] - net[0, 0], net[0, -1] - net[0, 0]]
        assert np.cross(ways[0][:3], ways[1][:3]) @ (net.mean(axis=(0, 1))[:3] - 0.5) > 0
    torus = kernel("Geom").Geom_ToroidalSurface(kernel("gp").gp_Ax3(), 2, 1)
    more_than_a_turn = kernel("BRepBuilderAPI").BRepBuilderAPI_MakeFace(torus, -4e-13, 2 * np.pi, 0.5, 1, 1e-9)
    assert len(cad_files.face_pieces(more_than_a_turn.Face())) == 3


def box_without_a_corner(radii):
    """A box of side 10 whose three edges at a corner are rounded, without the face where they meet."""
    room, each = kernel("BRepFilletAPI"), kernel("BRepPrimAPI").BRepPrimAPI_MakeBox(10, 10, 10).Shape()
    corner, maker, left = kernel("gp").gp_Pnt(10, 10, 10), room.BRepFilletAPI_MakeFillet(each), list(radii)
    for edge in parts(each, "EDGE"):
        curve = kernel("BRepAdaptor").BRepAdaptor_Curve(edge)
        ends = [curve.Value(at).Distance(corner) for at in (curve.FirstParameter(), curve.LastParameter())]
        if min(ends) < 1e-9 and left and not maker.Contour(edge):
            maker.Add(left.pop(), edge)

    def away(face):
        measured = kernel("GProp").GProp_GProps()
        kernel("BRepGProp").BRepGProp.SurfaceProperties_s(face, measured)
        return measured.CentreOfMass().Distance(corner)

    return pile(sorted(parts(maker.Shape(), "FACE"), key=away)[1:])


def pile(faces):
    """A shell of faces."""
    shell, builder = kernel("TopoDS").TopoDS_Shell(), kernel("BRep").BRep_Builder()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face)
    return shell


def torus_with_a_hole():
    """A torus without what is in a ball, whose edges are splines that waver by 1e-6 of the size."""
    room = kernel("BRepPrimAPI")
    ball = room.BRepPrimAPI_MakeSphere(kernel("gp").gp_Pnt(9, 8, 2.5), 2).Shape()
    cut = kernel("BRepAlgoAPI").BRepAlgoAPI_Cut(room.BRepPrimAPI_MakeTorus(10, 3).Shape(), ball).Shape()
    return pile([min(parts(cut, "FACE"), key=lambda face: -extent_of(face, "Surface"))])


def written(shape, folder):
    kernel("BRepTools").BRepTools.Write_s(shape, str(folder / "open.brep"))
    return folder / "open.brep"


@pytest.mark.parametrize(
    ("radii", "volume", "elevated", "kind", "size"),
    mostly_long(
        [
            ((2,) * 3, 975.187, ["--elevate", 0, "--continuity", "g2"], "brep", 1e-3),
            ((2,) * 3, 975.587, [], "iges", 1),
            (None, 1776.53, [], "step", 1),
        ],
        0,
    ),
)
def test_a_filled_part_is_a_solid_with_smooth_seams(radii, volume, elevated, kind, size, tmp_path):
    """The shape that the file holds is valid, and its seams are what the message says."""
    out = tmp_path / f"filled.{kind}"
    part = cad_files.scaled(box_without_a_corner(radii) if radii else torus_with_a_hole(), size).Shape()
    result = gtb("fill", written(part, tmp_path), *elevated, "--json", "-o", out, status=0)
    seams = (data := json.loads(result.out))["seams"]
    most = {"angle": 1e-3, "gap": 1e-6 * size if radii else 2e-5, "inner_angle": 4e-4 if "g2" in elevated else 1e-3}
    assert [0 < seams[key] < each for key, each in most.items()] == [True] * 3
    if "g2" in elevated:  # no other patch's figures
        assert set(data) == {"schema", "name", "corner_angles", "remarks", "fault", "seams"}
        assert seams["curvature"]["difference"] < 5e-3 * seams["curvature"]["largest"]
    assert ("warning" in result.err, out.stat().st_size < 250_000) == (False, True)
    shape = read_shape(out.read_bytes(), kind, out.name)
    assert (kernel("BRepCheck").BRepCheck_Analyzer(shape).IsValid(), len([*parts(shape, "SOLID")])) == (True, 1)
    assert extent_of(shape, "Volume") / size**3 == pytest.approx(volume, abs=0.1)
    poles = [uses for uses in edge_uses(shape).values() if len(uses) != 2]
    assert all(kernel("BRep").BRep_Tool.Degenerated_s(edge) for ((edge, _),) in poles) or kind != "brep"


@long
def test_pieces_are_points_at_smooth_corners_and_follow_a_part_from_which_the_patch_is_off():
    zone = kernel("BRepPrimAPI").BRepPrimAPI_MakeSphere(2.0, -np.pi / 2, np.pi / 3).Shape()
    part = part_of(pile([*parts(zone, "FACE")][:1]))
    patch = filled(part, None, None, raises=2).patch
    far = np.linalg.norm(patch.knots[:, None] - patch.domain.vertices, axis=2).min(axis=1, keepdims=True)
    for off in (0.0, 1e-4):
        points = patch.control_points * np.where(far < 0.6 * far.max(), 1.0, 1 + off)
        fit = spline_surfaces(patch.replace(control_points=points), None, part=part.shape)
        assert (fit.fitted, max(np.ptp(surface.net[0], axis=0).max() for surface in fit.surfaces[:3])) == (6, 0)
        data, _, solids, seams = encode_cad(fit.surfaces, "brep", "mm", "patch", part=part.shape)
        shape = read_shape(data, "brep", "x")
        assert kernel("BRepCheck").BRepCheck_Analyzer(shape).IsValid()
        assert (solids, extent_of(shape, "Volume")) == (1, pytest.approx(32 / 3 * np.pi, abs=0.01))
        assert max(seams.angle, seams.inner_angle, fit.angle, fit.bend) < 3e-4
        assert max(seams.gap, seams.inner_gap) < 1e-8


@long
def test_with_g2_new_faces_have_the_curvature_of_a_part_or_no_file_is_left(tmp_path, monkeypatch):
    (far,) = cad_files.moved(np.array([1e6, -1e6, 0]), box_without_a_corner((2, 2, 2)))
    part, out = written(far, tmp_path), tmp_path / "filled.brep"
    fill = "fill", part, "--elevate", 0, "--continuity", "g2", "-o", out
    words = r"\Agtb: \S+ 6 fitted faces, 1 solid, seams .*, "
    words += r"curvature to the part within (\S+) \(\S+% of 0.5\) near .* jumps by up to 0.5 at 3 corners"
    said = re.search(words, gtb(*fill, status=0).err)
    shape, differences = read_shape(out.read_bytes(), "brep", "x"), []
    new = max(face_kind(face) for face in parts(shape, "FACE"))
    for pair in edge_uses(shape).values():
        if len({face_kind(face) == new for _, face in pair}) == 2:
            (_, normals, ways, at), (*_, other) = (along_edge(*each, np.linspace(0.1, 0.9, 30)) for each in pair)
            one, other = (face_forms(face, where) for (_, face), where in zip(pair, (at, other), strict=True))
            across = np.cross(normals, ways)
            differences.append(np.abs(np.einsum("ni,nij,nj->n", across, one - other, across)).max())
    assert max(float(word) for word in re.findall(r"(\S+) degrees and", said[0])) < 1e-3
    assert (len(differences), 0 < max(differences) <= float(said[1]) <= 2.5e-3) == (6, True)
    out.unlink()
    assert "seams of the file have gaps of" in gtb(*fill, "--tolerance", 1e-14, status=2).err
    closer = *fill[:4], "--angle", 1e-9, "-o", out
    assert "planes of fitted faces still differ by" in gtb(*closer, status=2).err
    monkeypatch.setattr("gtb_cli.cad.curved_pieces.ROUNDS", 0)
    result = gtb(*fill, status=2)
    assert re.search(r"continuity g2: curvatures differ by \S+ \(\S+% of 0.5\) near \(.*: --g2-tolerance", result.err)
    assert not out.exists()


def test_seams_are_those_of_the_file_as_it_is_read(monkeypatch):
    read, measured = [], []
    monkeypatch.setattr(cad_writing, "shape_in", lambda *at: read.append(cad_files.shape_in(*at)) or read[-1])
    monkeypatch.setattr(cad_writing, "measured_seams", lambda *shapes, **_: measured.append(shapes))
    patch, box = gtb_cli.load_patch(SPECS / "bicubic.toml"), kernel("BRepPrimAPI").BRepPrimAPI_MakeBox(1, 1, 1)
    encode_cad(spline_surfaces(patch, None).surfaces, "step", "mm", "patch", part=box.Shape())
    ((whole, (face,)),) = measured
    kinds = [face_kind(each) > 0 for each in (*parts(whole, "FACE"), face)]
    assert (whole.IsSame(read[0]), kinds) == (True, [False] * 6 + [True] * 2)


def test_planes_of_a_part_that_differ_at_a_corner_are_said(tmp_path):
    hill = kernel("BRepOffsetAPI").BRepOffsetAPI_ThruSections(False, True)
    point, polygon = kernel("gp").gp_Pnt, kernel("BRepBuilderAPI").BRepBuilderAPI_MakePolygon
    for x, height in ((2.0, 0.0), (1.0, 2.47e-4)):
        corners = [point(*each, height) for each in ((x, x), (-x, x), (-x, -x), (x, -x))]
        hill.AddWire(polygon(*corners, True).Wire())
    shape, given = hill.Shape(), tmp_path / "named.step"
    assert cad_writing._write_step(shape, [(face, "side") for face in parts(shape, "FACE")], str(given), "MM", "hill")
    bounds = "--elevate", 0, "--angle", 1, "-o", tmp_path / "filled.step"
    said = gtb("fill", given, "--hole", "0,0,1", *bounds, status=0).err
    assert "planes and edges of the part disagree by 0.02 degrees at (1, -1, 0.000247): no face can meet all" in said
    assert "filled.step: names of the part's faces are not kept" in said
    assert b"PCURVE" not in (tmp_path / "filled.step").read_bytes()


def face_kind(face):
    return int(kernel("BRepAdaptor").BRepAdaptor_Surface(face).GetType().value)


def test_forms_of_a_face_are_those_of_its_surface():
    (ball,) = parts(kernel("BRepPrimAPI").BRepPrimAPI_MakeSphere(2.0).Shape(), "FACE")
    at = [[0.3, 0.4], [1.0, -0.2]]
    normals = cad_files.face_frames(ball, at)[3]
    assert face_forms(ball, at) == pytest.approx((normals[:, :, None] * normals[:, None] - np.eye(3)) / 2, abs=1e-12)
    assert np.isnan(face_forms(ball, [[0.3, np.pi / 2], *at])[0]).all()
    normals, small = np.array([[2, 3, 6], [6, -2, 3]]) / 7, cad_files.scaled(ball, 1e-8).Shape()
    found = cad_files.nearest_normals(parts(small, "FACE").__next__(), np.zeros(3), 2e-8 * normals, 4e-8)
    assert found == pytest.approx(normals, abs=1e-6)  # the kernel projects to 1e-7


def sides_of(shape, hole=None):
    part = part_of(shape)
    return part.sides(one_ring(part.rings, hole, "part"))


def assert_closed(sides):
    size = np.ptp([side.ends for side in sides], axis=(0, 1)).max()
    for side, following in zip(sides, [*sides[1:], sides[0]], strict=True):
        assert np.abs(side.ends[1] - following.ends[0]).max() <= 1e-6 * size


def test_the_hole_of_a_part_has_its_edges_and_the_planes_of_its_faces():
    sides, remarks = sides_of(box_without_a_corner((2, 2, 2)))
    assert (len(sides), remarks) == (3, ())
    assert_closed(sides)
    middle = np.mean([each.ends[0] for each in sides], axis=0)
    for side in sides:
        points, tangents = points_and_tangents(side.curve, stations())
        normals = np.cross(tangents, side.across)
        from_axis = points - 8  # of a fillet, whose normals have no part along the edge of the box
        from_axis[:, np.ptp(points, axis=0) < 1e-9] = 0
        np.testing.assert_allclose(np.cross(normals, from_axis), 0, atol=1e-6 * np.abs(normals).max())
        assert (from_axis * normals).sum(axis=1).min() > 0  # outwards
        assert ((middle - points) * side.across).sum(axis=1).min() > 0


def test_faces_that_are_not_sewn_yet_and_some_turned_have_the_same_hole():
    given = [*parts(box_without_a_corner((2, 2, 2)), "FACE")]
    found = part_of(pile([face.Reversed() if k in (1, 4) else face for k, face in enumerate(given)]))
    (ring,) = found.rings
    for name, side in zip(ring.names, found.sides(ring)[0], strict=True):
        number = int(re.match(r"face-(\d+) edge", name)[1])
        ends = [piece[[0, -1], :3] for edge in parts(given[number], "EDGE") for piece in edge_pieces(edge, 1)[0]]
        assert min(np.abs(np.sort(each, axis=0) - np.sort(side.ends, axis=0)).max() for each in ends) < 1e-6


@long
def test_closed_edges_and_wavering_splines_are_three_or_more_smooth_sides():
    room = kernel("BRepPrimAPI")
    cup = [*parts(room.BRepPrimAPI_MakeCylinder(3, 5).Shape(), "FACE")][:1]
    assert sorted(len(ring.edges) for ring in part_of(pile(cup)).rings) == [1, 1]
    sides, remarks = sides_of(pile(cup), "0,0,9")
    assert (len(sides), remarks) == (3, ())
    assert_closed(sides)
    assert {round(side.ends[0][2], 9) for side in sides} == {5.0}
    sides, remarks = sides_of(torus_with_a_hole())
    assert 3 <= len(sides) <= 5
    assert_closed(sides)
    said = max(float(re.search(r"a curve (\S+) from its edge", text)[1]) for text in remarks)
    assert said < 1e-5 * 26
    for side in sides:
        assert len(side.curve) <= 9
        points, _ = points_and_tangents(side.curve, np.linspace(0, 1, 40))
        from_ball = np.linalg.norm(points - [9, 8, 2.5], axis=1) - 2
        from_torus = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 10, points[:, 2]) - 3
        assert np.abs([from_ball, from_torus]).max() <= said + 1e-6


@long
def test_rounding_in_the_planes_of_a_file_spoils_no_patch(monkeypatch):
    noise, part = 1e-9 * np.random.default_rng(0).normal(size=(96, 3)), part_of(box_without_a_corner((2, 2, 2)))
    rounded = [replace(side, across=side.across + noise) for side in part.sides(part.rings[0])[0]]
    monkeypatch.setattr(Part, "sides", lambda *_: (rounded, ()))
    filling = filled(part, None, None, raises=1)
    assert (filling.fault, filling.bending.variation < 10) == (None, True)


def test_faults_of_the_kernel_are_said_in_its_words(monkeypatch):
    def fails(*_, **__):
        kernel("gp").gp_Dir(0, 0, 0)

    with pytest.raises(SpecError, match=r"^x: Open CASCADE: gp_Dir"), cad_files.kernel_faults("x"):
        fails()
    monkeypatch.setattr("gtb_cli.filling.part_holes.nearest_normals", fails)
    monkeypatch.setattr("gtb_cli.cad.kinds_of_surfaces.encode_cad", fails)
    part, patch = str(SPECS / "box.step"), gtb_cli.load_patch(SPECS / "bicubic.toml")
    for work in (partial(gtb_cli.fill, part), partial(encode_surfaces, patch, "step", "mm", None)):
        with pytest.raises(DomainError, match=r"^Open CASCADE: gp_Dir"):
            work()


def test_poles_are_no_curves():
    edges = [edge_pieces(edge, 1) for edge in parts(kernel("BRepPrimAPI").BRepPrimAPI_MakeSphere(1).Shape(), "EDGE")]
    assert sorted(map(len, edges)) == [0, 0, 1, 1]


@pytest.mark.parametrize("kind", ["step", "iges", "brep"])
def test_without_the_extra_a_line_names_it(kind, monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "OCP"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "OCP", None)
    with pytest.raises(SpecError, match=r"^x: .* needs Open CASCADE, the extra gtb-cli\[cad\]"):
        import_data("x", b"", kind)
