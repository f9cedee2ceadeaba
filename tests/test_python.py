"""The library as the user of a notebook meets it: values, grids, files and names, all from `import gtb_cli`."""

import copy
import json
import pickle

import numpy as np
import pytest

import gtb_cli
from gtb_cli import DomainError, Mesh, Model, Patch
from tests.marks import long
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


def arrays_of(value):
    fields = [getattr(value, name) for name in value.__dataclass_fields__]
    return [field for field in fields if isinstance(field, np.ndarray)]


def test_values_are_copied_and_pickled_with_arrays_that_stay_read_only(values):
    for value in values:
        copies = pickle.loads(pickle.dumps(value)), copy.deepcopy(value), copy.copy(value)
        for other in copies:
            assert other is not value
            assert other == value
            assert hash(other) == hash(value)
        for array in (array for other in (value, *copies) for array in arrays_of(other)):
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
    yield pentagon.replace(edge_normals="unit")
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


def test_values_are_short_to_look_at(values):
    shown = [repr(value) for value in values[:5]]
    assert shown[0] == "<Patch pentagon: 5-sided surface, 8 knots>"
    assert shown[1] == "<Model box-corner: 7 surfaces>"
    assert shown[3].startswith("<Mesh pentagon: ")
    assert max(map(len, shown)) < 80
    assert repr(Patch([0, 1], [[0, 0], [1, 1]])) == "<Patch without a name: curve, 2 knots>"


@long
def test_results_are_short_to_look_at(pentagon, box):
    """A notebook shows what the last line gives: hundreds of numbers hide what is asked for."""
    doubled = pentagon.replace(control_points=2 * pentagon.control_points)
    report = gtb_cli.check(pentagon)
    statuses = [finding.status for finding in report.findings]
    shown = {
        repr(report): f"<Report pentagon: {statuses.count('holds')} hold, 0 fail, ",
        repr(gtb_cli.check(Model([pentagon]))): "<ModelReport without a name: ",
        repr(
            gtb_cli.diff(pentagon, doubled, 1)
        ): "<Difference: different, patches 4.58 apart, tolerance 1>",  # (1, 2, 4) moves by √21
        repr(
            gtb_cli.regular_decomposition(pentagon.knots, pentagon.lifting)
        ): "<RegularDecomposition: 8 knots, 5 cells, 0",
        repr(pentagon.domain): "<Domain: 5-sided polygon, 8 knots>",
        repr(Patch([0, 1], [[0, 0], [1, 1]]).domain): "<Domain: interval, 2 knots>",
        repr(gtb_cli.fill(box, raises=0)): "<Filling: 6 sides, planes met within ",
    }
    for found, start in shown.items():
        assert found.startswith(start)
        assert len(found) < 120


def test_what_is_not_meant_is_said(pentagon, tmp_path):
    for call, message in (
        (lambda: pentagon.replace(weights=1), r"weights: expected 8, one for each knot, got shape \(\)"),
        (lambda: pentagon.replace(lifting=np.ones((8, 1))), r"lifting: expected 8, .*got shape \(8, 1\)"),
        (lambda: pentagon.replace(weights=["1/2"] * 8), "weights: .*gtb_cli.from_dict takes expressions"),
        (lambda: Patch([0, 1], [["pi", 0], [1, 1]]), "control_points: .*gtb_cli.from_dict takes expressions"),
        (lambda: gtb_cli.page(None), "expected a Patch or Model or Mesh, or the path of a spec file, got NoneType"),
        (lambda: gtb_cli.plot([1]), "expected a Patch or Model or Mesh, .*got list"),
        (lambda: gtb_cli.check(3), "expected a Patch or Model, .*got int"),
        (lambda: gtb_cli.bezier_pieces({}), "expected a Patch or Model, .*got dict"),
        (lambda: gtb_cli.convergence_rate(pentagon), "expected a RegularDecomposition, got Patch"),
        (lambda: gtb_cli.joints(pentagon), "expected a Model, or the path of a spec file, got Patch"),
        (lambda: gtb_cli.write_mesh(pentagon, tmp_path / "x.stl"), "expected a Mesh, such as .*, got Patch"),
        (lambda: gtb_cli.write_mesh(gtb_cli.tessellate(pentagon, 1), tmp_path / "x.glb", up="x"), "expected z or y"),
        (lambda: gtb_cli.save(pentagon, tmp_path / "x.obj"), r"x\.obj: expected a name that ends in \.toml or \.json"),
        (lambda: gtb_cli.save(pentagon, tmp_path / "x.step"), r"x\.step: expected a name that ends in"),
    ):
        with pytest.raises(gtb_cli.GtbError, match=message) as caught:
            call()
        assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


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


