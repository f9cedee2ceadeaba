"""Sides of cells: which share an edge, which are open, which vertices are in use."""

import numpy as np
import pytest

from gtb_cli.meshes.topology import are_proper, are_used, compacted, component_count, sides_of

SQUARE = np.array([[0, 1, 2], [0, 2, 3]])


def test_sides_of_two_triangles():
    sides = sides_of(SQUARE)
    assert sides.directed.tolist() == [[0, 1], [1, 2], [2, 0], [0, 2], [2, 3], [3, 0]]
    assert sides.edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]
    assert sides.edge.tolist() == [[0, 3, 1], [1, 4, 2]]
    assert sides.first.tolist() == [0, 2, 5, 1, 4]
    assert sides.uses.tolist() == [1, 2, 1, 1, 1]
    assert sides.balance.tolist() == [1, 0, -1, 1, 1]
    assert sides.alone.tolist() == sides.open.tolist() == [0, 1, 4, 5]
    assert sides.is_manifold.all()


def test_sides_of_segments_are_these():
    segments = np.array([[3, 1], [1, 2]])
    sides = sides_of(segments)
    assert sides.directed.tolist() == segments.tolist()
    assert sides.edges.tolist() == [[1, 2], [1, 3]]
    assert sides.edge.tolist() == [[1], [0]]


@pytest.mark.parametrize(
    ("cells", "alone", "unmet", "wrong"),
    [
        ([[0, 1, 2], [0, 3, 2]], [0, 1, 3, 4], [0, 1, 2, 3, 4, 5], [[0, 2]]),  # a face is turned over
        ([[0, 1, 2], [1, 0, 3], [0, 1, 4]], [1, 2, 4, 5, 7, 8], [*range(9)], [[0, 1]]),  # an edge of three faces
        ([[0, 0, 1]], [], [], [[0, 0]]),  # a side with one end is not proper
        (np.empty((0, 3), dtype=np.int64), [], [], []),
    ],
)
def test_sides_that_are_alone_open_or_not_of_a_manifold(cells, alone, unmet, wrong):
    sides = sides_of(np.array(cells))
    assert sides.alone.tolist() == alone
    assert sides.open.tolist() == unmet
    assert sides.edges[~(sides.is_manifold & sides.is_proper)].tolist() == wrong


def test_indices_near_the_limit_of_32_bits_are_told_apart():
    """Edges are sorted as single numbers, of up to 62 bits."""
    cells = SQUARE + (2**31 - 5)
    found, expected = sides_of(cells.astype(np.int32)), sides_of(cells)
    for name in ("directed", "edges", "edge", "first", "uses"):
        assert getattr(found, name).tolist() == getattr(expected, name).tolist()
    assert found.edges.tolist() == (sides_of(SQUARE).edges + (2**31 - 5)).tolist()


@pytest.mark.parametrize(
    ("cells", "proper"),
    [([[0, 1], [2, 2]], [True, False]), ([[0, 1, 2], [0, 0, 1], [0, 1, 1], [1, 0, 1]], [True, False, False, False])],
)
def test_proper_cells_have_distinct_vertices(cells, proper):
    assert are_proper(np.array(cells)).tolist() == proper


def test_vertices_in_use():
    cells = np.array([[5, 1, 2]])
    assert are_used(cells, 7).nonzero()[0].tolist() == [1, 2, 5]
    used, renumbered = compacted(cells)
    assert used.tolist() == [1, 2, 5]
    assert renumbered.tolist() == [[2, 0, 1]]


def test_components_count_no_unused_vertices():
    assert component_count(SQUARE, 4) == component_count(SQUARE, 9) == 1
    assert component_count(np.array([[0, 1], [2, 3]]), 4) == 2
