"""VTU files: parsed here, cells evaluated by Bernstein's formula are the patch, and in VTK's order."""

import math
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from gtb_cli.bezier.pieces import bezier_pieces
from gtb_cli.cad.vtu import CURVE, QUADRATIC_TRIANGLE, QUADRILATERAL, TRIANGLE, encode_quadratic, encode_vtu
from gtb_cli.errors import DomainError
from gtb_cli.models.model import Model
from gtb_cli.tessellation.curved_cells import quadratic_cells
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.theory.patch import Patch
from tests.patches import bezier_triangle, bicubic, cubic_curve, integer_pentagon, pentagon
from tests.shell import SPECS, gtb
from tests.specs import load


def arrays(data: bytes) -> dict[str, np.ndarray]:
    found = {}
    for element in ElementTree.fromstring(data).iter("DataArray"):
        width = int(element.get("NumberOfComponents", 1))
        found[str(element.get("Name"))] = np.array((element.text or "").split(), dtype=float).reshape(-1, width)
    return found


def bernstein(degree: int, k: int, t: float) -> float:
    return float(math.comb(degree, k) * t**k * (1 - t) ** (degree - k))


def quadrilateral_place(i: int, j: int, m: int, n: int) -> int:
    """Where VTK has the control point i, j: corners counterclockwise, edges, interior."""
    if i in (0, m) and j in (0, n):
        return {(0, 0): 0, (m, 0): 1, (m, n): 2, (0, n): 3}[i, j]
    if j in (0, n):
        return 4 + i - 1 + (m - 1 + n - 1 if j else 0)
    if i in (0, m):
        return 4 + j - 1 + (m - 1 if i else 2 * (m - 1) + n - 1)
    return 4 + 2 * (m - 1 + n - 1) + i - 1 + (m - 1) * (j - 1)


def triangle_place(place: list[int], degree: int) -> int:
    """Where VTK has a control point, by its shares: corners, edges 01, 12, 20, and so on inwards."""
    inset = min(place)
    side = degree - 3 * inset
    before = sum(3 * (degree - 3 * ring) for ring in range(inset))
    inner = [share - inset for share in place]
    if side in inner:
        return before + (inner.index(side) if side else 0)
    edge = (inner.index(0) + 1) % 3
    return before + 3 + edge * (side - 1) + inner[(edge + 1) % 3] - 1


def value(kind: int, degrees: np.ndarray, table: np.ndarray, s: float, t: float) -> np.ndarray:
    """The point of a cell at s, t, of its homogeneous control points."""
    m, n, _ = (int(degree) for degree in degrees)
    total = np.zeros(4)
    if kind == CURVE:
        for k in range(m + 1):
            total += bernstein(m, k, s) * table[{0: 0, m: 1}.get(k, k + 1)]
    elif kind == QUADRILATERAL:
        for i in range(m + 1):
            for j in range(n + 1):
                total += bernstein(m, i, s) * bernstein(n, j, t) * table[quadrilateral_place(i, j, m, n)]
    else:
        for i in range(m + 1):
            for j in range(m + 1 - i):
                k = m - i - j
                share = math.factorial(m) / (math.factorial(i) * math.factorial(j) * math.factorial(k))
                share *= (1 - s - t) ** i * s**j * t**k
                total += share * table[triangle_place([i, j, k], m)]
    return np.asarray(total[:3] / total[3])


def cells(data: bytes) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Kind, degrees and homogeneous control points of each cell."""
    found = arrays(data)
    table = np.concatenate([found["Points"] * found["RationalWeights"], found["RationalWeights"]], axis=1)
    assert found["connectivity"].ravel().tolist() == list(range(len(table)))
    ends = found["offsets"].ravel().astype(int)
    parts = np.split(table, ends[:-1])
    assert ends[-1] == len(table)
    return list(zip(found["types"].ravel().astype(int).tolist(), found["HigherOrderDegrees"], parts, strict=True))


def corners(patch: Patch) -> np.ndarray:
    """Knots at the corners of a Bézier patch, the first of which is nearest to the axes' origin, counterclockwise."""
    v = patch.domain.vertices
    return np.asarray(np.roll(v, -int(np.argmin(v.sum(axis=1))), axis=0))


