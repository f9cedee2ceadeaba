"""Array types, checks of arrays that come in, and products of vectors."""

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import pairwise
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtb_cli.errors import DomainError

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.signedinteger[Any]]
BoolArray: TypeAlias = NDArray[np.bool_]

Table = TypeVar("Table", bound=tuple[Any, ...])  # a named tuple of arrays with as many rows

EPS = float(np.finfo(np.float64).eps)  # distance from 1 to the next float
INDEX_ROWS = 1 << 16  # rows of indices that are used at once: their 64 bits fit in the cache


def read_only(values: ArrayLike) -> FloatArray:
    """Return `values` as a new C-contiguous float64 array that cannot be written to."""
    array = np.array(values, dtype=np.float64, order="C")
    array.flags.writeable = False
    return array


def finite(name: str, values: ArrayLike) -> FloatArray:
    """Return `values` as a read-only float64 array, or raise `DomainError` naming the first non-finite entry."""
    try:
        if np.iscomplexobj(values):
            raise TypeError("complex")
        array = read_only(values)
    except (TypeError, ValueError) as error:
        hint = "; gtb_cli.from_dict takes expressions" if "convert string" in str(error) else ""
        raise DomainError(f"{name}: not a regular array of numbers ({error}){hint}") from None
    return _each(name, array, np.isfinite(array), "finite")


def one_for_each(name: str, values: FloatArray, count: int, each: str, row: tuple[int, ...] = ()) -> FloatArray:
    """Return `values` if they have `count` entries of the shape `row`, or raise `DomainError`."""
    if values.shape != (count, *row):
        found = len(values) if values.ndim and values.shape[1:] == row else f"shape {values.shape}"
        raise DomainError(f"{name}: expected {count}, one for each {each}, got {found}")
    return values


def positive(name: str, values: ArrayLike) -> FloatArray:
    """Return `values` as `finite` does, or raise `DomainError` naming the first entry that is not positive."""
    array = finite(name, values)
    return _each(name, array, array > 0, "positive")


def _each(name: str, array: FloatArray, holds: BoolArray, expected: str) -> FloatArray:
    if not holds.all():
        index = tuple(np.argwhere(~holds)[0].tolist())
        raise DomainError(f"{name}{''.join(f'[{i}]' for i in index)}: must be {expected}, got {array[index]:g}")
    return array


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the scalar products of rows: (m, d) → (m,)."""
    return np.asarray(np.einsum("ij,ij->i", a, b))


def column_dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the scalar products of columns: (d, m) → (m,); for d up to 3 faster than a reduction by numpy."""
    return np.asarray(reduce(np.add, map(np.multiply, a, b)))


def cross(a: FloatArray, b: FloatArray, axis: int = -1) -> FloatArray:
    """Return the vector products of vectors along an axis; `numpy.cross` takes three times as long."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    x, y, z = (each.swapaxes(axis, 0) for each in (a, b, result))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        np.subtract(x[i] * y[j], x[j] * y[i], out=z[k, ...])
    return result


def planar_cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the third coordinates of vector products in the plane: (..., 2) → (...)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def angles_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the angles in degrees between vectors, (…, 3) → (…); NaN where a vector is NaN."""
    return np.asarray(np.degrees(np.arctan2(np.linalg.norm(cross(a, b), axis=-1), (a * b).sum(axis=-1))))


