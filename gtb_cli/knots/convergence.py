"""The rate at which a toric degeneration converges: an exponent that the knots and their lifting determine."""

from collections.abc import Iterator
from functools import reduce
from itertools import combinations
from operator import or_

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.knots.decomposition import RegularDecomposition

MAX_GAPS = 50_000_000  # pairs of knots times cells: about a second


def convergence_rate(decomposition: RegularDecomposition) -> float:
    """Return ρ such that the patch of weights x^λ ω is within O(x^−ρ) of its regular control surface for x → ∞.

    A point with the torus coordinates s = −g log x has the weights x^−ℓ_i c_i ω_i, ℓ_i ≥ 0 the gap of knot i below the
    highest of λ − ⟨g, a⟩. It is as near to a cell as the largest weight outside of it is small. So ρ is the least
    max_{i ∈ S} ℓ_i(g) of all g and all sets S of knots that have no cell in common; the least over g is the largest
    height of the upper hull above the simplex of the lifted knots of S. One, two or three knots suffice.

    The decomposition is that of λ; for x → 0, that of −λ. ρ > 0 is in the units of the lifting, and infinite for a
    single cell of all knots, as the patch is its own limit. It is exact for control points in general position.
    Distances fall faster if the limit is smooth at the place that decides, and a second exponent near ρ shows in all
    but the largest x. The paper has the limit (Thm 3.2, Thm 4.2) without a rate.

    `DomainError` is raised for anything but a decomposition, and `ToleranceError` for too many knots and cells.
    """
    if not isinstance(decomposition, RegularDecomposition):
        raise DomainError(f"decomposition: expected a RegularDecomposition, got {type(decomposition).__name__}")
    gaps = np.stack([decomposition.gaps(cell) for cell in range(len(decomposition.cells))])
    if gaps.size * gaps.shape[1] > MAX_GAPS:
        raise ToleranceError(f"{gaps.shape[1]} knots and {gaps.shape[0]} cells are too many for a rate of convergence")
    least = float(gaps[:, list(decomposition.absent)].min(initial=np.inf))
    cells = [sum(1 << i for i in cell) for cell in decomposition.cells]
    # The knots with which each shares a cell, itself included, as bits; none if it is in no cell
    beside = [reduce(or_, (cell for cell in cells if cell >> i & 1), 0) for i in range(len(decomposition.knots))]
    present = [i for i, bits in enumerate(beside) if bits]
    for i in present:
        apart = [j for j in present if j < i and not beside[i] >> j & 1]
        least = min(least, float(_highest_above_segments(gaps[:, i], gaps[:, apart]).min(initial=np.inf)))
    for triangle in _hollow_triangles(cells, beside):
        least = min(least, _highest_above(decomposition, gaps, triangle))
    return least


def _highest_above_segments(start: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the largest height of the roof above m segments, from (k,) gaps at their start and (k, m) at their ends.

    The roof is the lowest of k planes, so that the height is concave along a segment. Two of the planes, one that rises
    and one that falls, bound it from above where they cross; a lower one there takes the place of one of them.
    """
    column = np.arange(ends.shape[1])
    slopes = ends - start[:, None]
    rising = np.where(start[:, None] == 0, slopes, np.inf).argmin(axis=0)
    falling = np.where(ends == 0, slopes, -np.inf).argmax(axis=0)
    height = np.zeros(len(column))
    for _ in range(len(start)):
        up, down = slopes[rising, column], slopes[falling, column]
        place = np.clip((start[falling] - start[rising]) / np.where(up > down, up - down, 1.0), 0.0, 1.0)
        heights = start[:, None] + place * slopes
        lowest = heights.argmin(axis=0)
        height = heights[lowest, column]
        better = height < np.minimum(heights[rising, column], heights[falling, column])
        if not better.any():
            break
        rises = slopes[lowest, column] > 0
        rising = np.where(better & rises, lowest, rising)
        falling = np.where(better & ~rises, lowest, falling)
    return np.asarray(height)


def _hollow_triangles(cells: list[int], beside: list[int]) -> Iterator[tuple[int, int, int]]:
    """Yield the triples of knots of which each two share a cell, but not all three."""
    for i, j in combinations(range(len(beside)), 2):
        if beside[i] >> j & 1:
            pair = 1 << i | 1 << j
            filled = reduce(or_, (cell for cell in cells if cell & pair == pair))
            yield from ((i, j, k) for k in range(j + 1, len(beside)) if (beside[i] & beside[j] & ~filled) >> k & 1)


def _highest_above(decomposition: RegularDecomposition, gaps: FloatArray, triangle: tuple[int, int, int]) -> float:
    """Return the largest height of the roof above a triangle whose sides are on it; it is reached at a knot inside."""
    corner, *others = decomposition.knots[list(triangle)]
    sides = np.array(others) - corner
    if np.linalg.matrix_rank(sides) < 2:
        return np.inf
    shares = (decomposition.knots - corner) @ np.linalg.inv(sides)
    shares = np.column_stack([1 - shares.sum(axis=1), shares])
    heights = (gaps[:, list(triangle)] @ shares[(shares >= 0).all(axis=1)].T).min(axis=0)
    return float(heights.max()) if heights.max() > 0 else np.inf
