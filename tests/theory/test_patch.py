"""`Patch`: the laws, values, derivatives, normals, boundary curves, errors."""

import pytest
from hypothesis import given, settings

from tests.laws import LAWS
from tests.marks import long
from tests.patches import NAMES, any_patch, named


@pytest.mark.parametrize("name", [pytest.param(name, marks=long if name == "sixty_knots" else ()) for name in NAMES])
def test_a_named_patch_obeys(name):
    for law in LAWS:
        law(named(name))


@settings(max_examples=2 * settings.default.max_examples // 3)
@given(patch=any_patch())
def test_any_patch_obeys(patch):
    for law in LAWS:
        law(patch)
