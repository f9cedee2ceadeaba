"""The laws on every patch, and grids of parameters."""

import numpy as np
import pytest
from hypothesis import given, settings

from gtb_cli.errors import DomainError
from tests.laws import LAWS
from tests.marks import mostly_long
from tests.patches import NAMES, any_patch, named


@pytest.mark.parametrize("name", mostly_long(sorted(NAMES, key="sixty_knots".__eq__), 14))
def test_a_named_patch_obeys(name):
    for law in LAWS:
        law(named(name))


@settings(max_examples=2 * settings.default.max_examples // 3)
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
    with pytest.raises(DomainError, match=r"parameters\[11\].* outside the domain"):
        patch.evaluate(u + [0.0, 2.0] * (u[:, :, :1] > 2))
