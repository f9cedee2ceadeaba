"""``.bpt`` and ``.bzr`` files: polynomial Bézier rectangles, given only by degrees and control points.

A ``.bpt`` file has the number of patches and, for each, its two degrees and its points ``x y z``, the first index
running fastest (the Utah teapot is often distributed in this format). A ``.bzr`` file has one patch: two degrees, and
the points row by row, the second index running fastest.
"""

from gtb_cli.imports.nets import MAX_DEGREE, rectangle
from gtb_cli.imports.words import Words
from gtb_cli.language.reader import MAX_PATCHES
from gtb_cli.theory.patch import Patch


def read_bpt(data: bytes, source: str) -> list[Patch]:
    """Read the patches of a ``.bpt`` file."""
    words = Words(data, source)
    patches = []
    for _ in range(words.whole("the number of patches", 1, MAX_PATCHES)):
        m, n = (words.whole("a degree", 1, MAX_DEGREE) for _ in range(2))
        points = words.rows((m + 1) * (n + 1), 3, "control points x y z")
        patches.append(rectangle(points.reshape(n + 1, m + 1, 3).transpose(1, 0, 2)))
    words.end()
    return patches


def read_bzr(data: bytes, source: str) -> list[Patch]:
    """Read the patch of a ``.bzr`` file."""
    words = Words(data, source)
    m, n = (words.whole("a degree", 1, MAX_DEGREE) for _ in range(2))
    points = words.rows((m + 1) * (n + 1), 3, "control points x y z")
    words.end()
    return [rectangle(points.reshape(m + 1, n + 1, 3))]
