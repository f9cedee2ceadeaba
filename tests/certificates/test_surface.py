"""Certified surfaces: nothing of a surface, or of its mesh, is beyond the tolerance, wherever samples happen to be."""

from __future__ import annotations

import json

import mpmath as mp
import numpy as np
import pytest

from gtb_cli.certificates import cells
from gtb_cli.certificates.enclosures import Coverings
from gtb_cli.certificates.surface import SurfaceCertificate
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import to_segments, to_triangles
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch
from tests.marks import long, mostly_long
from tests.shell import gtb
from tests.specs import SPECS, load

SLACK = 1e-9  # part of the tolerance by which a sample may exceed it through rounding
STEPS = 10  # segments of each side of the lattice on which triangles are sampled


def random_surface(seed: int) -> Patch:
    """A surface with 3 to 7 sides, knots on these and inside, and weights up to a thousand times others."""
    rng = np.random.default_rng(seed)
    sides = int(rng.integers(3, 8))
    angles = 2 * np.pi * (np.arange(sides) + 0.6 * rng.random(sides)) / sides
    hull = np.column_stack([np.cos(angles), np.sin(angles)]) * rng.uniform(0.5, 5)
    edge, t = rng.integers(0, sides, 6), rng.random((6, 1))
    inner = rng.dirichlet(np.ones(sides), int(rng.integers(0, 6))) @ hull
    knots = np.concatenate([hull, hull[edge] * (1 - t) + hull[(edge + 1) % sides] * t, inner])
    weights = [np.ones(len(knots)), np.exp(rng.normal(size=len(knots)))][seed % 2]
    heights = rng.normal(size=len(knots)) * rng.uniform(0.1, 2)
    return Patch(knots, np.column_stack([knots + 0.1 * rng.normal(size=knots.shape), heights]), weights)


def distances(shape: Patch, mesh: Mesh) -> float:
    """Largest distance of the surface from the cells in whose parameters it lies, and of their sides from its curves.

    Where that is at most the tolerance, so is that of the mesh from the surface.
    """
    places = np.array([(i, j, STEPS - i - j) for i in range(STEPS + 1) for j in range(STEPS + 1 - i)]) / STEPS
    u = np.einsum("wc,kcd->kwd", places, mesh.parameters[mesh.cells]).reshape(-1, 2)
    points = shape.evaluate(u, "linear")
    corners = [np.repeat(mesh.vertices[column], len(places), axis=0) for column in mesh.cells.T]
    found = [float(to_triangles(points, *corners).max())]
    for k in range(3):
        on_side = np.tile(places[:, k] == 0, len(mesh.cells))
        ends = [corners[k - 1][on_side], corners[k - 2][on_side]]
        found.append(float(to_segments(points[on_side], *ends).max()))
    return max(found)


def diagonal(shape: Patch) -> float:
    return float(np.linalg.norm(np.ptp(shape.control_points, axis=0)))


@pytest.mark.parametrize("seed", mostly_long(range(2), 0))
def test_random_surfaces_are_within_the_tolerance(seed):
    shape = random_surface(seed)
    tolerance = (0.03, 0.01)[seed % 2] * diagonal(shape)
    try:
        mesh = tessellate(shape, tolerance=tolerance, certify=True)
    except ToleranceError as error:
        assert "cannot be certified" in str(error)  # noqa: PT017 -- a refusal is honest, and which ones are is not fixed
    else:
        assert distances(shape, mesh) <= tolerance * (1 + SLACK)


@pytest.mark.parametrize(
    ("name", "part"),
    mostly_long(
        [("bicubic", 1e-2), ("bezier-triangle", 2e-3), ("pentagon", 2e-3), ("hexagon", 1e-2), ("nonagon", 1e-2)]
    ),
)
def test_certified_meshes_take_few_more_triangles(name, part):
    shape = load(SPECS / f"{name}.toml")
    tolerance = part * diagonal(shape)
    mesh = tessellate(shape, tolerance=tolerance, certify=True)
    assert distances(shape, mesh) <= tolerance * (1 + SLACK)
    assert len(mesh.cells) <= 1.2 * len(tessellate(shape, tolerance=tolerance).cells)


