"""PNG files of pixels.

Written here: Pillow imports all its formats before it writes one, which takes longer than a figure of a curve.
"""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

COMPRESSION_LEVEL = 6
"""Level of zlib; 9 takes twice as long to save hundredths of the bytes."""

NONE, SUB, UP = range(3)
"""Filters: pixels as they are, less their left neighbours, less those above."""

SAMPLE_ROWS = 8
"""Of so many rows one is in the sample by which a filter is chosen: to pack all rows three times takes as long as to
draw a curve."""


def png(pixels: NDArray[Any]) -> bytes:
    """The PNG file of (height, width, 3) red, green and blue from 0 to 255, row by row from the top.

    The filter is the one that packs a sample best: none, which suits drawings, or neighbours' differences, for shading.
    """
    rows = np.ascontiguousarray(pixels, dtype=np.uint8)
    height, width, _ = rows.shape
    left, above = np.zeros_like(rows), np.zeros_like(rows)
    left[:, 1:], above[1:] = rows[:, :-1], rows[:-1]
    filtered = {NONE: rows, SUB: rows - left, UP: rows - above}  # modulo 256, as the format says
    best = min(filtered, key=lambda kind: len(zlib.compress(filtered[kind][::SAMPLE_ROWS].tobytes(), 1)))
    lines = np.empty((height, 1 + 3 * width), dtype=np.uint8)
    lines[:, 0], lines[:, 1:] = best, filtered[best].reshape(height, -1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes(), COMPRESSION_LEVEL)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks
    )
