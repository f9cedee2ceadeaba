"""A little of what `make fuzz` does at length."""

from __future__ import annotations

from tests.fuzz import kill, mutate


def test_mutated_specs_give_a_mesh_or_a_message():
    assert mutate(500, seed=1) is None


def test_a_killed_process_leaves_the_old_file_or_the_new_one():
    assert kill(6, seed=1, kinds=("obj",)) is None
