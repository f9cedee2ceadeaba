"""Attributes of a mesh's vertices: parameters, curvatures and basis functions, and gaps among them."""

from dataclasses import replace

import numpy as np
import pytest

from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.tessellation.attributes import QUALITY_NAME, filled_scalars, with_attributes
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.vocabulary import ATTRIBUTES
from tests.marks import mostly_long
from tests.specs import SPECS, load
from tests.surfaces import eightfold, octant

DIGITS = 1e-12  # a few thousand roundings


def test_attributes_are_those_of_the_vertices():
    patch = load(SPECS / "bicubic.toml")
    for parametrization in ("toric", "linear"):
        bare = tessellate(patch, 6, parametrization=parametrization)
        mesh, replaced = with_attributes(patch, bare, ["mean_curvature", "v", "u", "v"], parametrization)
        assert list(mesh.attributes) == ["mean_curvature", "v", "u", QUALITY_NAME]
        np.testing.assert_array_equal(mesh.attributes["u"], mesh.parameters[:, 0])
        np.testing.assert_array_equal(mesh.attributes["v"], mesh.parameters[:, 1])
        expected = patch.curvature(mesh.parameters, parametrization).mean
        np.testing.assert_array_equal(mesh.attributes["mean_curvature"], expected)
        np.testing.assert_array_equal(mesh.attributes[QUALITY_NAME], expected)
        assert replaced == 0
        assert np.shares_memory(mesh.vertices, bare.vertices)
    assert with_attributes(patch, bare, []) == (bare, 0)


@pytest.mark.parametrize("path", mostly_long(sorted(SPECS.glob("*.toml")), 12), ids=lambda path: path.stem)
def test_no_attribute_of_any_spec_is_infinite(path):
    shape = load(path)
    if isinstance(shape, Model) or shape.dimension == 1:
        return
    mesh, replaced = with_attributes(shape, tessellate(shape, 4), ATTRIBUTES)
    values = np.stack(list(mesh.attributes.values()))
    assert np.isfinite(values).all()
    raw = shape.curvature(mesh.parameters, "linear")
    undefined = np.isnan(raw.gaussian)
    assert replaced == undefined.sum()
    np.testing.assert_array_equal(mesh.attributes["gaussian_curvature"][~undefined], raw.gaussian[~undefined])


def test_the_pole_of_a_sphere_gets_its_neighbours_curvature():
    mesh, replaced = with_attributes(octant(), tessellate(octant(), 8), ["gaussian_curvature"])
    assert replaced == 9
    np.testing.assert_allclose(mesh.attributes["gaussian_curvature"], 1, rtol=DIGITS)


def test_gaps_are_filled_ring_by_ring():
    steps = np.arange(5)
    line = Mesh(np.zeros((6, 3)), np.column_stack([steps, steps + 1]))
    nan = np.nan
    np.testing.assert_array_equal(filled_scalars(line, np.array([2.0, nan, 4.0, nan, nan, nan])), [2, 3, 4, 4, 4, 4])
    np.testing.assert_array_equal(filled_scalars(line, np.array([nan, nan, nan, nan, 8.0, np.inf])), [8, 8, 8, 8, 8, 8])
    np.testing.assert_array_equal(filled_scalars(line, np.full(6, nan)), np.zeros(6))
    large = np.array([1.5e308, nan, 1.5e308, 1.0, 1.0, 1.0])
    assert filled_scalars(line, large)[1] == 1.5e308


def test_a_curve_has_its_parameter():
    curve = load(SPECS / "example-3.1.toml")
    mesh, _ = with_attributes(curve, tessellate(curve, 8), ["u"])
    np.testing.assert_array_equal(mesh.attributes["u"], mesh.parameters[:, 0])
    with pytest.raises(DomainError, match="a curve has u, its parameter, and no mean_curvature"):
        with_attributes(curve, tessellate(curve, 8), ["mean_curvature"])


def test_what_there_is_not_is_refused():
    with pytest.raises(DomainError, match=r"expected one of u, v, gaussian_curvature, .* or basis:I, got 'colour'"):
        with_attributes(octant(), tessellate(octant(), 2), ["colour"])
    bare = replace(tessellate(octant(), 2), parameters=None)
    with pytest.raises(DomainError, match="vertices of this mesh have no parameters"):
        with_attributes(octant(), bare, ["u"])


@pytest.mark.parametrize("parametrization", mostly_long(["linear", "toric"]))
def test_a_closed_model_has_the_curvature_of_its_outside(parametrization):
    """A sphere of eight octants, every other one a mirror image, whose own normals look inwards."""
    model = eightfold(octant(2.0))
    mesh = tessellate(model, 5, parametrization=parametrization)
    assert mesh.origin is not None
    assert len(set(mesh.origin.turned)) == 2
    mesh, _ = with_attributes(model, mesh, ATTRIBUTES, parametrization)
    np.testing.assert_allclose(mesh.attributes["gaussian_curvature"], 0.25, rtol=DIGITS)
    np.testing.assert_allclose(mesh.attributes["mean_curvature"], 0.5, rtol=DIGITS)
    for index, patch in enumerate(model.patches):
        rows = mesh.origin.patch == index
        u = mesh.parameters[rows]
        np.testing.assert_array_equal(np.column_stack([mesh.attributes[n][rows] for n in "uv"]), u)
        inside = (patch.domain.heights_of_columns(u) > 0).all(axis=0)
        there = patch.evaluate(u[inside], parametrization)
        np.testing.assert_allclose(mesh.vertices[rows][inside], there, atol=1e-12)
