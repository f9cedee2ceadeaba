"""Cells of one mesh, cut until each part lies over one cell of another mesh."""

import numpy as np
import pytest

from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.meshes.overlay import CellParts


@pytest.mark.parametrize("ulps", [1, 2, 3])
def test_a_plane_that_is_passed_within_rounding_does_not_cut(ulps):
    """It left a piece 2e-10 long as long as before, for thousands of rounds: 100 s for one step of a knot."""
    end = 0.3 + ulps * np.spacing(0.3)
    piece = np.array([[[0.3, 0.01, 0.0], [0.3 + 2e-10, 0.01, 0.0]]])
    below = NearestCells(np.array([[[-0.4, 0.0, 0.0], [end, 0.0, 0.0]], [[end, 0.0, 0.0], [0.4, 0.0, 0.0]]]))
    parts = CellParts(piece, np.array([1.0]), np.array([1]), np.array([1]), np.array([1.0])).cut(below)
    lengths = np.linalg.norm(parts.corners[:, 1] - parts.corners[:, 0], axis=1)
    np.testing.assert_allclose(lengths, [1e-10, 1e-10], rtol=1e-4)
