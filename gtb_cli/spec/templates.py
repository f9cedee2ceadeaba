"""Starter specs: TOML with comments, to be changed by hand."""

from __future__ import annotations

from gtb_cli.errors import SpecError

FEWEST_SIDES, MOST_SIDES = 3, 100


def template(name: str, sides: int | None = None) -> str:
    """Write a spec with comments that can be meshed as it is.

    Parameters
    ----------
    name : str
        One of `TEMPLATES`.
    sides : int, optional
        Number of sides, for "n-gon" and no other.

    Returns
    -------
    str
        TOML.

    Raises
    ------
    SpecError
        There is no such template, or the number of sides is missing, senseless or of no use.
    """
    if name not in TEMPLATES:
        raise SpecError(f"template: expected one of {', '.join(TEMPLATES)}, got {name!r}")
    if name == "n-gon":
        if sides is None:
            raise SpecError("n-gon: expected a number of sides, such as n-gon 7")
        if not FEWEST_SIDES <= sides <= MOST_SIDES:
            raise SpecError(f"n-gon: expected {FEWEST_SIDES} to {MOST_SIDES} sides, got {sides}")
        return _polygon(sides)
    if sides is not None:
        raise SpecError(f"{name}: expected no number of sides, got {sides}; n-gon takes one")
    return TEMPLATES[name]


CURVE = """\
# A curve. Mesh it with: gtb mesh curve.toml -o curve.obj
name = "curve"

# Knots: real numbers, at any places. The first and the last are the ends of the parameter's
# interval. What is not a plain number is an expression in quotes, of + - * / ** ( ) sqrt sin cos
# tan exp log pi e.
knots = [0, "sqrt(2)/4", 0.5, "sqrt(2)/2", 1]

# A control point for each knot, with two coordinates in the plane or three in space. The curve
# begins in the first, ends in the last, and stays within their convex hull.
control_points = [[0, 0, 0], [1, 2, 0], [2, 2.5, 1], [3, 2, 2], [4, 0, 2]]

# A weight for each knot: larger ones draw the curve towards their control points. Without this line
# all are 1.
weights = [1, 3, 4, 3, 1]
"""

TRIANGLE = """\
# A patch with three sides. Mesh it with: gtb mesh triangle.toml -o triangle.obj
name = "triangle"

# Knots: places in the plane, whose convex hull is the domain of the surface; here all points with
# whole coordinates of a triangle, which with these coefficients make a classical Bézier triangle of
# degree 2. Any real numbers are allowed.
knots = [
    [0, 0], [1, 0], [2, 0],
    [0, 1], [1, 1],
    [0, 2],
]
coefficients = "binomial"

# A control point for each knot. The surface goes through those of the corners, and its edges depend
# on the knots along them alone.
control_points = [
    [0, 0, 0], [1, -0.3, 1], [2, 0, 0],
    [0.3, 1, 1], [1.2, 1, 1],
    [1, 1.8, 0],
]

# A weight for each knot: larger ones draw the surface towards their control points. Without these
# lines all are 1.
weights = [
    1, 1, 1,
    1, 1,
    1,
]
"""

RECTANGLE = """\
# A patch with four sides. Mesh it with: gtb mesh rectangle.toml -o rectangle.obj
name = "rectangle"

# Knots: places in the plane, whose convex hull is the domain of the surface; here a grid, which
# with these coefficients makes a classical Bézier patch of degree 2 × 3. Any real numbers are
# allowed.
knots = [
    [0, 0], [1, 0], [2, 0],
    [0, 1], [1, 1], [2, 1],
    [0, 2], [1, 2], [2, 2],
    [0, 3], [1, 3], [2, 3],
]
coefficients = "binomial"

# A control point for each knot. The surface goes through those of the corners, and its edges depend
# on the knots along them alone.
control_points = [
    [0, 0, 0], [1, 0, 1], [2, 0, 0],
    [0, 1, 1], [1, 1, 2], [2, 1, 1],
    [0, 2, 0], [1, 2, 1], [2, 2, 0],
    [0, 3, 0], [1, 3, 1], [2, 3, 0],
]

# A weight for each knot: larger ones draw the surface towards their control points. Without these
# lines all are 1.
weights = [
    1, 1, 1,
    1, 2, 1,
    1, 2, 1,
    1, 1, 1,
]
"""

