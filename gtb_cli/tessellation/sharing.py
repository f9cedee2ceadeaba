"""Work on many rows, shared among threads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import IntArray
from gtb_cli.process.threads import in_threads
from gtb_cli.tessellation.splitting import Scalar

BLOCK_ROWS = 1 << 13
"""Rows that one thread works on at once: their arrays fit in the cache, and other threads wait little for the lock."""


def shared(function: Callable[[Any], NDArray[Scalar]], rows: IntArray | int) -> NDArray[Scalar]:
    """What a function makes of some rows, or of slices of so many, which are the last axis; threads take blocks."""
    count = rows if isinstance(rows, int) else len(rows)
    blocks = [slice(begin, begin + BLOCK_ROWS) for begin in range(0, max(count, 1), BLOCK_ROWS)]
    tasks = blocks if isinstance(rows, int) else [rows[block] for block in blocks]
    return np.concatenate(list(in_threads(function, tasks, worth=len(tasks) > 1)), axis=-1)
