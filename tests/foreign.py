"""Small files in the formats of other programs, written here, and their surfaces' own formulas in exact fractions."""

import math
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

HERE = Path(__file__).parent

Rows = Sequence[Sequence[Fraction]]

DEGREES, KNOTS = (2, 1), (["0", "0", "0", "2/5", "1", "1", "1"], ["0", "0", "1/2", "1", "1"])
WEIGHTS = [1, 1, 2, 1, 1, 0.5, 3, 1, 1, 1, 0.25, 1]
# A NURBS surface of 4 × 3 points and 2 × 2 spans, the second index running fastest
POINTS = [[i, j, (3 * i * j) % 5] for i in range(4) for j in range(3)]


def floats(knots: Sequence[str]) -> list[float]:
    return [float(Fraction(x)) for x in knots]


def iges() -> bytes:
    """The surface turned and moved by a transformation, a curve, one in a parameter plane, and a line."""
    order = [i * 3 + j for j in range(3) for i in range(4)]
    surface = [128, 3, 2, *DEGREES, 0, 0, 0, 0, 0, *floats(KNOTS[0]), *floats(KNOTS[1]), *(WEIGHTS[k] for k in order)]
    surface += [x for k in order for x in POINTS[k]] + [0, 1, 0, 1]
    points = [0, 0, 0, 1, 1, 0, 2, 0, 0, 3, 1, 0]
    curve = [126, 3, 2, *[0] * 7, 0.5, *[1] * 7, *points, 0, 1, 0, 0, 1]
    turn = [124, 0, -1, 0, 10, 1, 0, 0, 20, 0, 0, 1, 30]
    parts = [(128, surface, 7, "00000000", "SHEET"), (126, curve, 0, "00000000", ""), (126, curve, 0, "00010500", "")]
    parts += [(124, turn, 0, "00000000", ""), (110, [110, 0, 0, 0, 1, 1, 1], 0, "00000000", "")]
    lines = [f"{'small file of tests':<72}S{1:7}"]
    text = "1H,,1H;,5Htests,8Htest.igs,3Hgtb,1H1,32,38,6,308,15,5Htests,1.0,2,2HMM,1,0.01,15H20240101.000000,"
    text += "1E-7,9.0,,,11,0;"
    lines += [f"{text[k : k + 72]:<72}G{k // 72 + 1:7}" for k in range(0, len(text), 72)]
    directory, parameters = [], []
    for number, (kind, values, matrix, status, label) in enumerate(parts):
        words = [f"{value!r}," for value in values]
        rows = [""]
        for word in words:
            if len(rows[-1] + word) > 64:
                rows.append("")
            rows[-1] += word
        rows[-1] = rows[-1][:-1] + ";"
        first = len(parameters) + 1
        pointer = 2 * number + 1
        parameters += [f"{row:<64}{pointer:8}P{first + k:7}" for k, row in enumerate(rows)]
        directory.append(f"{kind:8}{first:8}{0:8}{0:8}{0:8}{0:8}{matrix:8}{0:8}{status}D{pointer:7}")
        directory.append(f"{kind:8}{0:8}{0:8}{len(rows):8}{0:8}{'':8}{'':8}{label:>8}{0:8}D{pointer + 1:7}")
    lines += directory + parameters
    lines.append(f"{'S      1G      2D     10P     99':<72}T{1:7}")
    return "\n".join(lines).encode() + b"\n"


FILES = {path.name: path.read_bytes() for path in sorted((HERE / "importers/files").iterdir())} | {"part.igs": iges()}


def bernstein(n: int, i: int, t: Fraction) -> Fraction:
    return math.comb(n, i) * t**i * (1 - t) ** (n - i)


def basis(degree: int, knots: list[Fraction], i: int, t: Fraction) -> Fraction:
    """Cox and de Boor's recurrence, on half-open spans."""
    if degree == 0:
        return Fraction(knots[i] <= t < knots[i + 1])
    value = Fraction(0)
    for low, high, k, rising in ((i, i + degree, i, True), (i + 1, i + degree + 1, i + 1, False)):
        if knots[high] > knots[low]:
            share = (t - knots[low] if rising else knots[high] - t) / (knots[high] - knots[low])
            value += share * basis(degree - 1, knots, k, t)
    return value


def nurbs_point(u: Fraction, v: Fraction) -> list[Fraction]:
    """A point of the NURBS surface."""
    first, second = ([Fraction(x) for x in row] for row in KNOTS)
    terms = [
        Fraction(WEIGHTS[3 * i + j]) * basis(DEGREES[0], first, i, u) * basis(DEGREES[1], second, j, v)
        for i in range(4)
        for j in range(3)
    ]
    return weighted(terms, [[Fraction(x) for x in row] for row in POINTS])


def toric_point(u: Fraction, v: Fraction) -> list[Fraction]:
    """A point of the toric patch: products of edge functions, with binomials on edges."""
    words = [Fraction(word) for word in FILES["toric.trp"].decode().split()]
    corners = [(words[1 + 2 * k], words[2 + 2 * k]) for k in range(5)]
    rows = [words[12 + 6 * k : 18 + 6 * k] for k in range(9)]
    terms = []
    for x, y, *_, weight in rows:
        term = weight
        for (a, b), (c, d) in zip(corners, corners[1:] + corners[:1], strict=True):
            steps = math.gcd(int(c - a), int(d - b))
            height, there = (((c - a) * (q - b) - (d - b) * (p - a)) / steps for p, q in ((x, y), (u, v)))
            if height == 0:
                place = abs(x - a) + abs(y - b)
                term *= math.comb(steps, int(steps * place / (abs(c - a) + abs(d - b))))
            term *= there ** int(height)
        terms.append(term)
    return weighted(terms, [row[2:5] for row in rows])


def weighted(terms: Sequence[Fraction], points: Rows) -> list[Fraction]:
    return [sum((w * p[k] for w, p in zip(terms, points, strict=True)), Fraction(0)) / sum(terms) for k in range(3)]
