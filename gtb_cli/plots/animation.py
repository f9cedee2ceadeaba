"""Animated GIFs: figures of one size, one after the other."""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from gtb_cli.plots.look import settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def encoded_animation(figures: Iterable[Figure]) -> bytes:
    """Return the bytes of a GIF that shows figures one after the other, the last one longest, and begins again."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    frame_ms, last_ms = 120, 1500  # how long a frame, and the last one, are shown
    images = []
    with settings():
        for figure in figures:
            canvas = FigureCanvasAgg(figure)
            canvas.draw()
            images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()))
    durations = [frame_ms] * (len(images) - 1) + [last_ms]
    buffer = io.BytesIO()
    options = {"optimize": False, "save_all": True, "append_images": images[1:], "duration": durations, "loop": 0}
    images[0].save(buffer, format="GIF", **options)
    return buffer.getvalue()