def compare(found: list[tuple[int, np.ndarray, np.ndarray]], pieces: Model | tuple[Patch, ...]) -> None:
    place = 1e-13  # largest distance of a point of a cell from the patch, of its size
    # Parameters s, t of cells; in triangles, shares of the second and third corner
    places = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.3, 0.2), (0.1, 0.7), (0.55, 0.4), (0.0, 0.25)]
    for (kind, degrees, table), piece in zip(found, pieces, strict=True):
        v, size = corners(piece), float(np.ptp(piece.control_points, axis=0).max())
        for s, t in places:
            if kind == CURVE:
                u = v[0] + s * (v[1] - v[0])
            else:
                u = v[0] + s * (v[1] - v[0]) + t * (v[-1] - v[0])
            if kind == TRIANGLE and s + t > 1:
                continue
            assert np.abs(value(kind, degrees, table, s, t) - piece.evaluate([u])[0]).max() <= place * size


@pytest.mark.parametrize("patch", [cubic_curve(), bezier_triangle(), bicubic()])
def test_a_bezier_patch_is_one_cell(patch: Patch) -> None:
    data, count, _ = encode_vtu(patch)
    assert count == 1
    compare(cells(data), (patch,))


@pytest.mark.parametrize("degree", [1, 2, 4, 5, 6, 7])
def test_triangles_of_other_degrees_have_vtks_order(degree: int) -> None:
    knots = np.array([(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)], dtype=float)
    heights = np.random.default_rng(degree).random(len(knots))
    patch = Patch(knots, np.column_stack([knots, heights]), 1 + heights, "binomial")
    compare(cells(encode_vtu(patch)[0]), (patch,))


def test_a_pentagon_is_its_five_charts() -> None:
    data, count, _ = encode_vtu(integer_pentagon())
    assert count == 5
    assert {kind for kind, _, _ in cells(data)} == {QUADRILATERAL}
    compare(cells(data), bezier_pieces(integer_pentagon()))


def test_a_model_says_whose_its_cells_are() -> None:
    spec = load(SPECS / "teapot.toml")
    assert isinstance(spec, Model)
    data, count, _ = encode_vtu(spec)
    assert count == 32
    assert arrays(data)["patch"].ravel().tolist() == list(range(32))
    compare(cells(data), spec)


def test_attributes_are_declared() -> None:
    root = ElementTree.fromstring(encode_vtu(bicubic())[0])
    assert root.find(".//PointData").attrib == {"RationalWeights": "RationalWeights"}  # type: ignore[union-attr]
    assert root.find(".//CellData").attrib == {"HigherOrderDegrees": "HigherOrderDegrees"}  # type: ignore[union-attr]


def test_a_model_with_a_patch_without_pieces_names_it() -> None:
    with pytest.raises(DomainError, match=r"^odd: has Bézier pieces of degree 70 only"):
        encode_vtu(Model((bicubic(), pentagon().replace(name="odd"))))


def test_y_may_be_up() -> None:
    z_up, y_up = (arrays(gtb("mesh", SPECS / "bicubic.toml", "-f", "vtu", "--up", up).out)["Points"] for up in "zy")
    assert (y_up == z_up[:, [0, 2, 1]] * [1, 1, -1]).all()


def test_neighbours_of_other_degrees_have_common_edges():
    """VTK cuts each cell by its highest degree: its surfaces of degrees (2, 2), (2, 3), (3, 2) had a slit."""
    knots = [(i, j) for j in range(3) for i in range(4) if (i, j) != (3, 2)]
    points = [(i, j, 0.3 * i * i - 0.2 * j * i) for i, j in knots]
    found = arrays(encode_vtu(Patch(knots, points, weights=[1 + 0.1 * k for k in range(len(knots))]))[0])
    assert (found["HigherOrderDegrees"] == [4, 4, 0]).all()
    ends = np.concatenate([[0], found["offsets"].ravel()]).astype(int)
    edges: dict[tuple, list[np.ndarray]] = {}
    for (m, n, _), begin in zip(found["HigherOrderDegrees"].astype(int).tolist(), ends, strict=False):
        place = [[begin + quadrilateral_place(i, j, m, n) for j in range(n + 1)] for i in range(m + 1)]
        net = np.column_stack([found["Points"], found["RationalWeights"]])[np.array(place)]
        for side in (net[0], net[-1], net[:, 0], net[:, -1]):
            side = side if tuple(side[0]) < tuple(side[-1]) else side[::-1]
            edges.setdefault(tuple(np.round(side[[0, -1], :3].ravel(), 9) + 0.0), []).append(side)
    shared = [pair for pair in edges.values() if len(pair) == 2]
    assert len(shared) == 5
    for one, other in shared:
        assert len(one) == len(other)
        assert one[:, :3] == pytest.approx(other[:, :3], abs=1e-12)
        assert np.ptp(np.log(one[:, 3] / other[:, 3])) < 1e-12


