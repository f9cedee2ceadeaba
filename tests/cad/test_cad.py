"""STEP, IGES and BREP files as the CAD kernel reads them: valid, closed, at the same places, with names and units."""

import math
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gtb_cli.bezier.elevation import elevate
from gtb_cli.cad.bspline_surfaces import _best_of, spline_surfaces
from gtb_cli.cad.cad_seams import Seams, along_edge
from gtb_cli.cad.cad_writing import KERNEL_UNITS, encode_cad
from gtb_cli.cad.exact_surfaces import exact_surfaces
from gtb_cli.cad.kinds_of_surfaces import encode_surfaces
from gtb_cli.cad.spline_pieces import FittedPieces
from gtb_cli.errors import DomainError, ExportError, ToleranceError
from gtb_cli.formats.threemf import UNIT_NAMES
from gtb_cli.importers import cad_files
from gtb_cli.importers.cad_files import edge_uses, kernel
from gtb_cli.language.writer import save as write
from gtb_cli.meshes.measures import measure
from gtb_cli.models.model import Model
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import CAD_FORMATS, CAD_SUFFIXES, UNITS
from tests.marks import long, mostly_long
from tests.patches import bezier_triangle, bicubic, cubic_curve, integer_pentagon, pentagon
from tests.shell import SPECS, gtb
from tests.specs import load

INTEGERS = SPECS / "example-4.1-integer.toml"

PLACE = 1e-9  # largest distance of a point of an exact face from the patch, of its size: STEP has sixteen digits

VOLUME = 1e-4  # relative difference of the kernel's volume and a fine mesh's


def read(data: bytes, kind: str, folder: Path) -> Any:
    """The shape of a file in millimetres."""
    (folder / f"x.{kind}").write_bytes(data)
    return cad_files.shape_in(kind, str(folder / f"x.{kind}"))


def parts(shape: Any, kind: str) -> list[Any]:
    return [*cad_files.parts(shape, kind)]


def unlike(shapes: list[Any]) -> list[Any]:
    """Shapes without those that are there already, as edges are that two faces share."""
    found: list[Any] = []
    for shape in shapes:
        if not any(shape.IsSame(other) for other in found):
            found.append(shape)
    return found


def is_valid(shape: Any) -> bool:
    return bool(kernel("BRepCheck").BRepCheck_Analyzer(shape).IsValid())


def volume(shape: Any) -> float:
    properties = kernel("GProp").GProp_GProps()
    kernel("BRepGProp").BRepGProp.VolumeProperties_s(shape, properties)  # with a precision it is off by 1e-3
    return float(properties.Mass())


def distance(shape: Any, points: np.ndarray) -> float:
    """Largest distance of points from a shape."""
    away = kernel("BRepExtrema").BRepExtrema_DistShapeShape
    vertices = [kernel("BRepBuilderAPI").BRepBuilderAPI_MakeVertex(kernel("gp").gp_Pnt(*p)) for p in points.tolist()]
    return max(float(away(each.Vertex(), shape).Value()) for each in vertices)


def box() -> Model:
    """A closed body of two bicubic surfaces: the same boundary, with their middles apart."""
    patch = bicubic()
    points = np.column_stack([patch.knots, np.zeros(16)])
    inner = ((patch.knots > 0) & (patch.knots < 3)).all(axis=1)
    upper, lower = points + np.outer(inner, [0, 0, 1.0]), points - np.outer(inner, [0, 0, 0.5])
    top = Patch(patch.knots, upper, coefficients=patch.coefficients, name="top")
    return Model((top, top.replace(control_points=lower, name="bottom")), "pillow")


@cache
def encoded(name: str, kind: str) -> bytes:
    spec = box() if name == "pillow" else load(SPECS / f"{name}.toml")
    return encode_cad(spline_surfaces(spec, None).surfaces, kind, "mm", name)[0]


@pytest.mark.parametrize("kind", mostly_long(CAD_FORMATS, 0))
def test_a_pentagon_is_five_exact_faces_that_share_edges(kind: str, tmp_path: Path) -> None:
    patch, shape = integer_pentagon(), read(encoded("example-4.1-integer", kind), kind, tmp_path)
    assert (is_valid(shape), len(parts(shape, "FACE"))) == (True, 5)
    assert kind == "iges" or len(unlike(parts(shape, "EDGE"))) == 5 + 10
    v, size = patch.domain.vertices, np.ptp(patch.control_points, axis=0).max()
    points = patch.evaluate(np.random.default_rng(1).dirichlet(np.ones(len(v)), 12) @ v)
    assert distance(shape, points) <= PLACE * size + 1e-7 * (kind == "iges")