# --- files


def everything(pentagon, box):
    yield pentagon
    yield box
    yield pentagon.replace(lifting=np.arange(8) - 0.1, edge_scale=[1, 1, 1, 1, 1 / 3], edge_normals="unit")
    yield pentagon.replace(control_points=-0.0 * pentagon.control_points, coefficients=np.arange(1, 9) * 1e-300)
    yield gtb_cli.degenerate(pentagon, 5, lifting=np.arange(8) / 7)
    yield gtb_cli.degenerate(pentagon, 1e300, lifting=np.arange(8))
    yield gtb_cli.elevate(gtb_cli.load(SPECS / "cubic-bezier.toml"))
    yield Model(gtb_cli.regular_control_surface(gtb_cli.load(SPECS / "example-4.4.toml")).patches, "cells")


@pytest.mark.parametrize("suffix", ["toml", "json"])
def test_what_is_saved_loads_again_bit_for_bit(pentagon, box, tmp_path, suffix):
    for spec in everything(pentagon, box):
        path = tmp_path / f"x.{suffix}"
        gtb_cli.save(spec, path)
        again = gtb_cli.load(path)
        assert again == spec
        for one, other in zip(*(x if isinstance(x, Model) else [x] for x in (spec, again)), strict=True):
            assert [a.tobytes() for a in arrays_of(one)] == [a.tobytes() for a in arrays_of(other)]
        assert gtb_cli.from_dict(gtb_cli.to_dict(spec)) == spec
        assert gtb_cli.from_dict(json.loads(json.dumps(gtb_cli.to_dict(spec)))) == spec


