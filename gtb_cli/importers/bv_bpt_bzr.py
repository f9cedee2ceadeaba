"""Bézier nets as text: ``.bv`` files of BezierView, and ``.bpt`` and ``.bzr`` files of polynomial rectangles.

A ``.bv`` file is a list of segments, each with a kind, degrees and control points, polynomial or rational; ``Group k
name`` names those that follow. A ``.bpt`` file has the number of patches and, for each, its two degrees and its points
``x y z``, the first index running fastest (the Utah teapot is often distributed in this format). A ``.bzr`` file has
one patch: two degrees, and the points row by row, the second index running fastest.
"""

import math

from gtb_cli.arrays import positive
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.importers.classical_nets import MAX_NET_DEGREE, polygon, rectangle, triangle
from gtb_cli.importers.words import Words
from gtb_cli.language.keys_and_values import valid_name
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
        net = words.rows((m + 1) * (n + 1), 3, "control points x y z").reshape(n + 1, m + 1, 3)
        patches.append(rectangle(net.swapaxes(0, 1)))
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
    return patches, []


def _segment(words: Words, kind: int, line: int) -> list[Patch]:
    if kind == 1:
        return _polyhedron(words)
    if kind not in (3, 4, 5, 8, 9, 10, 11):
        words.fail(f"expected the kind of a segment ({SEGMENT_KINDS}), got {kind}", line)
    is_triangle = kind in (3, 9, 11)
    number = 1 if is_triangle or kind == 4 else 2  # of degrees
    degrees = [_degree(words) for _ in range(number)]
    normals = [_degree(words) for _ in range(number)] if kind in (9, 10) else []

    def count(degrees: list[int]) -> int:
        return math.comb(degrees[0] + 2, 2) if is_triangle else (degrees[0] + 1) * (degrees[-1] + 1)

    if kind in (8, 11):
        rows = words.rows(count(degrees), 4, "homogeneous control points x y z w")
        weights = positive("weights", rows[:, 3])
        points = rows[:, :3] / weights[:, None]
    else:
        points, weights = words.rows(count(degrees), 3, "control points x y z"), None
    if normals:
        words.rows(count(normals), 3, "normals x y z")
    if is_triangle:
        return [triangle(degrees[0], points, weights)]
    return [rectangle(points.reshape(degrees[0] + 1, degrees[-1] + 1, 3), weights)]


def _degree(words: Words) -> int:
    return words.whole("a degree", 1, MAX_NET_DEGREE)


def _polyhedron(words: Words) -> list[Patch]:
    max_sides = 100  # largest number of sides of a polyhedron's face
    vertices = words.whole("the number of vertices", 3, 10**7)
    faces = words.whole("the number of faces", 1, MAX_PATCHES)
    points = words.rows(vertices, 3, "vertices x y z")
    patches = []
    for _ in range(faces):
        sides = words.whole("the number of corners of a face", 3, max_sides)
        patches.append(polygon(points[[words.whole("the index of a vertex", 0, vertices - 1) for _ in range(sides)]]))
    return patches
