"""Films: figures of one size, one after the other, as GIF, animated PNG or MP4."""

from __future__ import annotations

import io
import shutil
import subprocess
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from gtb_cli.errors import ExportError
from gtb_cli.plots.look import settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRAME_MS, LAST_MS = 120, 1500  # how long a frame, and the last one, are shown


def encoded_film(figures: Iterable[Figure], kind: str) -> bytes:
    """Return figures as a "gif", "apng" or "mp4" film; an `ExportError` says that ffmpeg, for "mp4", is missing."""
    if kind == "mp4" and shutil.which("ffmpeg") is None:
        raise ExportError("MP4 films need ffmpeg, which is not installed; GIF and APNG do not")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    images = []
    with settings():
        for figure in figures:
            canvas = FigureCanvasAgg(figure)
            canvas.draw()
            images.append(np.asarray(canvas.buffer_rgba())[..., :3].copy())
    if kind == "mp4":
        return _mp4(images)
    durations = [FRAME_MS] * (len(images) - 1) + [LAST_MS]
    first, *others = (Image.fromarray(image) for image in images)
    buffer = io.BytesIO()
    how = {"format": "PNG"} if kind == "apng" else {"format": "GIF", "optimize": False}
    first.save(buffer, save_all=True, append_images=others, duration=durations, loop=0, **how)
    return buffer.getvalue()


def _mp4(images: list[np.ndarray]) -> bytes:
    height, width = (length // 2 * 2 for length in images[0].shape[:2])  # H.264 halves the colours' resolution
    frames = [image[:height, :width].tobytes() for image in images]
    frames += [frames[-1]] * (LAST_MS // FRAME_MS - 1)
    given = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r 1000/{FRAME_MS} -i -"
    made = "-pix_fmt yuv420p -threads 1 -fflags +bitexact -flags +bitexact -movflags frag_keyframe+empty_moov -f mp4 -"
    command = f"ffmpeg -v error {given} {made}".split()
    done = subprocess.run(command, input=b"".join(frames), capture_output=True, check=False)
    if done.returncode:
        reason = done.stderr.decode("utf-8", "replace").strip().splitlines() or ["no reason"]
        raise ExportError(f"ffmpeg ended with status {done.returncode}: {reason[-1]}")
    return done.stdout