def test_steep_weights_are_balanced_with_the_same_image(tmp_path: Path) -> None:
    """The kernel calls this trapezoid invalid with the weights of its Bézier pieces."""
    corners = np.array([[0, 1], [2, 1], [1, 1], [0, 2], [2, 2]], dtype=float)
    points = np.column_stack([corners, [-0.4, 1.3, -1.2, -1.9, -1.4]])
    patch = Patch(corners, points, [1.7e-4, 4.6e5, 3.1e-3, 5.5, 2.4e-5])
    surfaces = spline_surfaces(patch, None).surfaces
    assert is_valid(read(encode_cad(surfaces, "step", "mm", "patch")[0], "step", tmp_path))
    places = np.array([0.001, 0.1, 0.3, 0.5, 0.8, 0.99])
    for before, after in zip(exact_surfaces(patch), surfaces, strict=True):
        moved = np.log(after.net[..., 3] / before.net[..., 3])
        assert np.ptp(np.log(after.net[..., 3])) <= np.ptp(np.log(before.net[..., 3]))
        factors = np.exp([moved[1, 0] - moved[0, 0], moved[0, 1] - moved[0, 0]])
        s, t = (places * factor / (1 - places + places * factor) for factor in factors)
        assert values(after.net, places, places) == pytest.approx(values(before.net, s, t), abs=1e-12)


