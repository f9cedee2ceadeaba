"""``.bv`` files of BezierView: polyhedra, Bézier triangles and rectangles, polynomial or rational, in named groups.

A file is a list of segments, each with a kind, degrees and control points; ``Group k name`` names those that follow.
"""

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.imports.nets import MAX_DEGREE, dehomogenized, polygon, rectangle, triangle
from gtb_cli.imports.words import Words
from gtb_cli.language.reader import MAX_PATCHES
from gtb_cli.language.values import name_fault
from gtb_cli.theory.patch import Patch

# Kinds of segments: polyhedron, triangle, rectangle of equal degrees, rectangle, rational rectangle, triangle and
# rectangle with additional nets of normals (PN), rational triangle
SEGMENT_KINDS = "1, 3, 4, 5, 8, 9, 10 or 11"


def read_bv(data: bytes, source: str) -> list[Patch]:
    """Read the patches of a ``.bv`` file; normals of PN patches are left out.

    Notes
    -----
    The first index of a rectangle's net runs slowest. Each face of a polyhedron becomes a patch; if the face has more
    than four corners, its knots are those of a regular polygon.
    """
    words = Words(data, source)
    group: str | None = None
    patches: list[Patch] = []
    while words.left:
        if words.peek().lower() == "group":
            group = _group(words)
            continue
        line = words.line
        kind = words.whole(f"the kind of a segment ({SEGMENT_KINDS})", 1, 11)
        try:
            patches += (patch.replace(name=group) for patch in _segment(words, kind, line))
        except DomainError as error:
            raise SpecError(f"{source}:{line}: {error}") from None
        if len(patches) > MAX_PATCHES:
            words.fail(f"has more than {MAX_PATCHES} patches", line)
    if not patches:
        raise SpecError(f"{source}: has no patches")
    return patches


def _group(words: Words) -> str | None:
    """Read the name of a group; the rest of the line, a subdivision depth, is only for the viewer."""
    words.skip()
    words.whole("the number of a group", -(10**9), 10**9)
    name = words.rest_of_line()
    return None if not name or name_fault(name) else name


def _segment(words: Words, kind: int, line: int) -> list[Patch]:
    match kind:
        case 1:
            return _polyhedron(words)
        case 3 | 9 | 11:
            degree = _degree(words)
            normals = _degree(words) if kind == 9 else None
            count = (degree + 1) * (degree + 2) // 2
            points, weights = _points(words, count, kind == 11)
            if normals is not None:
                words.rows((normals + 1) * (normals + 2) // 2, 3, "normals x y z")
            return [triangle(degree, points, weights)]
        case 4 | 5 | 8 | 10:
            m = _degree(words)
            n = m if kind == 4 else _degree(words)
            degrees = (_degree(words), _degree(words)) if kind == 10 else None
            points, weights = _points(words, (m + 1) * (n + 1), kind == 8)
            if degrees is not None:
                words.rows((degrees[0] + 1) * (degrees[1] + 1), 3, "normals x y z")
            return [rectangle(points.reshape(m + 1, n + 1, 3), weights)]
    words.fail(f"expected the kind of a segment ({SEGMENT_KINDS}), got {kind}", line)


def _degree(words: Words) -> int:
    return words.whole("a degree", 1, MAX_DEGREE)


def _points(words: Words, count: int, rational: bool) -> tuple[FloatArray, FloatArray | None]:
    if not rational:
        return words.rows(count, 3, "control points x y z"), None
    return dehomogenized(words.rows(count, 4, "homogeneous control points x y z w"))


def _polyhedron(words: Words) -> list[Patch]:
    max_sides = 100  # largest number of sides of a polyhedron's face
    vertices = words.whole("the number of vertices", 3, 10**7)
    faces = words.whole("the number of faces", 1, MAX_PATCHES)
    points = words.rows(vertices, 3, "vertices x y z")
    patches = []
    for _ in range(faces):
        sides = words.whole("the number of corners of a face", 3, max_sides)
        corners = [words.whole("the index of a vertex", 0, vertices - 1) for _ in range(sides)]
        patches.append(polygon(points[corners]))
    return patches