def basis(shape: Patch, s: mp.matrix) -> list[mp.mpf]:
    """T_i at torus coordinates, in 40 digits."""
    weights = [mp.mpf(float(w)) for w in shape.weights * shape.coefficients]
    terms = [w * mp.exp(mp.mpf(float(x)) * s[0] + mp.mpf(float(y)) * s[1])
             for w, (x, y) in zip(weights, shape.knots - shape.domain.center, strict=True)]  # fmt: skip
    total = mp.fsum(terms)
    return [term / total for term in terms]


@pytest.mark.parametrize("name", ["pentagon", "hexagon"])
@pytest.mark.parametrize("number", [0, 2], ids=["inside", "along an edge"])
def test_enclosures_hold_the_basis(name, number):
    """Between Bernstein polynomials, up to one factor, at places all over triangles: in 40 digits."""
    shape = load(SPECS / f"{name}.toml")
    coverings = Coverings(shape)
    corners = shape.domain.vertices
    near = corners[number - 1] * 0.6 + corners[number % len(corners)] * 0.4  # on edge 1
    inner = corners.mean(axis=0)
    u = np.array([[0.98 * near + 0.02 * inner, near, 0.98 * near + 0.02 * corners[1]]]) if number else (
        0.8 * inner + 0.2 * corners[None, :3]
    )  # fmt: skip
    face, s = coverings.located(u[0])
    assert coverings.numbers(face[None])[0] == number
    found, triangles, owner = coverings.covering(number, u, face[None], s[None])
    assert found.all()
    bounds = coverings.coordinates[number].bounds(triangles)
    rng = np.random.default_rng(0)
    for row in range(len(owner)):
        for share in rng.dirichlet(np.ones(3), 12):
            place = share @ triangles.corners[row]
            if number:
                along, across = shape.domain.direction(number - 1), coverings.across[number - 1]
                logs = triangles.origin[row] + np.array([place[0], np.log(place[1]) / triangles.layer[row]])
                s = logs @ np.stack([along, across])
                bernstein = [share[i] * share[j] * (1 if i == j else 2)
                             for i, j in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]]  # fmt: skip
            else:
                s, bernstein = triangles.origin[row] + place, share
            exact = basis(shape, s)
            high = np.tensordot(bernstein, bounds.upper[:, :, row], 1)
            low = np.tensordot(bernstein, bounds.lower[:, :, row], 1)
            # Some factor puts all T_i between their bounds.
            least = max(mp.mpf(float(x)) / t for x, t in zip(low, exact, strict=True))
            most = min(mp.mpf(float(x)) / t for x, t in zip(high, exact, strict=True))
            assert least <= most * (1 + 1e-12)


@pytest.mark.parametrize("name", ["pentagon", "hexagon"])
def test_what_covers_a_triangle_holds_its_places(name):
    """Places of the triangle, in torus coordinates, are in the triangles that are said to hold them."""
    shape = load(SPECS / f"{name}.toml")
    coverings = Coverings(shape)
    u = np.array([0.7 * shape.domain.vertices[:3] + 0.3 * shape.domain.center])
    while True:
        face, s = coverings.located(u[0])
        found, triangles, _ = coverings.covering(0, u, face[None], s[None])
        if found.all():
            break
        u = (u + u[:, :1]) / 2
    shares = np.random.default_rng(1).dirichlet(np.full(3, 0.5), 500)
    _, s = coverings.located(shares @ u[0])
    inside = np.linalg.solve(
        np.vstack([triangles.corners[0].T, np.ones(3)]), np.vstack([(s - triangles.origin[0]).T, np.ones(500)])
    )
    assert inside.min() >= -1e-12
    assert inside.min() < 0.1  # it is not just large


