"""Distances of members from their limit, against dense samples of both surfaces."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gtb_cli import Patch, degenerate, load, regular_control_surface
from gtb_cli.sequences.sequence import degeneration_sequence
from tests.marks import mostly_long

SPECS = Path(__file__).parents[2] / "specs"
THREE_DIGITS = 5e-4
SAMPLES = 200  # along each side: neighbours are 1 % of the size apart, and distances 0.1 % too large
ROUGH = 3e-3


@pytest.mark.parametrize("x", mostly_long([100, 5, 600, 1e8]))
def test_the_corner_of_the_limit_is_farthest(x):
    """The nearest point of a member is beside its own top, up to 6 % nearer to the corner than that."""
    patch = load(SPECS / "pentagon.toml")
    member, corner = degenerate(patch, x), patch.control_points[3]
    angle, size = np.meshgrid(np.arange(0, 2 * np.pi, 0.02), np.geomspace(1e-9, 0.5, 200))
    u = patch.knots[3] + np.stack([size * np.cos(angle), size * np.sin(angle)], axis=-1)
    nearest = np.linalg.norm(member.evaluate(u, "linear") - corner, axis=-1).min()
    distance = degeneration_sequence(patch, [x], resolution=1).distances[0]
    assert distance == pytest.approx(nearest, rel=3 * THREE_DIGITS)


def grid(patch):
    """Points all over a patch, as dense as `SAMPLES` say along each edge of the rectangle around its domain."""
    low, high = patch.domain.vertices.min(axis=0), patch.domain.vertices.max(axis=0)
    u = np.stack(np.meshgrid(*np.linspace(low, high, SAMPLES).T, indexing="ij"), axis=-1).reshape(-1, 2)
    heights = (u - patch.domain.vertices[:, None]) @ patch.domain.normals[:, :, None]
    inside = (heights[..., 0] >= 0).all(axis=0)
    edges = np.linspace(patch.domain.vertices, np.roll(patch.domain.vertices, -1, axis=0), SAMPLES).reshape(-1, 2)
    return patch.evaluate(np.concatenate([u[inside], edges]), "linear")


@pytest.mark.parametrize(("seed", "x"), mostly_long([(3, 30), (3, 1.5), (4, 1.5)]))
def test_points_between_vertices_may_be_farthest(seed, x):
    """On ridges, where two points of the other surface are equally near."""
    rng = np.random.default_rng(seed)
    knots = np.stack(np.meshgrid(np.arange(3.0), np.arange(4.0), indexing="ij"), axis=-1).reshape(-1, 2)
    patch = Patch(knots, rng.normal(size=(12, 3)), np.exp(rng.normal(size=12)), lifting=rng.integers(0, 4, size=12))
    limit = np.concatenate([grid(cell) for cell in regular_control_surface(patch).patches])
    distance = degeneration_sequence(patch, [x], resolution=1).distances[0]
    member = grid(degenerate(patch, x))
    there, back = cKDTree(limit).query(member)[0].max(), cKDTree(member).query(limit)[0].max()
    assert distance == pytest.approx(max(there, back), rel=ROUGH)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_units_do_not_matter(scale):
    patch = load(SPECS / "example-4.4.toml")
    large = patch.replace(knots=scale * (patch.knots + 7), control_points=scale * (patch.control_points + 1e3))
    expected = degeneration_sequence(patch, [5, 100], resolution=1).distances
    assert degeneration_sequence(large, [5, 100], resolution=1).distances == pytest.approx(
        [scale * distance for distance in expected], rel=THREE_DIGITS
    )
