"""Points at the same place become one number, in the order in which they appear."""

import numpy as np
from hypothesis import given, strategies as st

from gtb_cli.arrays import merged
from gtb_cli.meshes import coincident
from gtb_cli.meshes.coincident import numbered_places
from tests.specs import quickly

COORDINATES = st.sampled_from([0.0, -0.0, 1.0, 1.0 + 2**-52, -1.0, 1e-300, 1e300])


def by_dictionary(points: np.ndarray) -> tuple[list[int], list[int]]:
    seen: dict[tuple[float, ...], int] = {}
    first, labels = [], []
    for index, point in enumerate(map(tuple, points.tolist())):
        if point not in seen:
            seen[point] = len(seen)
            first.append(index)
        labels.append(seen[point])
    return first, labels


@given(st.lists(st.tuples(COORDINATES, COORDINATES, COORDINATES), max_size=40))
def test_as_a_dictionary_does_it(points):
    array = np.array(points).reshape(-1, 3)
    first, labels = numbered_places(array)
    assert (first.tolist(), labels.tolist()) == by_dictionary(array)


def test_keys_that_are_equal_by_chance(monkeypatch):
    monkeypatch.setattr(coincident, "_FACTORS", np.zeros(3, dtype=np.uint64))  # all keys are zero
    points = np.random.default_rng(1).integers(0, 3, (50, 3)).astype(float)
    first, labels = numbered_places(points)
    assert (first.tolist(), labels.tolist()) == by_dictionary(points)


@given(st.lists(st.tuples(st.integers(0, 19), st.integers(0, 19)), max_size=30))
def test_what_pairs_connect_has_its_smallest_index(pairs):
    label = list(range(20))
    for _ in label:
        for a, b in pairs:
            label[a] = label[b] = min(label[a], label[b])
    assert merged(20, np.array(pairs, dtype=np.int64).reshape(-1, 2)).tolist() == label


def test_a_long_way_in_any_order_takes_little_time():
    """Each smallest index once went one step in a round: a way through 20,000 took seconds, and a large mesh, too."""
    way = np.random.default_rng(0).permutation(50_000)
    with quickly():
        assert not merged(len(way), np.stack([way[:-1], way[1:]], axis=1)).any()
