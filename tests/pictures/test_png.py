"""PNG files."""

import numpy as np
import pytest

from gtb_cli.pictures.png import png
from tests.pictures.images import pixels

ROWS, COLUMNS = np.mgrid[:17, :23]
IMAGES = {
    "noise": np.random.default_rng(1).integers(0, 256, (17, 23, 3)),
    "a drawing": np.where((ROWS == COLUMNS)[..., None], 0, 255) * np.ones(3),
    "shading across": np.stack([COLUMNS * 11, COLUMNS * 7, ROWS * 0], axis=2),
    "shading downwards": np.stack([ROWS * 15, ROWS * 3, ROWS * 9], axis=2),
}


@pytest.mark.parametrize("name", IMAGES)
def test_pixels_come_back(name):
    image = IMAGES[name].astype(np.uint8)
    np.testing.assert_array_equal(pixels(png(image)), image)
