"""Layers of knots over an edge."""

import numpy as np
import pytest

from gtb_cli.knots.layers import layers


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_knots_equally_far_to_rounding_are_one_layer(scale):
    heights = np.array([1.0, 0.0, 0.3, 0.1 * 3, 1 + 1e-12, 2.0]) * scale
    assert [layer.tolist() for layer in layers(heights)] == [[2, 3], [0, 4], [5]]
