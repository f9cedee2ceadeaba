"""Control points of a filling: rows inside the edges, with factors of their fields, and those of the least energy."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, cross
from gtb_cli.fairing.fair import RIDGE_FRACTION
from gtb_cli.filling.corner_equations import POINT, CornerForms
from gtb_cli.filling.knots_and_weights import Net
from gtb_cli.filling.osculation import polar
from gtb_cli.filling.tangent_rows import EdgeRows

RANK = 1e-12  # relative size of what counts as nothing in forms of bounds and equations
CROSSING = 0.9  # least share of how far rows cross edges in the image of the domain


class Rows:
    """The control points of edges and rows, as functions of factors of fields: linear, but quadratic in second rows.

    A row without fields is free, as are the inner points.
    """

    def __init__(self, net: Net, edges: Sequence[EdgeRows]) -> None:
        self._net, self._normals = net, [edge.normals for edge in edges]
        free = [members for members, edge in zip(net.rows, edges, strict=True) if edge.fields is None]
        self._free = np.concatenate([*free, net.inner])
        self._given = np.zeros((len(net.knots), 3))
        self._seconds = []
        moves, tangential, owners = [], [], []
        for side, edge in enumerate(edges):
            row, fields, second = polar(edge.curve), edge.fields or (), edge.second
            self._given[net.edges[side]] = edge.curve[:, :3] / edge.curve[:, 3:]
            self._given[net.rows[side]] = row[:, :3] / row[:, 3:]
            moves += [self._move(net.rows[side], field / row[:, 3:]) for field in fields]
            owners += [side] * len(fields)
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

    def fairest(
        self, matrix: FloatArray, fullness: float, origin: Any = 0.0, share: Any = CROSSING, pull: Any = None
    ) -> FloatArray:
        """Return the (n, 3) control points with the least form of ways from an origin; fields are longer by a factor.

        Second rows depend on the factors: the form is minimised with them free, then by Gauss's and Newton's method,
        which has converged to eight digits in two steps. Then factors move as little as they can, in the metric of
        the form, to fulfil the bounds of corners, and inner points to fulfil their equations and to follow a pull. Rows
        cross edges at each corner by a `share` or more of what they do in the image of the domain with its edges.
        """
        rounds = 2
        matrix = matrix + RIDGE_FRACTION * np.trace(matrix) / len(matrix) * np.eye(len(matrix))
        final = _Form(matrix, self._free)
        free = np.concatenate([self._free, *(members for _, members, *_ in self._seconds)])
        forms = [_Form(matrix, free), *[final] * rounds] if self._seconds else [final]
        factors = np.zeros(self._count)
        for form in forms:
            points, moves = self._at(factors)
            factors = factors + form.least(points - origin, moves)[1][: self._count]
        turning, soft = set[int](), None
        table, least = self._bounds(turning, share)
        for number in range(rounds + 1):  # corners may turn back only now
            points, moves = self._at(factors)
            # At these, ways to first control points do not turn one way, as without a fold
            legs, normals = self._legs(points)
            turns = np.vecdot(cross(legs[:, :-1], legs[:, 1:]), normals.sum(axis=1, keepdims=True)).min(axis=1)
            if turned := {*np.flatnonzero(turns <= 0).tolist()} - turning:
                table, least = self._bounds(turning := turning | turned, share)
            if not len(table) or (number and not turned and not self._seconds):
                break  # bounds are linear where there are no second rows, and hold
            if soft is None or self._seconds:  # moves depend on factors where there are second rows
                # The inverse of the form of factors, without those that it does not see
                soft = np.linalg.pinv(final.seen(moves[: self._count])[1], rcond=1e-9, hermitian=True)
            factors = factors + soft @ table.T @ _multipliers(table @ soft @ table.T, least - table @ factors)
        points, moves = self._at(fullness * factors)
        points = final.least(points - origin, moves[self._count :])[0] + origin
        given = np.array([n is not None for n in self._normals])
        # Coefficients follow free rows, which pulls move on and on: equations hold after rounds without
        for pulls in [pull] * (4 if pull else 0) + [None] * (rounds if given.all() else 2 * rounds):
            equations = CornerForms.of(points, self._net.log_weights, self._net.corners, given)
            points = final.moved(points, equations, *(pulls(points) if pulls else ()))
        return points

    def _legs(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (r, 4, 3) ways from corners to the control points of their first knots, and normals of both sides."""
        first = self._net.corners[:, :5]
        legs = points[first[:, 1:]] - points[first[:, :1]]
        starts, ends = ([None if n is None else n[k] for n in self._normals] for k in (0, -1))
        sides = zip(cross(legs[:, 0], legs[:, 3]), starts, [ends[-1], *ends[:-1]], strict=True)
        return legs, np.array([[own if n is None else n for n in both] for own, *both in sides])

    def _bounds(self, turning: set[int], share: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        """Return (k, f) A and (k,) c: with A f ≥ c the ends of rows cross their edges, and do not meet."""
        rounding = 1e-3  # of fields: some cross an edge, but not near its end
        smooth_cosine = np.cos(np.radians(150))  # in space: there, rows that ran along their edges would fold
        # Least distances of a row from its edge, of the edge's first leg, and from the way midway between the edges
        crossing, apart = 0.25, 0.1
        short = 0.05  # first way, of the longer one, for which rows cross edges: they would run along those beside it
        rows, least, of_corner = [], [], np.broadcast_to(share, len(self._net.corners))
        for corner, (legs, normals) in enumerate(zip(*self._legs(self._given), strict=True)):
            lengths = np.linalg.norm(legs[[0, 3]], axis=1)
            smooth = legs[0] @ legs[3] <= smooth_cosine * lengths.prod()
            if lengths.min() <= POINT * lengths.max():
                continue
            seen = np.maximum(lengths, short * lengths[::-1])
            heights = crossing * np.diag(lengths)  # of first knots of rows, over both edges
            if not (smooth or corner in turning):
                knots = self._net.knots[self._net.corners[corner, :5]]
                parts = np.linalg.solve((knots[[4, 1]] - knots[0]).T, (knots[[2, 3]] - knots[0]).T)
                sine = np.linalg.norm(cross(legs[0], legs[3])) / lengths.prod()
                heights = of_corner[corner] * sine * parts * seen[::-1, None]
            middle = legs[0] / lengths[0] + legs[3] / lengths[1]
            convex = cross(legs[0], legs[3]) @ normals.sum(axis=0) > 0
            for knot, end, normal, sign in zip((2, 3), (0, 1), normals, (1, -1), strict=True):
                if self._normals[corner - end] is None:
                    continue
                own = self._moves[: self._count, self._net.corners[corner, knot]]
                across = cross(normal, legs[[0, 3]] / lengths[:, None])
                ways = [(across[end], heights[end, end])]
                if seen[end] > lengths[end] and heights[1 - end, end]:
                    ways.append((-across[1 - end], heights[1 - end, end]))
                if corner in turning and convex and not smooth:
                    ways.append((cross(middle / np.linalg.norm(middle), normal), apart * lengths[end]))
                for way, height in ways:
                    if np.abs(own @ way).max(initial=0.0) > rounding * np.abs(own).max(initial=0.0):
                        rows.append(sign * own @ way)
                        least.append(height - sign * legs[knot - 1] @ way)
        return np.array(rows).reshape(len(rows), self._count), np.array(least)


def _multipliers(form: FloatArray, missing: FloatArray) -> FloatArray:
    """Return x, or the nearest, with ``form @ x`` at least what is missing: positive, or 0 where a bound holds."""
    size = np.sqrt(np.where(np.diag(form) > 0, np.diag(form), 1.0))
    values, vectors = np.linalg.eigh(form / size / size[:, None])
    good = values > RANK * values[-1]
    roots = np.sqrt(values[good])
    right = vectors[:, good].T @ (missing / size) / roots
    table = roots[:, None] * vectors[:, good].T
    x, held = np.zeros(len(size)), np.ones(len(size), dtype=np.bool_)
    for _ in range(3 * len(size)):  # C. L. Lawson, R. J. Hanson, Solving least squares problems (1974), chapter 23
        pull = np.where(held, table.T @ (right - table @ x), 0.0)
        if pull.max() <= RANK * np.linalg.norm(right):
            break
        held[pull.argmax()] = False
        while True:
            found = np.where(held, 0.0, np.linalg.pinv(np.where(held, 0.0, table)) @ right)
            low = ~held & (found <= 0)
            if not low.any():
                break
            x += (x[low] / (x[low] - found[low])).min() * (found - x)
            held |= x <= RANK * x.max()
        x = found
    return np.asarray(x / size)


class _Form:
    """A quadratic form of (n, 3) points of which some are determined by the others, so that it is least."""

    def __init__(self, matrix: FloatArray, free: IntArray) -> None:
        self._free, self._outer = free, np.delete(np.arange(len(matrix)), free)
        others = matrix[np.ix_(free, self._outer)]
        self._own = matrix[np.ix_(free, free)]
        self._weights = np.linalg.solve(self._own, others)
        form = matrix[np.ix_(self._outer, self._outer)] - others.T @ self._weights
        self._form = (form + form.T) / 2

    def least(self, points: FloatArray, moves: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the points with the least value, to which multiples of (f, n, 3) moves are added, and the factors."""
        points, (images, form) = points.copy(), self.seen(moves)
        factors = np.linalg.lstsq(form, -images @ points[self._outer].ravel(), rcond=RIDGE_FRACTION)[0]
        points[self._outer] += np.einsum("f,fik->ik", factors, moves[:, self._outer])
        points[self._free] = -self._weights @ points[self._outer]
        return points, np.asarray(factors)

    def seen(self, moves: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return images of (f, n, 3) moves under the form of determining points, (f, 3 m), and the form of factors."""
        moves = moves[:, self._outer]
        images = np.tensordot(moves, self._form, (1, 0)).swapaxes(1, 2).reshape(-1, 3 * len(self._outer))
        return images, images @ moves.reshape(images.shape).T

    def moved(self, points: FloatArray, equations: CornerForms, *pulled: FloatArray) -> FloatArray:
        """Return the points after the least moves of the free ones with which equations hold; pulls give way.

        These are (p, n) rows, (p, 3) ways, and (p,) what rows of points should be along them.
        """
        held, normals, missing = equations.matrix(len(points)), equations.normals, -equations.residuals(points)
        rows, ways, wanted = pulled or (held[:0], normals[:0], missing[:0])
        lacking, points = wanted - ((rows @ points) * ways).sum(axis=1), points.copy()
        rows, held, count = rows[:, self._free], held[:, self._free], len(rows)
        if count > 3 * len(self._free):  # these have fewer coordinates
            soft, hard = ((a[:, :, None] * n[:, None]).reshape(len(a), -1) for a, n in ((rows, ways), (held, normals)))
            form = soft.T @ soft + np.kron(self._own, np.eye(3))
            found = np.linalg.solve(form, np.column_stack([soft.T @ lacking, hard.T]))
            moves = found[:, 0] + found[:, 1:] @ _forces(hard @ found[:, 1:], missing - hard @ found[:, 0])
        else:
            rows, ways = np.concatenate([rows, held]), np.concatenate([ways, normals])
            shifts = np.linalg.solve(self._own, rows.T)
            softness = (rows @ shifts) * (ways @ ways.T)
            mixed, form = softness[:count, count:], softness[:count, :count] + np.eye(count)
            found = np.linalg.solve(form, np.column_stack([lacking, mixed]))
            forces = _forces(softness[count:, count:] - mixed.T @ found[:, 1:], missing - mixed.T @ found[:, 0])
            moves = shifts @ (np.concatenate([found[:, 0] - found[:, 1:] @ forces, forces])[:, None] * ways)
        points[self._free] += moves.reshape(-1, 3)
        return points


def _forces(softness: FloatArray, missing: FloatArray) -> FloatArray:
    """Return the least forces that do what is missing, in equations of any size."""
    size = np.sqrt(np.where(np.diag(softness) > 0, np.diag(softness), 1.0))
    return np.asarray(np.linalg.lstsq(softness / size / size[:, None], missing / size, rcond=RANK)[0] / size)
