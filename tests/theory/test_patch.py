"""The laws on every patch, and grids of parameters."""

import numpy as np
import pytest
from hypothesis import given, settings

from gtb_cli.errors import DomainError
from gtb_cli.theory.normals import tangents
from tests.laws import LAWS
from tests.marks import mostly_long
from tests.patches import NAMES, any_patch, named


@pytest.mark.parametrize("name", mostly_long(sorted(NAMES, key="sixty_knots".__eq__), 14))
def test_a_named_patch_obeys(name):
    for law in LAWS:
        law(named(name))


@settings(max_examples=settings.default.max_examples // 2)
@given(patch=any_patch())
def test_any_patch_obeys(patch):
    for law in LAWS:
        law(patch)


def test_derivatives_and_normals_of_a_grid_are_those_of_its_parameters():
    patch = named("bicubic")
    u = np.stack(np.meshgrid([1e-9, 0.4, 1.5, 2.9], [1e-9, 1.0, 3 - 1e-9]), axis=-1)
    for method in (patch.evaluate, patch.basis, patch.derivatives, patch.basis_derivatives, patch.normals):
        found = method(u)
        assert found.shape[:2] == u.shape[:2]
        np.testing.assert_allclose(found.reshape(12, -1), method(u.reshape(-1, 2)).reshape(12, -1), atol=1e-11)


CURVE, SURFACE = named("cubic_curve"), named("bicubic")
OUTSIDE = np.ones((4, 3, 2)) * [[1], [1], [9]] * (np.arange(12) == 11).reshape(4, 3, 1) + 1


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: SURFACE.evaluate(OUTSIDE), r"parameters\[11\].* outside the domain"),
        (lambda: SURFACE.evaluate([[1, 1]], "conic"), "parametrization: expected toric or linear, got 'conic'"),
        (lambda: SURFACE.derivatives([[1, 1]], 3), "order: expected 1 or 2, got 3"),
        (lambda: SURFACE.derivatives([[1, 1]], 1, "polar"), "parametrization: expected toric or linear, got 'polar'"),
        (lambda: CURVE.normals([0.5]), "normals: a curve has none"),
        (lambda: CURVE.curvature([0.5]), "this is a curve"),
        (lambda: SURFACE.curvature([[1, 1]], "polar"), "expected toric or linear, got 'polar'"),
        (lambda: SURFACE.curvature([[1, 4]]), "outside the domain"),
        (lambda: tangents(SURFACE, [[1, 1]]), "a surface has many at a point"),
        (lambda: tangents(CURVE, [1.0], "polar"), "expected toric or linear"),
    ],
)
def test_what_a_patch_does_not_have_is_refused(call, message):
    with pytest.raises(DomainError, match=message):
        call()