def test_a_triangle_that_is_too_far_fails():
    """The Bézier triangle that is x² + y² over its domain, in one triangle: 1/2 off, in the middle of the long side."""
    knots = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (0, 2)]
    bowl = Patch(knots, [(x / 2, y / 2, z) for (x, y), z in zip(knots, [0, 0, 1, 0, 0, 1], strict=True)],
                 None, [1, 2, 1, 2, 2, 1])  # fmt: skip
    u = np.array([[[0, 0], [2, 0], [0, 2.0]]])
    points = np.array([[[0, 0, 0], [1, 0, 1], [0, 1, 1.0]]])
    height = 0.5 / 3**0.5 * 2**0.5  # of (1/2, 1/2, 1/2) under the triangle's side
    certificate = SurfaceCertificate(bowl)
    assert certificate.failing(u, points, 0.95 * 0.5).all()
    assert not certificate.failing(u, points, 1.05 * max(0.5, height)).any()


@pytest.mark.parametrize(("scale", "shift"), mostly_long([(1e-9, 0.0), (1e9, 0.0), (1.0, 1e7)]))
def test_scale_and_place_of_knots_and_points_do_not_count(scale, shift):
    shape = load(SPECS / "bicubic.toml")
    tolerance = 1e-2 * diagonal(shape)
    other = Patch(scale * shape.knots + shift, scale * shape.control_points + shift, shape.weights, shape.coefficients)
    counts = {
        len(tessellate(each, tolerance=t, certify=True).cells)
        for each, t in ((shape, tolerance), (other, scale * tolerance))
    }
    assert len(counts) == 1


def test_the_command_says_certified(tmp_path):
    manifest = tmp_path / "m.json"
    result = gtb("mesh", SPECS / "bicubic.toml", "--tolerance", "3%", "--certify", "-o", tmp_path / "x.obj",
                 "--manifest", manifest)  # fmt: skip
    assert result.status == 0
    assert result.err.rstrip().endswith(", tolerance certified")
    assert '"assurance": "certified"' in manifest.read_text()
    assert json.loads(manifest.read_text())


@pytest.mark.parametrize("options", [[], ["--tolerance", "1%", "--thickness", "0.1"]])
def test_what_cannot_be_certified_is_refused(tmp_path, options):
    result = gtb("mesh", SPECS / "bicubic.toml", "--certify", *options, "-o", tmp_path / "x.obj")
    assert result.status == 2
    assert "--certify: needs a tolerance" in result.err
    assert not list(tmp_path.iterdir())
    with pytest.raises(DomainError, match="certify: needs a tolerance"):
        Recipe(certify=True)


@long
def test_certificates_that_take_too_long_are_refused(monkeypatch):
    monkeypatch.setattr(cells, "MAX_WORK", 1000)
    with pytest.raises(ToleranceError, match=r"0\.5 takes too long to certify: .* or leave out --certify"):
        tessellate(load(SPECS / "pentagon.toml"), tolerance=0.5, certify=True, normals=False)


def test_a_model_is_certified_patch_by_patch():
    """Edges that patches share have the vertices of both."""
    cube = Model(load(SPECS / "rounded-cube.toml").patches[:3])
    recipe = Recipe(tolerance="1%", certify=True)
    assert len(recipe.mesh(cube)[0].cells) <= 1.5 * len(Recipe(tolerance="1%").mesh(cube)[0].cells)


@long
def test_certificates_of_many_faces_are_refused_before_the_work(monkeypatch):
    spent = []
    spend = SurfaceCertificate._spend
    monkeypatch.setattr(SurfaceCertificate, "_spend", lambda self, n, t: spent.append(n) or spend(self, n, t))
    monkeypatch.setattr(cells, "MAX_WORK", 300_000)
    with pytest.raises(ToleranceError, match=r"faces about [\d.]+ times as long as is allowed: take a larger one"):
        tessellate(load(SPECS / "bicubic.toml"), tolerance=0.0005, certify=True, normals=False)
    assert 16 * sum(spent) < 300_000