def test_what_a_spec_cannot_hold_is_refused_and_leaves_what_was_there(pentagon, tmp_path):
    path = tmp_path / "x.toml"
    gtb_cli.save(pentagon, path)
    before = path.read_bytes()
    for change, message in (
        ({"name": "a\nb"}, "control characters"),
        ({"control_points": pentagon.control_points * 1e101}, "must be at most 1e.100 in size"),
        ({"weights": np.full(8, 2.0), "log_weights": np.full(8, np.log(2) + 1e-12)}, "cannot hold this exactly"),
    ):
        with pytest.raises(gtb_cli.SpecError, match=message):
            gtb_cli.save(pentagon.replace(**change), path)
    with pytest.raises(gtb_cli.SpecError, match="expected a Patch or a Model, got str"):
        gtb_cli.save("x", path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_dictionary_takes_what_a_spec_does_and_arrays():
    found = gtb_cli.from_dict(
        {"knots": np.arange(3), "control_points": [(0, 0), (1, "sqrt(2)"), (2, 0)], "coefficients": "binomial"}
    )
    assert found == Patch([0, 1, 2], [[0, 0], [1, 2**0.5], [2, 0]], coefficients=[1, 2, 1])
    with pytest.raises(gtb_cli.SpecError, match=r"^from_dict: weights\[1\]: must be positive, got -1$"):
        gtb_cli.from_dict({"knots": [0, 1], "control_points": [[0, 0], [1, 1]], "weights": [1, -1]})
    with pytest.raises(gtb_cli.SpecError, match="weigths: is not a key of a spec, did you mean weights"):
        gtb_cli.from_dict({"knots": [0, 1], "control_points": [[0, 0], [1, 1]], "weigths": [1, 1]})


def test_what_takes_a_patch_takes_the_path_of_its_spec(pentagon, box):
    curve, path = SPECS / "example-3.1.toml", str(SPECS / "pentagon.toml")
    assert gtb_cli.degenerate(path, 5, range(8)) == gtb_cli.degenerate(pentagon, 5, range(8))
    assert gtb_cli.merge_knots(curve, {1: 2}) == gtb_cli.merge_knots(gtb_cli.load(curve), {1: 2})
    assert gtb_cli.elevate(patch=curve) == gtb_cli.elevate(gtb_cli.load(curve))
    assert gtb_cli.boundary(path, 0) == pentagon.boundary(0)
    assert gtb_cli.check(curve) == gtb_cli.check(gtb_cli.load(curve))
    assert gtb_cli.joints(SPECS / "box-corner.toml") == gtb_cli.joints(box)
    for wrong, message in (
        (SPECS / "box-corner.toml", "box-corner.toml: expected a single patch, this is a model of 7"),
        (box, "expected a Patch, or the path of a spec file, got Model"),
        (3, "expected a Patch, or the path of a spec file, got int"),
        ("nowhere.toml", "nowhere.toml: No such file"),
    ):
        with pytest.raises(gtb_cli.GtbError, match=message):
            gtb_cli.quadrature(wrong)


# --- meshes


def test_meshes_are_made_of_files_patches_and_several(pentagon, box):
    path = SPECS / "pentagon.toml"
    mesh = gtb_cli.tessellate(pentagon, 4)
    assert gtb_cli.tessellate(str(path), 4) == gtb_cli.tessellate(path, 4) == mesh
    assert gtb_cli.tessellate(list(box), 2).faces.tolist() == gtb_cli.tessellate(box, 2).faces.tolist()
    with pytest.raises(DomainError, match="Model or list or tuple, or the path of a spec file, got Mesh"):
        gtb_cli.tessellate(mesh)
    with pytest.raises(DomainError, match=r"patches\[0\]: expected a Patch, got int"):
        gtb_cli.tessellate([1])


def test_options_exclude_each_other_as_on_the_command_line(pentagon):
    for call in (lambda: gtb_cli.tessellate(pentagon, 8, 0.1), lambda: gtb_cli.Recipe(8, 0.1)):
        with pytest.raises(DomainError, match="resolution: excludes a tolerance"):
            call()
    for change, message in (
        ({"resolution": 0}, "resolution: expected a whole number of at least 1, got 0"),
        ({"resolution": 2.5}, "resolution: expected a whole number"),
        ({"radius": -1}, "radius: must be positive"),
        ({"thickness": 0}, "thickness: must be a number other than zero"),
        ({"tolerance": 0}, "tolerance: must be positive"),
    ):
        with pytest.raises(DomainError, match=message):
            gtb_cli.Recipe(**change)


# --- the rest of the paper and of the commands


def test_every_task_has_a_public_name(box):
    assert gtb_cli.joints(box) is box.joints
    assert [seam.first for seam in box.seams] == [joint.first for joint in box.joints.shared]
    curve = gtb_cli.fit([[0, 0], [1, 2], [3, 1]]).curve
    np.testing.assert_allclose(curve.evaluate(curve.domain.vertices.ravel()), [[0, 0, 0], [3, 1, 0]])
    assert gtb_cli.check(curve).holds
    cubic = gtb_cli.load(SPECS / "cubic-bezier.toml")
    assert gtb_cli.diff(cubic, gtb_cli.elevate(cubic), recipe=gtb_cli.Recipe(parametrization="toric")).same
    assert not gtb_cli.diff(curve, curve.replace(control_points=curve.control_points * 2)).same


def test_meshes_files_and_specs_are_compared(pentagon, tmp_path):
    mesh = gtb_cli.tessellate(pentagon, 4)
    gtb_cli.write_mesh(mesh, tmp_path / "x.ply")
    again = gtb_cli.read_mesh(tmp_path / "x.ply")
    recipe = gtb_cli.Recipe(4)
    for a, b in ((mesh, again), (tmp_path / "x.ply", pentagon), (again, str(SPECS / "pentagon.toml"))):
        found = gtb_cli.diff(a, b, 1e-6, recipe=recipe)
        assert found.same
        assert found.method == "vertices"
    with pytest.raises(gtb_cli.GtbError, match=r"missing\.obj: No such file"):
        gtb_cli.diff(mesh, "missing.obj")
