"""Pixels of pictures, for tests."""

import io

import numpy as np
from PIL import Image


def pixels(data: bytes) -> np.ndarray:
    """(height, width, 3) of 0 … 255."""
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def near(image: np.ndarray, colour: str, distance: int = 40) -> np.ndarray:
    """(height, width) whether pixels have about a colour."""
    target = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
    return np.abs(image.astype(int) - target).max(axis=2) <= distance
