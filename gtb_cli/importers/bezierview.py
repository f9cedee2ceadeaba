"""Bézier nets as text: ``.bv`` files of BezierView, and ``.bpt`` and ``.bzr`` files of polynomial rectangles.

A ``.bv`` file is a list of segments, each with a kind, degrees and control points, polynomial or rational; ``Group k
name`` names those that follow. A ``.bpt`` file has the number of patches and, for each, its two degrees and its points
``x y z``, the first index running fastest (the Utah teapot is often distributed in this format). A ``.bzr`` file has
one patch: two degrees, and the points row by row, the second index running fastest.
"""

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.importers.classical_nets import MAX_DEGREE, dehomogenized, polygon, rectangle, triangle
from gtb_cli.importers.words import Words
from gtb_cli.language.entries import valid_name
from gtb_cli.language.patch_reader import MAX_PATCHES
from gtb_cli.theory.patch import Patch

# Kinds of segments: polyhedron, triangle, rectangle of equal degrees, rectangle, rational rectangle, triangle and
# rectangle with additional nets of normals (PN), rational triangle
SEGMENT_KINDS = "1, 3, 4, 5, 8, 9, 10 or 11"


def read_bpt(data: bytes, source: str) -> tuple[list[Patch], list[str]]:
    """Read the patches of a ``.bpt`` file."""
    words = Words(data, source)
    patches = []
    for _ in range(words.whole("the number of patches", 1, MAX_PATCHES)):
        m, n = _degree(words), _degree(words)
        points = words.rows((m + 1) * (n + 1), 3, "control points x y z")
        patches.append(rectangle(points.reshape(n + 1, m + 1, 3).transpose(1, 0, 2)))
    words.end()
    return patches, []


def read_bzr(data: bytes, source: str) -> tuple[list[Patch], list[str]]:
    """Read the patch of a ``.bzr`` file."""
    words = Words(data, source)
    m, n = _degree(words), _degree(words)
    points = words.rows((m + 1) * (n + 1), 3, "control points x y z")
    words.end()
    return [rectangle(points.reshape(m + 1, n + 1, 3))], []


def read_bv(data: bytes, source: str) -> tuple[list[Patch], list[str]]:
    """Read the patches of a ``.bv`` file; normals of PN patches are left out.

    The first index of a rectangle's net runs slowest. Each face of a polyhedron becomes a patch; if the face has more
    than four corners, its knots are those of a regular polygon.
    """
    words = Words(data, source)
    group: str | None = None
    patches: list[Patch] = []
    while words.left:
        if words.peek().lower() == "group":
            group = valid_name(" ".join(words.rest_of_line()[2:]))  # after the number of the group
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
    return patches, []


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
