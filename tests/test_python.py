"""The library as the user of a notebook meets it: values, grids, files and names, all from `import gtb_cli`."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import gtb_cli
from gtb_cli import DomainError, Mesh, Model, Patch
from tests.shell import SPECS


@pytest.fixture(scope="module")
def pentagon() -> Patch:
    return gtb_cli.load(SPECS / "pentagon.toml")


@pytest.fixture(scope="module")
def box() -> Model:
    return gtb_cli.load(SPECS / "box-corner.toml")


@pytest.fixture(scope="module")
def values(pentagon, box):
    limitless = gtb_cli.degenerate(gtb_cli.load(SPECS / "example-4.4.toml"), 1e300)
    mesh, joined = gtb_cli.tessellate(pentagon, 2), gtb_cli.tessellate(box, 2)
    decomposition = gtb_cli.regular_decomposition(pentagon.knots, pentagon.weights)
    return [pentagon, box, limitless, mesh, joined, decomposition, pentagon.domain]


# --- values


def copies_of(value):
    yield pickle.loads(pickle.dumps(value))
    yield copy.deepcopy(value)
    yield copy.copy(value)


def test_values_are_copied_and_pickled(values):
    for value in values:
        for other in copies_of(value):
            assert other is not value
            assert other == value
            assert hash(other) == hash(value)


def arrays_of(value):
    fields = [getattr(value, name) for name in value.__dataclass_fields__]
    return [field for field in fields if isinstance(field, np.ndarray)]


def test_arrays_are_read_only_also_those_of_copies(values):
    for value in values:
        for other in (value, *copies_of(value)):
            for array in arrays_of(other):
                with pytest.raises(ValueError, match="read-only"):
                    array[...] = 0


def test_a_mesh_leaves_the_arrays_that_it_is_made_of_as_they_are():
    vertices = np.eye(3)
    mesh = Mesh(vertices, [[0, 1, 2]], attributes={"u": [1, 2, 3]})
    assert vertices.flags.writeable
    assert not mesh.vertices.flags.writeable
    assert not mesh.attributes["u"].flags.writeable
    with pytest.raises(TypeError):
        mesh.attributes["v"] = vertices[0]
    with pytest.raises(DomainError, match="cells: not a regular array of numbers"):
        Mesh(vertices, [[0, 1, 1.5]])


def changes(pentagon):
    yield pentagon.replace(name="other")
    yield pentagon.replace(weights=pentagon.weights * (1 + 1e-15))
    yield pentagon.replace(lifting=np.zeros(8))
    yield (
        pentagon.replace(edge_normals="primitive")
        if pentagon.edge_normals == "unit"
        else pentagon.replace(edge_normals="unit")
    )
    yield pentagon.replace(edge_scale=2)
    yield pentagon.replace(control_points=pentagon.control_points + 1)


def test_what_differs_in_anything_is_not_equal(pentagon, box):
    for other in changes(pentagon):
        assert other != pentagon
    assert pentagon != "pentagon"
    assert Model([pentagon]) != pentagon
    assert box.replace(name="other") != box
    assert gtb_cli.tessellate(pentagon, 2) != gtb_cli.tessellate(pentagon, 3)


def test_values_are_members_of_sets_and_keys(pentagon):
    again = gtb_cli.load(SPECS / "pentagon.toml")
    assert len({pentagon, again, *changes(pentagon)}) == 7
    assert {pentagon: 1}[again] == 1
    minus = pentagon.replace(control_points=np.where(pentagon.control_points == 0, -0.0, pentagon.control_points))
    assert minus == pentagon
    assert hash(minus) == hash(pentagon)


def _volume(patch: Patch) -> tuple[Patch, Mesh]:
    return patch, gtb_cli.tessellate(patch, 2)


@pytest.mark.long
def test_processes_take_and_give_values(pentagon, box):
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(_volume, [pentagon, box]))
    assert found == [_volume(pentagon), _volume(box)]


def test_values_are_short_to_look_at(values):
    shown = [repr(value) for value in values[:5]]
    assert shown[0] == "<Patch pentagon: 5-sided surface, 8 knots>"
    assert shown[1] == "<Model box-corner: 7 surfaces>"
    assert shown[3].startswith("<Mesh pentagon: ")
    assert max(map(len, shown)) < 80
    assert repr(Patch([0, 1], [[0, 0], [1, 1]])) == "<Patch without a name: curve, 2 knots>"


def test_a_model_is_a_sequence_of_its_patches(box, pentagon):
    assert len(box) == len(list(box)) == len(box.patches) == 7
    assert box[0] is box.patches[0]
    assert box[-1] is list(box)[-1]
    assert next(reversed(box)) is box[-1]
    assert pentagon not in box
    assert Model(list(box), name=box.name) == box
    with pytest.raises(DomainError, match="expected several patches, got one"):
        Model(pentagon)
    with pytest.raises(DomainError, match=r"patches\[1\]: expected a Patch, got str"):
        Model([pentagon, "pentagon"])


# --- changed copies


def test_no_copy_keeps_what_was_replaced():
    patch = gtb_cli.load(SPECS / "example-4.4.toml")
    far = gtb_cli.degenerate(patch, 1e200)
    weights = np.arange(1.0, 1 + len(patch.knots))
    for changed in (far.replace(weights=weights), copy.deepcopy(far).replace(weights=weights)):
        assert changed == patch.replace(weights=weights)
        np.testing.assert_array_equal(changed.log_weights, np.log(weights))
        np.testing.assert_array_equal(changed.basis(patch.knots), patch.replace(weights=weights).basis(patch.knots))
    back = far.replace(log_weights=np.log(patch.weights))
    np.testing.assert_array_equal(back.log_weights, patch.log_weights)


def test_coefficients_have_names():
    curve = Patch([0, 1, 2, 3], np.eye(4)[:, :3], coefficients="binomial")
    np.testing.assert_array_equal(curve.coefficients, [1, 3, 3, 1])
    assert curve.replace(coefficients=[1, 3, 3, 1]) == curve
    unity = curve.replace(coefficients="partition-of-unity")
    np.testing.assert_allclose(unity.coefficients / unity.coefficients[0], [1, 3, 3, 1])
    with pytest.raises(DomainError, match="expected numbers, binomial or partition-of-unity, got 'binom'"):
        curve.replace(coefficients="binom")


# --- parameters


def test_parameters_are_points_rows_and_grids(pentagon):
    grid = np.stack(np.meshgrid([0.8, 1.0, 1.2], [1.0, 1.1], indexing="ij"), axis=-1)
    points = pentagon.evaluate(grid)
    assert points.shape == (3, 2, 3)
    np.testing.assert_array_equal(points.reshape(-1, 3), pentagon.evaluate(grid.reshape(-1, 2)))
    np.testing.assert_allclose(points[1, 1], pentagon.evaluate(grid[1, 1]), rtol=1e-14)
    assert pentagon.evaluate([1, 1]).shape == (3,)
    assert pentagon.basis(grid).shape == (3, 2, 8)
    assert pentagon.normals(grid).shape == (3, 2, 3)
    assert pentagon.derivatives(grid).shape == (3, 2, 3, 2)
    with pytest.raises(DomainError, match=r"parameters: expected shape \(…, 2\), as those of a surface, got \(3,\)"):
        pentagon.evaluate([1, 1, 1])


def test_parameters_of_a_curve_too():
    curve = gtb_cli.load(SPECS / "cubic-bezier.toml")
    low, high = curve.domain.vertices.ravel()
    t = np.linspace(low, high, 6)
    assert curve.evaluate(t[2]).shape == (3,)
    np.testing.assert_array_equal(curve.evaluate(t.reshape(2, 3)), curve.evaluate(t).reshape(2, 3, 3))
    np.testing.assert_array_equal(curve.evaluate(t[:, None]), curve.evaluate(t))


# --- names


def test_only_what_is_public_is_listed():
    assert dir(gtb_cli) == sorted(gtb_cli.__all__)
    for name in gtb_cli.__all__:
        assert getattr(gtb_cli, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        gtb_cli.nothing  # noqa: B018