def values(net: np.ndarray, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Points of a rational Bézier rectangle, by the definition."""
    m, n = net.shape[0] - 1, net.shape[1] - 1
    first = np.array([math.comb(m, i) * s**i * (1 - s) ** (m - i) for i in range(m + 1)])
    second = np.array([math.comb(n, j) * t**j * (1 - t) ** (n - j) for j in range(n + 1)])
    shares = first[:, None] * second * net[..., 3, None]
    return np.einsum("ijk,ijx->kx", shares, net[..., :3]) / shares.sum(axis=(0, 1))[:, None]


@pytest.mark.parametrize("kind", mostly_long(CAD_FORMATS))
def test_a_closed_model_is_a_solid_of_the_meshs_volume(kind: str, tmp_path: Path) -> None:
    shape = read(encoded("pillow", kind), kind, tmp_path)
    assert (is_valid(shape), len(parts(shape, "SOLID"))) == (True, 1)
    expected = measure(tessellate(box(), 96)).volume
    assert expected is not None
    assert volume(shape) == pytest.approx(abs(expected), rel=VOLUME)
    surfaces = [one._replace(net=one.net.transpose(1, 0, 2)) for one in spline_surfaces(box(), None).surfaces]
    turned = read(encode_cad(surfaces, kind, "mm", "patch")[0], kind, tmp_path)
    assert volume(turned) == pytest.approx(volume(shape), rel=VOLUME)  # outwards, however its surfaces lie


def test_names_of_patches_and_the_unit_are_in_the_file(tmp_path: Path) -> None:
    text = encoded("pillow", "step").decode()
    assert "ADVANCED_FACE('top'" in text
    assert "ADVANCED_FACE('bottom'" in text
    assert "PRODUCT('pillow','pillow'" in text
    assert "SI_UNIT(.MILLI.,.METRE.)" in text
    inches = encode_cad(spline_surfaces(box(), None).surfaces, "step", "in", "patch")[0].decode()
    found = read(inches.encode(), "step", tmp_path)
    assert np.ptp(cad_files.box_of(found), axis=0)[0] == pytest.approx(3 * 25.4)
    assert "'INCH'" in inches
    assert "CARTESIAN_POINT('',(3.,3.," in inches  # numbers as they are in the spec


def test_an_iges_file_does_not_have_the_users_name() -> None:
    lines = encoded("pillow", "iges").decode().splitlines()
    header = "".join(line[:72].rstrip() for line in lines if line[72:73] == "G")
    assert header.split(",")[20:22] == ["3Hgtb", ""]  # author and organization


@pytest.mark.parametrize("kind", CAD_FORMATS)
def test_the_same_surfaces_make_the_same_bytes(kind: str) -> None:
    again = encode_cad(spline_surfaces(box(), None).surfaces, kind, "mm", "pillow")[0]
    assert again == encoded("pillow", kind)


def test_the_teapot_is_four_shells(tmp_path: Path) -> None:
    shape = read(encoded("teapot", "step"), "step", tmp_path)
    assert (is_valid(shape), len(parts(shape, "FACE")), len(parts(shape, "SHELL"))) == (True, 32, 4)


@long
def test_fitted_surfaces_are_within_the_tolerance(tmp_path: Path) -> None:
    patch = pentagon()
    found = spline_surfaces(patch, 2e-3)
    assert found.fitted == len(found.surfaces) == 5
    assert "has Bézier pieces of degree 70 only" in found.reasons[0][1]
    assert 0 < found.error <= 2e-3
    shape = read(encode_cad(found.surfaces, "brep", "mm", "patch")[0], "brep", tmp_path)
    assert is_valid(shape)
    assert len(parts(shape, "SHELL")) == 1
    v = patch.domain.vertices
    points = patch.evaluate(np.random.default_rng(2).dirichlet(np.ones(len(v)), 12) @ v)
    assert distance(shape, points) <= 2e-3
    with pytest.raises(ToleranceError, match="fitted surfaces of 32 × 32 spans are still"):
        spline_surfaces(patch, 1e-12)


def pillow(top: Patch, *, turned: bool = False) -> Model:
    """A closed body of an exact patch, and one with the same boundary and an inner knot that leaves it no pieces.

    Turned, the same edges have other data: another map of the knots, and other factors of the weights.
    """
    on = top.domain.incidence.any(axis=1)
    middle = np.add(top.domain.vertices.mean(axis=0), [0.1 * np.sqrt(2), 0.05 * np.pi])
    knots = np.concatenate([top.knots[on], [middle]])
    logs = np.concatenate([top.log_products[on], [0.3]])
    points = np.concatenate([top.control_points[on], [[*middle, -0.7]]])
    if turned:
        logs = logs + knots @ [0.9, -0.6] + 2
        knots = knots * [-3, 2]
    return Model((top.replace(name="top"), Patch(knots, points, log_weights=logs, name="bottom")), "pillow")


def rectangle(degree: int) -> Patch:
    """A polynomial rectangle with a bent boundary."""
    knots = np.argwhere(np.ones((degree + 1, degree + 1))).astype(float)
    x, y = knots.T
    inner = (x % degree * (y % degree) > 0).astype(float)
    return Patch(knots, np.column_stack([knots, 0.3 * np.sin(x) + inner]), coefficients="binomial")


@pytest.mark.parametrize(
    ("top", "turned", "faces", "edges"),
    [
        (integer_pentagon(), False, 5, 20),
        pytest.param(integer_pentagon().replace(weights=[1, 5, 0.3, 1, 2, 4, 1, 0.5]), True, 5, 20, marks=long),
        *mostly_long([(rectangle(n), n == 7, 1, 12) for n in (3, 7, 16)], 0),  # fitted ones divide its edges
    ],
)
def test_exact_patches_stay_exact_beside_fitted_ones(top: Patch, turned: bool, faces: int, edges: int, tmp_path: Path):
    model = pillow(top, turned=turned)
    found = spline_surfaces(model, None)
    assert (len(found.surfaces) - found.fitted, [name for name, _ in found.reasons]) == (faces, ["bottom"])
    shape = read(encode_cad(found.surfaces, "step", "mm", "patch")[0], "step", tmp_path)
    assert (is_valid(shape), len(parts(shape, "SOLID")), len(unlike(parts(shape, "EDGE")))) == (True, 1, edges)
    v, size = top.domain.vertices, float(np.ptp(top.control_points, axis=0).max())
    points = top.evaluate(np.random.default_rng(1).dirichlet(np.ones(len(v)), 12) @ v)
    assert distance(shape, points) <= PLACE * size
    tolerance = kernel("BRep").BRep_Tool.Tolerance_s
    assert max(tolerance(edge) for edge in parts(shape, "EDGE")) <= 1e-6 * size
    rough, fine = (measure(tessellate(model, count)).volume or 0.0 for count in (24, 48))
    assert volume(shape) == pytest.approx(fine + (fine - rough) / 3, rel=2 * VOLUME)  # the mesh's error is quadratic


@long
def test_fitted_patches_share_edges_with_other_parameters() -> None:
    one = pillow(integer_pentagon().replace(weights=[1, 5, 0.3, 1, 2, 4, 1, 0.5]))[1]
    model = Model((one, elevate(one)))
    assert sum(bool(joint.match) for joint in model.joints.shared) == 5
    found = spline_surfaces(model, None)
    assert found.fitted == len(found.surfaces) == 10
    rims = [np.concatenate([surface.net[:, 0, :3], surface.net[0, :, :3]]) for surface in found.surfaces]
    size = np.ptp(one.control_points)
    for ours, theirs in zip(rims[:5], rims[5:], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9 * size)


def bends(shape: Any) -> list[float]:
    """The largest angle in degrees between the normals of two B-spline faces on each edge that they share."""
    surface_of, splines = kernel("BRep").BRep_Tool.Surface_s, kernel("Geom").Geom_BSplineSurface

    def normals(edge: Any, face: Any) -> np.ndarray:
        curve = kernel("BRepAdaptor").BRepAdaptor_Curve2d(edge, face)
        first, last = curve.FirstParameter(), curve.LastParameter()
        places = [curve.Value(t) for t in np.linspace(first, last, 2000).tolist()]
        at = (kernel("GeomLProp").GeomLProp_SLProps(surface_of(face), p.X(), p.Y(), 1, 1e-12) for p in places)
        return np.array([[n.X(), n.Y(), n.Z()] for n in (each.Normal() for each in at)])

    fitted = [[use for use in uses if isinstance(surface_of(use[1]), splines)] for uses in edge_uses(shape).values()]
    pairs = [[normals(*use) for use in uses] for uses in fitted if len(uses) == 2]
    return [float(np.degrees(2 * np.arcsin(np.linalg.norm(a - b, axis=1).max() / 2))) for a, b in pairs]


@pytest.mark.usefixtures("probed_here")
def test_seams_are_measured_to_a_hundred_thousandth_of_an_edge() -> None:
    shape = cad_files.read_shape((SPECS / "box.step").read_bytes(), "step", "box.step")
    for (edge, face), *_ in edge_uses(shape).values():
        points = along_edge(edge, face)[0]
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        assert max(steps[0], steps[-1]) < 1e-4 * steps.sum()
        assert distance(edge, points[[0, -1]]) < PLACE


@pytest.mark.parametrize("spec", mostly_long([pillow(rectangle(2)), pentagon(), pillow(integer_pentagon())]))
def test_the_angle_at_inner_seams_is_the_one_the_kernel_measures(spec: Patch | Model, tmp_path: Path) -> None:
    """Fitted pieces that meet exactly have tangent planes that differ, by up to the angle that the warning says."""
    found = spline_surfaces(spec, None)
    measured = bends(read(encode_cad(found.surfaces, "brep", "mm", "patch")[0], "brep", tmp_path))
    assert len(measured) == found.fitted  # a seam for each corner
    assert 1e-3 < max(measured) < 0.15
    assert 0.9 * found.bend < max(measured) < 1.01 * found.bend


@long
def test_an_exact_patch_of_high_degree_stays_exact_beside_a_fitted_one(tmp_path: Path) -> None:
    found = spline_surfaces(pillow(rectangle(17)), None)
    assert (found.fitted, len(found.surfaces)) == (4, 5)
    shape = read(encode_cad(found.surfaces, "brep", "mm", "patch")[0], "brep", tmp_path)
    assert (is_valid(shape), len(parts(shape, "SOLID"))) == (True, 1)


@pytest.mark.parametrize(("angle", "tried"), [(None, 4), (6.0, 3), (0.5, 6)])
def test_more_spans_are_tried_until_planes_are_near_or_come_no_nearer(angle: float | None, tried: int) -> None:
    most = FittedPieces((), 1.0, 1.0, 90.0, 90.0, 1.0)
    figures = [(2.0, 0.5, 9.0), (0.5, 0.5, 9.0), (0.5, 0.5, 3.0), (0.5, 0.5, 5.0), (0.5, 2.0, 1.0), (2.0, 0.5, 1.0)]
    trials = iter([({}, most._replace(error=error, gap=gap, bend=bend, angle=0.0)) for error, gap, bend in figures])
    best, last = _best_of(trials, most, angle, curved=False)
    assert best is not None
    assert (best[1].bend, last.bend, len([*trials])) == (3.0, figures[tried - 1][2], 6 - tried)


def test_a_rectangle_is_one_face_and_a_triangle_three() -> None:
    assert (len(exact_surfaces(bicubic())), spline_surfaces(bicubic(), None).bend) == (1, 0)
    (surface,) = exact_surfaces(bicubic())
    assert surface.degrees == (3, 3)
    assert len(exact_surfaces(bezier_triangle())) == 3
    with pytest.raises(DomainError, match="weights in a range beyond"):
        exact_surfaces(bicubic().replace(weights=np.geomspace(1, 1e20, 16)))


def test_faces_that_turn_back_at_seams_of_a_part_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    part = kernel("BRepPrimAPI").BRepPrimAPI_MakeBox(1, 1, 1).Shape()
    for place in (0, 2):
        made = [(b"", 0, 1, Seams(*np.eye(4)[place] * most)) for most in (90.1, 0.5)]
        monkeypatch.setattr("gtb_cli.cad.kinds_of_surfaces.encode_cad", lambda *_, left=made, **__: left.pop(0))
        with pytest.raises(ToleranceError, match=r"planes at seams differ by 90.1 degrees, more than 90"):
            encode_surfaces(bicubic(), "step", "mm", None, part=part)
        (said,) = encode_surfaces(bicubic(), "step", "mm", None, part=part)[2]
        assert said == "planes at seams differ by up to 0.5 degrees: `angle` bounds it"


def test_curves_are_not_surfaces() -> None:
    with pytest.raises(DomainError, match="is a curve, and CAD files are made of surfaces"):
        spline_surfaces(cubic_curve(), None)


def test_what_is_too_small_for_the_kernel_is_refused() -> None:
    small = bicubic().replace(control_points=1e-9 * bicubic().control_points)
    with pytest.raises(ExportError, match="too small for a kernel that works to 1e-07"):
        encode_cad(spline_surfaces(small, None).surfaces, "step", "mm", "patch")


def test_without_the_extra_there_is_a_message(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "OCP"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "OCP", None)
    with pytest.raises(ExportError, match=r"STEP needs Open CASCADE, the extra gtb-cli\[cad\]"):
        encode_cad(spline_surfaces(bicubic(), None).surfaces, "step", "mm", "patch")


def test_the_names_of_units_and_formats_are_one_list() -> None:
    assert tuple(KERNEL_UNITS) == tuple(UNIT_NAMES) == tuple(UNITS)
    assert set(CAD_SUFFIXES.values()) == set(CAD_FORMATS)


@pytest.mark.parametrize("kind", mostly_long(CAD_FORMATS))
def test_y_is_up_where_it_is_asked_for(kind: str, tmp_path: Path) -> None:
    """A patch, and a model; the kernel's box of the surfaces is the turned one of the mesh."""
    write(box(), tmp_path / "pillow.toml")
    for spec in (INTEGERS, tmp_path / "pillow.toml"):
        gtb("mesh", spec, "-f", kind, "--up", "y", "-o", tmp_path / "up.cad", status=0)
        shape = read((tmp_path / "up.cad").read_bytes(), kind, tmp_path)
        low, high = tessellate(load(spec), 48).bounds
        expected = [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]]
        assert np.abs(cad_files.box_of(shape) - expected).max() <= 1e-3