def two_product(a: FloatArray, b: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Return a * b as a float, and its rounding error: Dekker's product, with Veltkamp's splitting into halves."""
    splitter = 2.0**27 + 1  # factor that splits a float into two halves of 26 bits
    (a_high, a_low), (b_high, b_low) = ((high := x * splitter - (x * splitter - x), x - high) for x in (a, b))
    product = np.asarray(a * b)
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def unit(vectors: FloatArray) -> FloatArray:
    """Scale rows to length 1, (m, d); 0 stays 0."""
    length = np.sqrt(dot(vectors, vectors))[:, None]
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def bounds_of(points: NDArray[Any]) -> NDArray[Any]:
    """Return the lowest and the highest coordinates of points: (m, d) → (2, d)."""
    # Column by column: numpy reduces short rows slowly.
    return np.array([[column.min() for column in points.T], [column.max() for column in points.T]])


def point_text(point: FloatArray, around: FloatArray) -> str:
    """Return a point for messages, with four digits of the size of the (m, d) points around it, more if they are far.

    What is rounding of this size is written as 0.
    """
    low, high = bounds_of(around)
    size = float((high - low).max())
    far = float(max(np.abs(low).max(), np.abs(high).max()))
    digits = 4 + int(np.log10(max(1.0, min(far / size, 1e13)))) if size else 17
    return f"({', '.join(f'{x if abs(x) > 1e-9 * size else 0.0:.{digits}g}' for x in point.tolist())})"


def distinct(values: NDArray[Any]) -> NDArray[Any]:
    """Return distinct rows, or numbers, sorted; without indices `numpy.unique` imports numpy.ma."""
    return np.asarray(np.unique(values, axis=0, return_index=True)[0])


def rows_of(table: Table, rows: IntArray | BoolArray | slice) -> Table:
    """Return some rows of a named tuple of arrays."""
    if isinstance(rows, slice):
        return tuple.__new__(type(table), [column[rows] for column in table])
    rows = np.flatnonzero(rows) if rows.dtype == bool else rows
    return tuple.__new__(type(table), [column.take(rows, axis=0) for column in table])


def joined(tables: Sequence[Table]) -> Table:
    """Return the rows of several named tuples of arrays, one table after another."""
    return tuple.__new__(type(tables[0]), [np.concatenate(columns) for columns in zip(*tables, strict=True)])


def index_type(count: int) -> type[np.signedinteger[Any]]:
    """Return the type of indices of `count` rows, also if counted from 1: 32 bits where they suffice."""
    return np.int32 if count <= np.iinfo(np.int32).max else np.int64


def as_indices(values: NDArray[Any], kind: type[np.signedinteger[Any]]) -> IntArray:
    """Return whole numbers in a type of indices; in 64 bits if a wrong one does not fit, so that it stays wrong."""
    if values.dtype.kind not in "iu":
        raise TypeError(f"whole numbers are expected, these are {values.dtype}")
    indices = values.astype(kind, copy=False)
    return indices if indices is values or np.array_equal(indices, values) else values.astype(np.int64)


def row_blocks(count: int, length: int) -> Iterator[slice]:
    """Yield the rows from 0 to `count`, at most `length` at a time."""
    return (slice(start, min(start + length, count)) for start in range(0, count, length))


def taken(values: NDArray[Any], indices: IntArray) -> NDArray[Any]:
    """Return the values at (k, c) indices, by blocks: numpy makes 64 bits of all indices that it takes at once."""
    result = np.empty(indices.shape, dtype=values.dtype)
    for rows in row_blocks(len(indices), INDEX_ROWS):
        result[rows] = values[indices[rows]]
    return result


def shifted(indices: IntArray, by: int) -> IntArray:
    """Return indices increased by `by`, in 64 bits."""
    return np.add(indices, by, dtype=np.int64)


def paired(first: IntArray, second: IntArray, count: int) -> IntArray:
    """Number pairs of indices in their order, the second index below `count`; in 64 bits, which hold the products."""
    return np.multiply(first, count, dtype=np.int64) + second


def grid_knots(rows: int, columns: int) -> FloatArray:
    """(n, 2) knots of a grid, row by row."""
    return np.indices((rows, columns), dtype=float).reshape(2, -1).T


def merged(count: int, pairs: IntArray) -> IntArray:
    """Return the smallest index, (count,), to which each index is connected by (c, 2) pairs."""
    label = np.arange(count, dtype=index_type(count))
    one, other = pairs.T
    while len(one):
        np.minimum.at(label, np.maximum(one, other), np.minimum(one, other))
        while not np.array_equal(label, above := label[label]):
            label = above
        one, other = label[one], label[other]
        apart = one != other
        one, other = one[apart], other[apart]
    return label


def groups(numbers: IntArray) -> Iterator[tuple[int, IntArray]]:
    """Yield each number that occurs among small numbers from 0, (m,), ascending, with its places."""
    counts = np.bincount(numbers)
    present = np.flatnonzero(counts)
    places = np.split(np.argsort(numbers, kind="stable"), np.cumsum(counts[present]))
    yield from zip(present.tolist(), places[:-1], strict=True)


def ascending(costs: FloatArray) -> IntArray:
    """Choose a column of (m, k) costs for each row, (m,), so that columns never descend and the sum is least."""
    sums = costs.copy()
    for before, row in pairwise(sums):
        row += np.minimum.accumulate(before)
    columns = np.full(len(costs), costs.shape[1] - 1)
    for row in range(len(costs) - 1, -1, -1):
        columns[: row + 1] = sums[row, : columns[row] + 1].argmin()
    return columns
