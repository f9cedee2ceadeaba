"""Work shared among threads: results in order, the same bytes, errors where they belong."""

import os

import numpy as np
import pytest

from gtb_cli.formats.export import encode_mesh
from gtb_cli.process.threads import in_threads, limit_threads, thread_count
from gtb_cli.tessellation.tessellate import tessellate
from tests.patches import cubic_curve, pentagon
from tests.shell import PENTAGON, gtb


@pytest.fixture(autouse=True)
def unlimited():
    yield
    limit_threads(0)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_results_are_in_order(count):
    limit_threads(count)
    assert list(in_threads(lambda x: x * x, range(100))) == [x * x for x in range(100)]


def test_tasks_are_taken_as_results_are():
    limit_threads(2)
    taken = []
    results = in_threads(lambda x: x, (taken.append(x) or x for x in range(1000)))
    assert next(results) == 0
    assert len(taken) < 10
    results.close()


def test_an_error_is_raised_where_its_result_would_be():
    limit_threads(2)
    results = in_threads(lambda x: 1 // x, [1, 1, 0, 1])
    assert [next(results), next(results)] == [1, 1]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_threads_treat_overflow_as_their_caller_does():
    limit_threads(2)
    with np.errstate(over="raise"):
        results = in_threads(np.exp, [np.array([800.0]), np.array([0.0])])
        with pytest.raises(FloatingPointError):
            list(results)


def test_without_a_limit_there_is_one_for_each_processor():
    limit_threads(0)
    assert 1 <= thread_count() <= (os.cpu_count() or 1)


@pytest.mark.parametrize(("patch", "resolution"), [(pentagon(), 100), (cubic_curve(), 60_000)])
def test_the_bytes_do_not_depend_on_the_number(patch, resolution):
    written = []
    for count in (1, 2, 3):
        limit_threads(count)
        mesh = tessellate(patch, resolution, normals=True)
        written.append(b"".join(encode_mesh(mesh, "obj", normals=True)))
    assert written[0] == written[1] == written[2]


def test_a_command_is_told_how_many(tmp_path):
    assert gtb("mesh", PENTAGON, "-n", 2, "--threads", 3, "-o", tmp_path / "x.obj").status == 0
    assert thread_count() == 3
    assert "whole number" in gtb("mesh", PENTAGON, "--threads", "two", status=2).err
