"""``.trp`` files: a toric patch over a lattice polygon, as the transfinite project's tools write it.

A file has the number of corners, the lattice point ``u v`` of each, the number of control points, and for each its
lattice point, position and weight ``u v x y z w``. It has no coefficients: they are binomial coefficients of the
lattice length on an edge, and 1 inside; normals are primitive.
"""

import math

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.importers.words import Words
from gtb_cli.knots.domain import Domain, domain
from gtb_cli.language.patch_reader import MAX_KNOTS
from gtb_cli.theory.patch import Patch


def read_trp(data: bytes, source: str) -> tuple[list[Patch], list[str]]:
    """Read the one patch of a ``.trp`` file."""
    words = Words(data, source)
    sides = words.whole("the number of corners", 3, MAX_KNOTS)
    corners_at = words.line
    corners = _lattice_points(words.rows(sides, 2, "corners u v"), words, corners_at)
    points_at = words.line
    count = words.whole("the number of control points", sides, MAX_KNOTS)
    rows_at = words.line
    rows = words.rows(count, 6, "control points u v x y z w")
    words.end()
    knots = _lattice_points(rows[:, :2], words, rows_at)
    weights = rows[:, 5]
    if not (weights > 0).all():
        words.fail(f"expected positive weights, got {weights[weights <= 0][0]:g}", rows_at)
    try:
        shape = domain(knots, "primitive")
    except DomainError as error:
        raise SpecError(f"{source}:{rows_at}: {error}") from None
    if {*map(tuple, shape.vertices.tolist())} != {*map(tuple, corners.tolist())}:
        found = ", ".join(f"({u:g}, {v:g})" for u, v in shape.vertices[:8].tolist())
        words.fail(f"expected the corners of the control points' hull, which are {found}", corners_at)
    if len(np.unique(knots, axis=0)) < count:
        words.fail("expected each lattice point once", points_at)
    return [Patch(knots, rows[:, 2:5], weights, edge_coefficients(shape), edge_normals="primitive")], []


def edge_coefficients(shape: Domain) -> FloatArray:
    """Return (n,) coefficients: C(d, k) after k of d lattice steps along an edge, and 1 inside."""
    coefficients = np.ones(len(shape.knots))
    for edge, (members, fractions, _) in enumerate(shape.edge_fractions):
        steps = math.gcd(*(int(x) for x in shape.knots[members[-1]] - shape.knots[members[0]]))
        if steps > MAX_KNOTS:
            raise DomainError(f"knots: edge {edge} has {steps} lattice steps, at most {MAX_KNOTS} are supported")
        for i, k in zip(members, np.rint(steps * fractions).astype(int).tolist(), strict=True):
            try:
                coefficients[i] = math.comb(steps, k)
            except OverflowError:
                raise DomainError(f"coefficients: C({steps}, {k}) is beyond the range of floats") from None
    return coefficients


def _lattice_points(points: FloatArray, words: Words, line: int) -> FloatArray:
    max_lattice_coordinate = 10**6  # largest coordinate of a lattice point
    off = (points != np.rint(points)) | (np.abs(points) > max_lattice_coordinate)
    if off.any():
        words.fail(f"expected whole numbers u v up to {max_lattice_coordinate}, got {points[off][0]:g}", line)
    return points
