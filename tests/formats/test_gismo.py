"""XML files for G+Smo, read here by the description of its format: geometry, interfaces, and names of boundaries."""

from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.interpolate import BSpline

from gtb_cli.errors import DomainError
from gtb_cli.formats.bspline_surfaces import exact_surfaces
from gtb_cli.formats.gismo import encode_gismo
from gtb_cli.models.model import Model
from tests.patches import bezier_triangle, bicubic, integer_pentagon, pentagon
from tests.shell import SPECS
from tests.specs import load

SIDES = [(0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0)]  # direction, and its parameter, of west, east, south and north


class Piece:
    """A TensorNurbs2 of two clamped Bézier knot vectors on [0, 1], whose first direction runs fastest."""

    def __init__(self, element):
        vectors = [basis for basis in element.iter("Basis") if basis.get("type") == "BSplineBasis"]
        assert [basis.get("index") for basis in vectors] == ["0", "1"]
        self.degrees = [int(basis[0].get("degree")) for basis in vectors]
        self.knots = [np.array(basis[0].text.split(), dtype=float) for basis in vectors]
        weights = np.array(element.find("Basis/weights").text.split(), dtype=float)
        points = np.array(element.find("coefs").text.split(), dtype=float).reshape(-1, 3)
        shape = (self.degrees[1] + 1, self.degrees[0] + 1)
        table = np.column_stack([points * weights[:, None], weights]).reshape(*shape, 4)
        self.net = table.transpose(1, 0, 2)

    def at(self, u, v):
        first, second = (
            BSpline(knots, np.eye(degree + 1), degree)(np.clip(t, 0, 1))
            for knots, degree, t in zip(self.knots, self.degrees, (u, v), strict=True)
        )
        values = np.einsum("qi,qj,ijx->qx", first, second, self.net)
        return values[:, :3] / values[:, 3:]

    def on(self, side, t):
        direction, value = SIDES[side]
        return self.at(*([np.full_like(t, value), t] if direction == 0 else [t, np.full_like(t, value)]))


def read(data):
    root = ElementTree.fromstring(data)
    topology = root.find("MultiPatch")
    assert topology.get("parDim") == "2"
    pieces = [Piece(element) for element in root.findall("Geometry")]
    assert topology.find("patches").text == f"0 {len(pieces) - 1}"
    interfaces = topology.find("interfaces")
    lines = [] if interfaces is None else np.array(interfaces.text.split(), dtype=int).reshape(-1, 8).tolist()
    boundaries = {
        each.get("name"): np.array(each.text.split(), dtype=int).reshape(-1, 2).tolist()
        for each in topology.findall("boundary")
    }
    return pieces, lines, boundaries


def shapes():
    return [bicubic(), bezier_triangle(), integer_pentagon(), load(SPECS / "teapot.toml")]


@pytest.mark.parametrize("shape", shapes(), ids=lambda shape: shape.name)
def test_pieces_meet_as_said_and_every_side_is_told(shape):
    pieces, lines, boundaries = read(encode_gismo(shape)[0])
    expected = [surface.net for index, patch in enumerate(shape.patches) for surface in exact_surfaces(patch, index)]
    assert len(pieces) == len(expected)
    for piece, net in zip(pieces, expected, strict=True):
        np.testing.assert_allclose(piece.net, np.dstack([net[..., :3] * net[..., 3:], net[..., 3:]]), rtol=1e-15)
    told = []
    t = np.linspace(0, 1, 7)
    for p, s, q, r, *directions_and_ways in lines:
        told += [(p, s), (q, r)]
        directions, same = directions_and_ways[:2], directions_and_ways[2:]
        across, beside = (s - 1) // 2, 1 - (s - 1) // 2
        assert directions[across] == (r - 1) // 2
        assert sorted(directions) == [0, 1]
        assert same[across] == (SIDES[s - 1][1] != SIDES[r - 1][1])
        other = pieces[q].on(r - 1, t if same[beside] else 1 - t)
        np.testing.assert_allclose(pieces[p].on(s - 1, t), other, atol=1e-9)
    for name, sides in boundaries.items():
        who, edge = name.rsplit(" edge ", 1)
        patch = next(each for each in shape.patches if (each.name or "patch0") == who)
        curve = patch.boundary(int(edge))
        low, high = curve.domain.vertices[:, 0]
        points = curve.evaluate(low + np.linspace(0, 1, 2001) * (high - low), "linear")
        for p, s in sides:
            told.append((p, s))
            gaps = np.linalg.norm(pieces[p].on(s - 1, t)[:, None] - points, axis=2).min(axis=1)
            assert gaps.max() < 2e-3 * np.ptp(patch.control_points, axis=0).max()
    assert sorted(told) == [(p, s) for p in range(len(pieces)) for s in (1, 2, 3, 4)]


def test_known_numbers_of_interfaces():
    assert encode_gismo(bicubic())[1] == "1 piece, 0 interfaces, 4 boundary sides"
    assert encode_gismo(integer_pentagon())[1] == "5 pieces, 5 interfaces, 10 boundary sides"
    assert encode_gismo(bezier_triangle())[1] == "3 pieces, 3 interfaces, 6 boundary sides"


@pytest.mark.parametrize(("scale", "shift"), [(0.01, 1e7), (1e-9, 0), (1e9, 0)])
def test_size_and_place_change_no_interface(scale, shift):
    for patch in (integer_pentagon(), bezier_triangle()):
        moved = patch.replace(control_points=scale * patch.control_points + shift)
        (_, lines, boundaries), (_, *expected) = read(encode_gismo(moved)[0]), read(encode_gismo(patch)[0])
        assert [lines, boundaries] == expected


def test_a_rounding_of_coordinates_parts_no_sides():
    far = bicubic().replace(control_points=bicubic().control_points / 100 + 1e7)
    beside = far.replace(control_points=np.nextafter(far.control_points, np.inf))
    assert encode_gismo(Model((far, beside)))[1] == "2 pieces, 4 interfaces, 0 boundary sides"


def test_what_has_no_pieces_is_refused():
    with pytest.raises(DomainError, match="degree 70 only"):
        encode_gismo(pentagon())
    with pytest.raises(DomainError, match="is a curve"):
        encode_gismo(load(SPECS / "cubic-bezier.toml"))