def test_a_triangle_beside_a_cell_of_another_degree_is_said():
    """Raising makes all quadrilaterals alike, but no triangles."""
    square = Patch([[0, 0], [3, 0], [0, 3], [3, 3]], [[0, 0, 0], [3, 0, 1], [0, 3, 0], [3, 3, 0]])
    expected = "cells have degrees 1 and 3, and VTK cuts each by its own: it may draw slits between them"
    assert encode_vtu(Model((square, bezier_triangle())))[2] == [expected]
    for alike in ((bicubic(), bezier_triangle()), (square, bicubic()), (square, cubic_curve())[:1]):
        assert encode_vtu(Model(alike))[2] == []


@pytest.mark.parametrize("patch", [pentagon(), cubic_curve(), integer_pentagon()], ids=lambda patch: patch.name)
def test_quadratic_cells_are_on_the_patch_and_near_it_between(patch: Patch, tmp_path: Path) -> None:
    """At a quarter of a segment, or in the middle of a triangle, the error falls like the cube of the cells' size."""
    if patch.dimension == 1:
        kind, names, place, shares = "line3", ("u",), [0.75, 0.25, 0], [0.375, -0.125, 0.75]
    else:
        kind, names, place = "triangle6", ("u", "v"), [1 / 3] * 3 + [0] * 3
        shares = [-1 / 9] * 3 + [4 / 9] * 3
    errors = []
    for resolution in (4, 8):
        recipe = Recipe(resolution, attributes=names)
        (tmp_path / "x.vtu").write_bytes(encode_quadratic(quadratic_cells(patch, recipe)))
        mesh = meshio.read(tmp_path / "x.vtu")
        assert list(mesh.cells_dict) == [kind]
        cells, u = mesh.cells_dict[kind], np.column_stack([mesh.point_data[name] for name in names])
        assert len(cells) == recipe.faces(patch)
        assert len(np.unique(u, axis=0)) == len(u)
        np.testing.assert_allclose(mesh.points, patch.evaluate(u, "linear"), atol=1e-13)
        exact = patch.evaluate(np.einsum("kcd,c->kd", u[cells], place), "linear")
        errors.append(np.linalg.norm(np.einsum("kcd,c->kd", mesh.points[cells], shares) - exact, axis=1).mean())
    assert errors[0] / errors[1] > 5


def test_fields_are_those_of_the_surface() -> None:
    names = ("u", "v", "mean_curvature", "basis:3")
    (part,) = quadratic_cells(bicubic(), Recipe(3, attributes=names))
    u = np.column_stack([part.fields["u"], part.fields["v"]])
    np.testing.assert_allclose(part.points, bicubic().evaluate(u, "linear"), atol=1e-13)
    np.testing.assert_allclose(part.fields["mean_curvature"], bicubic().curvature(u, "linear").mean, rtol=1e-12)
    np.testing.assert_allclose(part.fields["basis_3"], bicubic().basis(u, "linear")[:, 3], rtol=1e-12)
    for k in range(3):  # the middle of side k is between its ends
        ends = u[part.cells[:, [k, (k + 1) % 3]]]
        np.testing.assert_allclose(u[part.cells[:, 3 + k]], ends.mean(axis=1), atol=1e-15)
    found = arrays(encode_quadratic([part, part]))
    assert found["patch"].ravel().tolist() == [0] * 18 + [1] * 18
    assert found["connectivity"].max() + 1 == len(found["Points"]) == 2 * len(part.points)
    assert found["types"].ravel().tolist() == [QUADRATIC_TRIANGLE] * 36