@long
def test_on_the_command_line(tmp_path: Path) -> None:
    result = gtb("mesh", INTEGERS, "-o", tmp_path / "x.stp", status=0)
    assert result.err.endswith("x.stp: 5 exact faces, 1 open shell\n")
    assert (tmp_path / "x.stp").read_bytes().startswith(b"ISO-10303-21;")
    printed = gtb("mesh", INTEGERS, "-f", "brep", "-q")
    assert printed.out.startswith((b"\nCASCADE Topology", b"DBRep"))
    assert printed.err == ""
    write(pillow(rectangle(2)), tmp_path / "mixed.toml")
    mixed = gtb("mesh", tmp_path / "mixed.toml", "-o", tmp_path / "mixed.step")
    said = re.search(r"planes differ by up to (\S+) degrees at edges and (\S+) at inner seams: bottom: has ", mixed.err)
    assert said is not None
    fit = spline_surfaces(pillow(rectangle(2)), None)
    assert [float(word) for word in said.groups()] == pytest.approx([fit.angle, fit.bend], rel=0.005)
    assert mixed.err.endswith("mixed.step: 1 exact and 4 fitted faces, 1 solid\n")
    for angle, lost in ((360, 25), (190, 20)):  # more spans where the least have nearly the angle that is asked for
        said = encode_surfaces(pentagon(), "brep", "mm", 2e-3, angle)[2][0]
        assert f"planes are lost at {lost}% of edges and seams" in said
    open_shell = gtb("mesh", INTEGERS, "-o", tmp_path / "y.step", "--require", "watertight", status=1)
    assert "not watertight: 1 of 1 shells are open" in open_shell.err
    assert not (tmp_path / "y.step").exists()