PENTAGON = """\
# A patch with five sides. Mesh it with: gtb mesh pentagon.toml -o pentagon.obj
name = "pentagon"

# Knots: places in the plane, real numbers in any order. Their convex hull, the domain of the
# surface, has five corners here; one knot is on an edge, and two are inside. What is not a plain
# number is an expression in quotes.
knots = [[0, 0], [2, 0], [3, "sqrt(3)"], [1, 3], [-1, "sqrt(3)"], [1, 0], [0.5, "4/3"], [1.5, "4/3"]]

# A control point for each knot. The surface goes through those of the corners, and its edges depend
# on the knots along them alone.
control_points = [
    [0, 0, 0], [2, 0, 0], [3, 1.7, 0], [1, 3, 0], [-1, 1.7, 0], [1, -0.3, 0.5], [0.5, 1.3, 2], [1.5, 1.3, 2],
]

# A weight for each knot: larger ones draw the surface towards their control points. Without this
# line all are 1.
weights = [1, 1, 1, 1, 1, 1, 3, 3]

# A height for each knot, which cuts the domain into cells. It does not change the surface: gtb
# decompose prints the cells, and gtb degenerate makes the surfaces whose weights grow with it.
lifting = [0, 0, 0, 0, 0, 1, 2, 2]
"""

MODEL = """\
# A model of several patches: a closed body, a tetrahedron blown up.
# Mesh it with: gtb mesh model.toml -o model.obj
#
# Patches are joined along edges that have the same control points, weights and spacing of knots,
# and the mesh is closed where every edge has its neighbour. Here each edge has three knots, and its
# middle control point is written twice.
name = "model"

# The four corners of the body are (1, 1, 1), (1, -1, -1), (-1, 1, -1) and (-1, -1, 1); the knots of
# each patch are those of a Bézier triangle of degree 2, corner, middle of an edge, corner, and so
# on.
[[patches]]
name = "front"
knots = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [0, 2]]
coefficients = "binomial"
control_points = [[1, 1, 1], [0, 0, 3], [-1, -1, 1], [3, 0, 0], [0, -3, 0], [1, -1, -1]]

[[patches]]
name = "left"
knots = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [0, 2]]
coefficients = "binomial"
control_points = [[1, 1, 1], [0, 3, 0], [-1, 1, -1], [0, 0, 3], [-3, 0, 0], [-1, -1, 1]]

[[patches]]
name = "right"
knots = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [0, 2]]
coefficients = "binomial"
control_points = [[1, 1, 1], [3, 0, 0], [1, -1, -1], [0, 3, 0], [0, 0, -3], [-1, 1, -1]]

[[patches]]
name = "back"
knots = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [0, 2]]
coefficients = "binomial"
control_points = [[1, -1, -1], [0, -3, 0], [-1, -1, 1], [0, 0, -3], [-3, 0, 0], [-1, 1, -1]]
"""


def _polygon(sides: int) -> str:
    """A dome over a regular polygon: its corners, as many knots halfway to the middle, and the middle."""
    corners = [_place("2*", k, sides) for k in range(sides)]
    inner = [_place("", k, sides) for k in range(sides)]
    entries = [*corners, *inner, ("0", "0")]
    heights = ["0"] * sides + ["1"] * sides + ["2"]
    knots = "".join(f"    [{x}, {y}],\n" for x, y in entries)
    points = "".join(f"    [{x}, {y}, {z}],\n" for (x, y), z in zip(entries, heights, strict=True))
    return f"""\
# A patch with {sides} sides. Mesh it with: gtb mesh {sides}-gon.toml -o {sides}-gon.obj
name = "{sides}-gon"

# Knots: places in the plane, whose convex hull is the domain of the surface. Here they are the
# corners of a regular polygon, as many knots halfway to its middle, and the middle.
knots = [
{knots}]

# A control point for each knot. The surface goes through those of the corners, and its edges depend
# on the knots along them alone.
control_points = [
{points}]

# A weight for each knot: larger ones draw the surface towards their control points. Without these
# lines all are 1.
weights = [
    {", ".join(["1"] * sides)},
    {", ".join(["2"] * sides)},
    3,
]
"""


def _place(factor: str, k: int, sides: int) -> tuple[str, str]:
    """Coordinates of corner k, as expressions."""
    if k == 0:
        return ("2" if factor else "1"), "0"
    return f'"{factor}cos({2 * k}*pi/{sides})"', f'"{factor}sin({2 * k}*pi/{sides})"'


TEMPLATES = {
    "curve": CURVE,
    "triangle": TRIANGLE,
    "rectangle": RECTANGLE,
    "pentagon": PENTAGON,
    "n-gon": "",
    "model": MODEL,
}
"""Names of templates, with their text; that of "n-gon" depends on the number of sides."""
