"""PNG files of pixels.

They are written here because Pillow imports all its formats first, which takes longer than a figure of a curve.
"""

import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

NONE, SUB, UP = range(3)
"""Filters: pixels as they are, less their left neighbours, less those above."""


def png(pixels: NDArray[Any]) -> bytes:
    """Return the PNG file of (height, width, 3) red, green and blue from 0 to 255, row by row from the top.

    The filter is the one with the smaller file: none, which suits drawings, or differences, which suit shading.
    """
    rows = np.ascontiguousarray(pixels, dtype=np.uint8)
    height, width, _ = rows.shape
    left, above = np.zeros_like(rows), np.zeros_like(rows)
    left[:, 1:], above[1:] = rows[:, :-1], rows[:-1]
    filtered = {NONE: rows, SUB: rows - left, UP: rows - above}  # modulo 256, as the format says
    packed = []
    for kind, values in filtered.items():
        lines = np.empty((height, 1 + 3 * width), dtype=np.uint8)
        lines[:, 0], lines[:, 1:] = kind, values.reshape(height, -1)
        packed.append(zlib.compress(lines.tobytes(), 6))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", min(packed, key=len)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks
    )
