"""The door at which arrays are checked."""

import numpy as np
import pytest

from gtb_cli.arrays import (
    as_indices,
    bounds_of,
    cross,
    dot,
    finite,
    index_type,
    paired,
    planar_cross,
    point_text,
    positive,
    read_only,
    shifted,
    unit,
)
from gtb_cli.errors import DomainError
from tests.tables import cases


def test_a_read_only_array_is_a_copy_of_float64_in_row_order():
    source = np.asfortranarray(np.arange(6, dtype=np.float32).reshape(2, 3))
    array = read_only(source)
    source[0, 0] = 9
    assert array.dtype == np.float64
    assert array.flags.c_contiguous
    assert array.tolist() == [[0, 1, 2], [3, 4, 5]]
    with pytest.raises(ValueError, match="read-only"):
        array[0, 0] = 1


def test_finite_takes_lists_of_any_depth():
    assert finite("knots", [1, 2]).tolist() == [1, 2]
    assert finite("knots", [[1, 2.5]]).tolist() == [[1, 2.5]]
    assert finite("knots", []).shape == (0,)
    assert finite("scale", 3).shape == ()


@pytest.mark.parametrize(
    ("values", "message"), [*cases("refused", "finite"), ([1j], "weights: not a regular array of numbers")]
)
def test_finite_names_the_field_and_the_first_bad_entry(values, message):
    with pytest.raises(DomainError, match=f"^{message}"):
        finite("weights", values)


@pytest.mark.parametrize(("values", "message"), cases("refused", "positive"))
def test_positive_names_the_field_and_the_first_bad_entry(values, message):
    with pytest.raises(DomainError, match=f"^{message}$"):
        positive("weights", values)


def test_products_of_vectors_are_those_of_numpy():
    rng = np.random.default_rng(7)
    a, b = rng.normal(size=(2, 50, 3))
    assert np.allclose(dot(a, b), (a * b).sum(axis=1), rtol=1e-14)
    assert np.array_equal(cross(a, b), np.cross(a, b))
    assert np.array_equal(cross(a, b[:1]), np.cross(a, b[:1]))
    assert np.array_equal(cross(a.T, b.T, 0), np.cross(a, b).T)
    flat = a.copy()
    flat[:, 2] = 0
    assert np.array_equal(planar_cross(flat[:, :2], b[:, :2]), np.cross(flat, b)[:, 2])


def test_unit_vectors_have_length_one_but_for_zero():
    assert unit(np.array([[3.0, 4.0], [0.0, 0.0]])).tolist() == [[0.6, 0.8], [0.0, 0.0]]


# --- indices ---------------------------------------------------------------------------------------------------------

LAST = 2**31 - 2  # the largest index, counted from 0, that 32 bits hold when it is counted from 1


def test_indices_have_32_bits_only_if_these_hold_them_counted_from_1():
    assert index_type(LAST + 1) is np.int32
    assert index_type(LAST + 2) is np.int64
    assert (np.array([LAST], dtype=index_type(LAST + 1)) + 1).item() == LAST + 1


def test_products_and_sums_of_indices_near_the_limit_are_right():
    first, second = np.array([LAST, 0], dtype=np.int32), np.array([LAST, LAST], dtype=np.int32)
    assert paired(first, second, LAST + 1).tolist() == [LAST * (LAST + 1) + LAST, LAST]
    assert shifted(first, LAST).tolist() == [2 * LAST, LAST]


def test_a_wrong_index_stays_wrong_in_32_bits():
    assert as_indices(np.array([0, LAST]), np.int32).dtype == np.int32
    for wrong in (np.array([0, 2**32 + 1]), np.array([-(2**32), 1]), np.array([0, 2**31], dtype=np.uint32)):
        assert as_indices(wrong, np.int32).tolist() == wrong.tolist()
    with pytest.raises(TypeError, match="whole numbers"):
        as_indices(np.array([0.0, 1.0]), np.int32)


@pytest.mark.parametrize("count", [1, 63, 64, 65, 128, 1000])
def test_bounds_are_the_extremes_of_each_column(count):
    points = np.random.default_rng(count).standard_normal((count, 3))
    for rows in (points, np.asfortranarray(points), points[::-1]):
        assert bounds_of(rows).tolist() == [points.min(axis=0).tolist(), points.max(axis=0).tolist()]
    points[count // 2, 1] = np.nan
    assert np.isnan(bounds_of(points)).tolist() == 2 * [[False, True, False]]


@pytest.mark.parametrize(
    ("size", "shift", "text"),
    [
        (1, 0, "(0.3333, 0, 0.6667)"),
        (1e-9, 0, "(3.333e-10, 0, 6.667e-10)"),
        (80, 1e7, "(10000026.7, 10000000, 10000053.3)"),
    ],
)
def test_a_point_is_told_from_others_of_its_model_wherever_that_is(size, shift, text):
    around = np.array([[0, 0, 0], [1, 1, 1]]) * size + shift
    assert point_text(np.array([1 / 3, 1e-17, 2 / 3]) * size + shift, around) == text
