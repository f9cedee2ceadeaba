"""Lines of numbers written fast, in OBJ and all text: tables turn them into characters, four at a time, in numpy.

Every number of a block of rows becomes a run of 32-bit words. Each word holds up to four characters and is padded with
NUL bytes, deleted at the end. The result equals Python's `%.8f`, or another number of decimals, byte for byte.
"""

from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray, bounds_of, row_blocks, two_product
from gtb_cli.formats.file_arrays import Ranges
from gtb_cli.meshes.mesh import Mesh

Words: TypeAlias = NDArray[np.uint32]

BLOCK_ROWS = 8192  # rows of a block, whose arrays fit in the cache

_WORD = np.dtype("<u4")


def decimals(vertices: FloatArray) -> int:
    """Return the number of decimals, at least 8, that keep 9 significant digits at the size of (m, 3) finite vertices.

    `max(8, 8 - floor(log10(size)))`: size is the largest extent of the bounding box or, of a single point, coordinate.
    """
    with np.errstate(over="ignore"):
        size = float(np.ptp(bounds_of(vertices), axis=0).max()) or float(np.abs(vertices).max())
    if size == 0.0 or not np.isfinite(size):
        return 8
    return max(8, 8 - int(np.floor(np.log10(size))))


def obj_blocks(mesh: Mesh, uv: FloatArray | None = None, groups: Ranges = ()) -> Iterator[bytes]:
    """Return the text of an OBJ file: `v`, `vn`, `vt`, then `f` (or one `l` for each segment), with `g` before groups.

    The lines equal those of trimesh's exporter for the same arrays with ``digits=decimals(vertices)``. Numbers are
    finite; `uv` are (m, 2), a row for each vertex. Groups are names without blanks and ranges of cells. Only one block
    of lines is in memory at a time.
    """
    digits, cells = decimals(mesh.vertices), mesh.cells
    for prefix, values in (("v", mesh.vertices), ("vn", mesh.normals), ("vt", uv)):
        if values is not None:
            for rows in row_blocks(len(values), BLOCK_ROWS):
                yield number_lines(prefix, values[rows], digits)
    prefix = "l" if mesh.is_curve else "f"
    # A reference is v, v/vt, v//vn or v/vt/vn. Segments have no vn.
    references = [(lead, cells) for lead in ([b" "] if uv is None else [b" ", b"/"])]
    if mesh.normals is not None and prefix == "f":
        references.append((b"//" if uv is None else b"/", mesh.normal_of))
    for name, first, last in groups or [("", 0, len(cells))]:
        if name:
            yield f"g {name}\n".encode()
        for rows in row_blocks(last - first, BLOCK_ROWS):
            yield cell_lines(prefix, [(lead, numbers[first:last][rows]) for lead, numbers in references])


def text_rows(line: str, values: FloatArray | IntArray) -> Iterator[bytes]:
    """Yield the rows of numbers as text, each by the % format of a line, some thousands at a time."""
    for rows in row_blocks(len(values), BLOCK_ROWS):
        block = values[rows]
        lines: str = line * len(block) % tuple(block.ravel().tolist())
        yield lines.encode("ascii")


