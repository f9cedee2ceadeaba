"""A little of what `make fuzz` does at length."""

from __future__ import annotations

import pytest

from tests.fuzz import kill, mutate


def test_mutated_specs_give_a_mesh_or_a_message():
    assert mutate(500, seed=1) is None


@pytest.mark.parametrize("victim", ["mesh.ply", "degenerate"])
def test_a_killed_process_leaves_what_was_there_or_what_is_new(victim):
    assert kill(4, seed=1, victims=[victim]) is None
