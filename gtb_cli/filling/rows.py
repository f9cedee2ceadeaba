"""Rows of control points inside the edges, with factors of their fields, and all points that have the least energy."""

from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.fairing.fair import RIDGE_FRACTION
from gtb_cli.filling.net import Net
from gtb_cli.filling.osculation import SecondRow, polar
from gtb_cli.filling.planes import Field


class Rows:
    """The control points of edges and rows, as functions of factors of fields: linear, but quadratic in second rows.

    A row without fields is free, as are the inner points.
    """

    def __init__(
        self, net: Net, edges: Sequence[FloatArray], fields: Sequence[Field], seconds: Sequence[SecondRow | None]
    ) -> None:
        free = [members for members, field in zip(net.rows, fields, strict=True) if field is None]
        self._free = np.concatenate([*free, net.inner])
        self._given = np.zeros((len(net.knots), 3))
        self._seconds = []
        moves, tangential, owners = [], [], []
        for side, (edge, field, second) in enumerate(zip(edges, fields, seconds, strict=True)):
            row = polar(edge)
            self._given[net.edges[side]] = edge[:, :3] / edge[:, 3:]
            self._given[net.rows[side]] = row[:, :3] / row[:, 3:]
            moves += [self._move(net.rows[side], values / row[:, 3:]) for values in field or ()]
            owners += [side] * len(field or ())
            if second is not None:
                row = polar(row)
                self._given[net.seconds[side]] = row[:, :3] / row[:, 3:]
                self._seconds.append((side, net.seconds[side], row[:, 3:], second))
                tangential += [self._move(net.seconds[side], shift / row[:, 3:]) for shift in second.tangential]
        self._owners, self._count = np.array(owners, dtype=np.int64), len(moves)
        self._moves = np.array(moves + tangential).reshape(-1, len(net.knots), 3)

    def _move(self, members: IntArray, values: FloatArray) -> FloatArray:
        move = np.zeros_like(self._given)
        move[members] = values
        return move

    def _at(self, factors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (n, 3) points and (f, n, 3) moves: the derivatives, and shifts of second rows that are free."""
        points = self._given + np.einsum("f,fik->ik", factors, self._moves[: self._count])
        moves = self._moves.copy()
        for side, members, weights, second in self._seconds:
            own = np.flatnonzero(self._owners == side)
            shift, rates, _ = second.shifts(factors[own])
            points[members] += shift / weights
            moves[np.ix_(own, members)] = rates / weights
        return points, moves

    def fairest(self, matrix: FloatArray, fullness: float) -> FloatArray:
        """Return the (n, 3) control points with the least energy, a quadratic form; fields are longer by a factor.

        Second rows depend on the factors: the form is minimised with them free, then by Gauss's and Newton's method,
        which has converged to eight digits in two steps.
        """
        rounds = 2
        matrix = matrix + RIDGE_FRACTION * np.trace(matrix) / len(matrix) * np.eye(len(matrix))
        final = _Form(matrix, self._free)
        forms = [final]
        if self._seconds:
            free = np.concatenate([self._free, *(members for _, members, *_ in self._seconds)])
            forms = [_Form(matrix, free), *[final] * rounds]
        factors = np.zeros(self._count)
        for form in forms:
            factors = factors + form.least(*self._at(factors))[1][: self._count]
        points, moves = self._at(fullness * factors)
        return final.least(points, moves[self._count :])[0]


class _Form:
    """A quadratic form of (n, 3) points of which some are determined by the others, so that it is least."""

    def __init__(self, matrix: FloatArray, free: IntArray) -> None:
        self._free, self._outer = free, np.setdiff1d(np.arange(len(matrix)), free)
        others = matrix[np.ix_(free, self._outer)]
        self._weights = np.linalg.solve(matrix[np.ix_(free, free)], others)
        form = matrix[np.ix_(self._outer, self._outer)] - others.T @ self._weights
        self._form = (form + form.T) / 2

    def least(self, points: FloatArray, moves: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the points with the least value, to which multiples of (f, n, 3) moves are added, and the factors."""
        points, own = points.copy(), moves[:, self._outer]
        factors = np.zeros(len(own))
        if len(own):
            images = np.einsum("ij,fjk->fik", self._form, own).reshape(len(own), -1)
            sums = -images @ points[self._outer].ravel()
            factors = np.linalg.lstsq(images @ own.reshape(len(own), -1).T, sums, rcond=RIDGE_FRACTION)[0]
            points[self._outer] += np.einsum("f,fik->ik", factors, own)
        points[self._free] = -self._weights @ points[self._outer]
        return points, factors