def number_lines(prefix: str, values: FloatArray, digits: int) -> bytes:
    """Return one line for each row of `values`: the prefix, then the numbers with `digits` (8 or more) decimals."""
    half_exact = 2.0**52  # below it every k + 1/2 is a double
    max_decimals = 21  # 10^(21 - 3) is the largest divisor wanted, and fits int64
    max_short_decimals = 9  # with these, decimals fit in 32 bits
    max_whole = 1e18  # the largest power of ten that int64 holds
    rows, columns = values.shape
    size = np.abs(values)
    whole = np.floor(size)
    size -= whole
    scale = 10.0 ** min(digits, max_decimals)  # exact: so is every power of ten up to the 22nd
    scaled = size * scale
    if digits > max_decimals or scaled.max() >= half_exact or whole.max() >= max_whole:
        return b"".join(text_rows(prefix + f" %.{digits}f" * columns + "\n", values))

    fraction = _round_exactly(size, scale, scaled)
    carry = fraction >= scale
    whole[carry] += 1.0
    fraction[carry] = 0.0

    # The point follows a single digit in its word, and begins one of its own otherwise.
    top = int(whole.max())
    parts = [(b".", 3)] if top > 9 else []
    fours, rest = divmod(digits - 3 * len(parts), 4)
    parts += fours * [(b"", 4)] + (rest > 0) * [(b"", rest)]
    groups = _groups(top, 2)
    words, text = _lines(prefix, rows, columns, groups + 1 + len(parts))
    head = _signed(2, int(not groups)) if top > 9 else _signed(1, 1, b".")
    _put_whole(words[..., : groups + 1], whole.astype(np.int64), head, len(head) // 2 * np.signbit(values))
    divisor = 10**digits
    remainder: NDArray[Any] = fraction.astype(np.int32 if digits <= max_short_decimals else np.int64)
    for place, (lead, count) in enumerate(parts, groups + 1):
        divisor //= 10**count
        upper = remainder // divisor
        words[..., place] = _table(lead, count, count).take(upper)
        remainder -= upper * divisor
    return text.tobytes().translate(None, b"\0") + b"\n"


def _round_exactly(fraction: FloatArray, scale: float, scaled: FloatArray) -> FloatArray:
    """Return the integer nearest to the exact product `fraction * scale`; ties go to the even one.

    `scaled` is the product as rounded to double. As k + 1/2 is a double, the exact product lies on the same side of it,
    unless the rounded one *is* k + 1/2. Only then does the rounding error decide; Dekker's product gives it exactly.
    """
    nearest = np.rint(scaled)
    if (tie := np.abs(scaled - nearest) == 0.5).any():
        product, error = two_product(fraction[tie], scale)
        nearest[tie] = np.where(error == 0.0, nearest[tie], np.floor(product) + (error > 0.0))
    return nearest


def cell_lines(prefix: str, references: Sequence[tuple[bytes, IntArray]]) -> bytes:
    """Return one line for each row of numbers: the prefix, then each 1-based number after its lead.

    Several arrays of numbers, of one shape and each with its lead, alternate.
    """
    parts = [(lead, cells, _groups(int(cells.max()) + 1, 4 - len(lead))) for lead, cells in references]
    rows, columns = references[0][1].shape
    words, text = _lines(prefix, rows, columns, sum(groups + 1 for _, _, groups in parts))
    stop = 0
    for lead, cells, groups in parts:
        start, stop = stop, stop + groups + 1
        _put_whole(words[..., start:stop], cells + 1, _table(lead, 4 - len(lead), int(not groups)), 0)
    return text.tobytes().translate(None, b"\0") + b"\n"


def _groups(top: int, head_digits: int) -> int:
    """Return the number of words of four digits that `top` needs after a first word of `head_digits`."""
    return max(0, -(-(len(str(top)) - head_digits) // 4))


def _put_whole(words: Words, numbers: IntArray, head: Words, offset: IntArray | int) -> None:
    """Write whole numbers into the last axis of `words`: the head (at `offset` in its table), then fours."""
    groups = words.shape[-1] - 1
    above = numbers // 10 ** (4 * groups)
    words[..., 0] = head.take(above + offset)
    for place in range(1, groups + 1):
        through = numbers // 10 ** (4 * (groups - place))
        digits = through - above * 10_000
        # Leading zeros are left out, except for the last digit of the number.
        short = _table(b"", 4, int(place == groups)).take(digits)
        words[..., place] = np.where(above > 0, _table(b"", 4, 4).take(digits), short)
        above = through


def _lines(prefix: str, rows: int, columns: int, words: int) -> tuple[Words, Words]:
    """Return room for `words` words in each of `columns` numbers per row, and the text that contains it."""
    text = np.empty((rows, 1 + columns * words), dtype=_WORD)
    text[:, 0] = int.from_bytes(b"\n" + prefix.encode("ascii"), "little")
    text[0, 0] = int.from_bytes(prefix.encode("ascii"), "little")
    return text[:, 1:].reshape(rows, columns, words), text


@cache
def _table(lead: bytes, digits: int, least: int, tail: bytes = b"") -> Words:
    """Return words for 0 … 10^digits - 1: `lead`, the number with leading zeros up to `least` digits, `tail`."""
    numbers = np.arange(10**digits)
    characters = np.zeros((len(numbers), 4), dtype=np.uint8)
    characters[:, : len(lead)] = np.frombuffer(lead, dtype=np.uint8)
    characters[:, len(lead) + digits :][:, : len(tail)] = np.frombuffer(tail, dtype=np.uint8)
    for place in range(digits):
        power = 10**place
        shown = (numbers >= power) | (place < least)
        characters[:, len(lead) + digits - 1 - place] = np.where(shown, numbers // power % 10 + ord("0"), 0)
    return characters.view(_WORD).ravel()


@cache
def _signed(digits: int, least: int, tail: bytes = b"") -> Words:
    """Return the table of the first words of numbers; negative ones follow the others."""
    return np.concatenate([_table(b" " + sign, digits, least, tail) for sign in (b"", b"-")])
