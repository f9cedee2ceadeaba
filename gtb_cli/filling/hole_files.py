"""Holes from files: loops of curves with ribbons, `.gbp`, `.lop`, models, CAD parts; rings of open edges: `holes`."""

from dataclasses import replace

import numpy as np

from gtb_cli.errors import DomainError, SpecError
from gtb_cli.filling.bspline_spans import span_matrices
from gtb_cli.filling.part_holes import Part, part_of
from gtb_cli.filling.sides import MAX_DEGREE, HoleSide
from gtb_cli.filling.strips import curve_sides, strip_side
from gtb_cli.importers.cad_files import cad_kind, kernel_faults, read_shape
from gtb_cli.importers.words import Words
from gtb_cli.language.loading import parse_loop
from gtb_cli.language.reading import AS_SEEN, Reading
from gtb_cli.models.model import Model, with_weld
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import percentage, suffix_of

SUFFIXES = ("gbp", "lop")
MAX_CURVES = 100  # that are read; a loop with too many sides to fill is refused later


def read_loop(
    data: bytes, source: str, reading: Reading = AS_SEEN, weld: float | str | None = None
) -> tuple[list[HoleSide] | Model | Part, str | None]:
    """Read a `.gbp` or `.lop` file, by its suffix, a CAD part, or a spec: curves are a loop, with its name.

    A weld, a distance or a percentage, is that of a loop or a model in place of the spec's. Raises `SpecError`, with
    file and line: the file is too large, has words that are not numbers, or too few or too many numbers; of specs see
    `gtb_cli.load`; or a ribbon is not valid.
    """
    if reading.spec_format is None and suffix_of(source) in SUFFIXES:
        sides = loop_from_text(data, source)
        if isinstance(weld, str):
            extent = np.ptp(np.concatenate([side.points for side in sides]), axis=0)
            weld = percentage(weld) / 100 * float(np.linalg.norm(extent))
        return [replace(side, weld=weld or 0.0) for side in sides], None
    if reading.spec_format is None and (kind := cad_kind(data, source)) is not None:
        if weld is not None:
            raise SpecError(f"{source}: is a CAD part, and `weld` is for a loop or a model of patches")
        with kernel_faults(source):
            return part_of(read_shape(data, kind, source)), None
    spec, rows = parse_loop(data, source, reading)
    if isinstance(spec, Patch):
        what = "a single patch has no hole" if spec.dimension == 2 else "one curve is not a loop"
        raise SpecError(f"{source}: {what}: a loop is a model of curves, [[patches]], at least 3 of them")
    spec = with_weld(spec, weld)
    if spec.dimension == 2:
        return spec, None
    try:
        return curve_sides(spec, rows), spec.name
    except DomainError as error:
        raise SpecError(f"{source}: {error}") from None


def loop_from_text(data: bytes, source: str) -> list[HoleSide]:
    """Read a `.gbp` or `.lop` file, as `read_loop` does."""
    max_bytes = 1_000_000  # a loop of 24 sides of degree 20 needs a tenth of it
    if len(data) > max_bytes:
        raise SpecError(f"{source}: is too large, a loop has at most {max_bytes // 10**6} MB")
    words = Words(data, source)
    sides = _gbp(words) if source.lower().endswith(".gbp") else _lop(words)
    words.end()
    return sides


def _gbp(words: Words) -> list[HoleSide]:
    """Read sides, ribbons and curvatures of a generalized Bézier patch: its outer layers; skip the centre and others.

    Layer l has d − 2 l points for each side: those of row l that do not belong to the next side. From degree 5 there is
    a third layer.
    """
    n = words.whole("the number of sides", 3, MAX_CURVES)
    degree = words.whole("the degree", 3, MAX_DEGREE)
    words.rows(1, 3, "the centre")
    layers = []
    for layer in range((degree + 1) // 2):
        what, count = {0: "the boundary", 1: "the second layer"}.get(layer, f"layer {layer}"), degree - 2 * layer
        layers.append(words.rows(n * count, 3, what).reshape(n, count, 3))
    sides = []
    for k in range(n):
        rows = []
        for number, own in enumerate(layers[:3]):
            before = [layers[i][k - 1, i - number] for i in range(number)]
            after = [layers[i][(k + 1) % n, number - i] for i in range(number, -1, -1)]
            rows.append(np.column_stack([np.array([*before, *own[k], *after]), np.ones(degree + 1)]))
        sides.append(strip_side(f"side {k}", rows, degree))
    return sides


def _lop(words: Words) -> list[HoleSide]:
    """Read the sides of a loop of B-spline curves; each polynomial piece of a curve becomes a side for now."""
    sides: list[HoleSide] = []
    for k in range(words.whole("the number of curves", 1, MAX_CURVES)):
        line = words.line
        degree = words.whole(f"the degree of curve {k}", 1, MAX_DEGREE)
        count = words.whole(f"the number of knots of curve {k}", 2 * degree + 2, 1000)
        knots = words.rows(count, 1, f"the knots of curve {k}")[:, 0]
        size = words.whole(f"the number of points of curve {k}", count - degree - 1, count - degree - 1)
        points = words.rows(size, 3, f"the points of curve {k}")
        try:
            spans = span_matrices(degree, knots, size)
        except DomainError as error:
            words.fail(f"curve {k}: {error}", line)
        if len(sides) + len(spans) > MAX_CURVES:
            words.fail(f"the curves have more than {MAX_CURVES} polynomial pieces", line)
        for i, (first, matrix) in enumerate(spans):
            name = f"side {k}" if len(spans) == 1 else f"side {k} piece {i}"
            piece = matrix @ points[first : first + degree + 1]
            sides.append(HoleSide(name, np.column_stack([piece, np.ones(len(piece))]), spline=f"side {k}"))
    return sides
