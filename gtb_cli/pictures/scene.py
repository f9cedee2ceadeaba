"""A picture of things in space: a surface as an image, lines and labels as vectors, hidden parts lighter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, bounds_of
from gtb_cli.pictures.colours import FAINT, INK, SURFACE_COLOUR, rgb
from gtb_cli.pictures.look import Camera
from gtb_cli.pictures.planar import label_all
from gtb_cli.pictures.raster import Raster, rasterised
from gtb_cli.values import frozen

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SUPERSAMPLING = 3  # computed pixels along one of the picture: their mean gives smooth outlines


@frozen
class Surface:
    """(k, 3) triangles of (m, 3) vertices, with (m, 3) unit normals, without which all are equally bright.

    Each has a colour, red, green and blue of (k, 3), unless there are (m,) `scalars`: numbers at the vertices, from 0
    to 1 on the map `colour_map`.
    """

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray | None
    colours: FloatArray
    scalars: FloatArray | None = None
    colour_map: str = "cividis"


def views(
    axes: Sequence[Axes], camera: Camera, surfaces: Sequence[Surface | None], others: Sequence[FloatArray] = ()
) -> list[View]:
    """Draw a surface, or none, on each of the axes; all have one window, which holds all surfaces and other points."""
    scene_margin = 0.07  # free border around a scene, as a fraction of its size: room for labels
    clouds = [*(surface.vertices for surface in surfaces if surface is not None), *others]
    clouds = [cloud for cloud in clouds if len(cloud)]
    box = bounds_of(np.concatenate(clouds))
    ends = bounds_of(np.concatenate([_seen(cloud, camera, box)[:, :2] for cloud in clouds]))
    margin = scene_margin * max(float(np.ptp(ends, axis=0).max()), 1e-3)
    window = ends + np.array([[-margin], [margin]])
    return [View(ax, camera, box, window, surface) for ax, surface in zip(axes, surfaces, strict=True)]


def _seen(points: ArrayLike, camera: Camera, box: FloatArray) -> FloatArray:
    """(m, 3): to the right, upwards and towards the eye, in units of the box's diagonal, from its middle."""
    size = float(np.linalg.norm((box[1] - box[0]) * camera.stretch)) or 1.0  # 1 where everything is at one place
    centred = (np.asarray(points, dtype=np.float64) - (box[0] + box[1]) / 2) / size
    return np.asarray((centred * camera.stretch) @ camera.axes.T)


class View:
    """Axes on which a surface is drawn at once, then lines and points, which the surface hides.

    The (2, 3) `box` holds all that is seen. The (2, 2) `window` is the lowest and highest coordinates of the picture,
    to the right and upwards, in units of the box's diagonal.
    """

    def __init__(self, ax: Axes, camera: Camera, box: FloatArray, window: FloatArray, surface: Surface | None) -> None:
        self.ax, self._camera, self._box, self._window = ax, camera, box, window
        self._raster: Raster | None = None
        (left, bottom), (right, top) = window.tolist()
        ax.set_xlim(left, right)
        ax.set_ylim(bottom, top)
        ax.set_aspect("equal")
        ax.set_axis_off()
        if surface is None:
            return
        ax.apply_aspect()
        place = ax.get_window_extent()
        width, height = (max(round(length), 8) * SUPERSAMPLING for length in (place.width, place.height))
        shrink = math.sqrt(min(12_000_000 / (width * height), 1.0))  # which bounds time and memory of one image
        width, height = (max(int(length * shrink) // SUPERSAMPLING, 1) * SUPERSAMPLING for length in (width, height))
        points = self.seen(surface.vertices)
        pixels = (points[:, :2] - window[0]) * (np.array([width, height]) / (window[1] - window[0]))
        self._raster = rasterised(np.column_stack([pixels, points[:, 2]]), surface.faces, width, height)
        image = _smoothed(_shaded(surface, camera, self._raster))
        extent = (left, right, bottom, top)
        ax.imshow(image, extent=extent, origin="lower", interpolation="antialiased", zorder=1, aspect="equal")

    def seen(self, points: ArrayLike) -> FloatArray:
        """(m, 3): to the right, upwards and towards the eye, in units of the box's diagonal, from its middle."""
        return _seen(points, self._camera, self._box)

    def lines(
        self,
        paths: Sequence[FloatArray],
        *,
        colour: str = INK,
        width: float = 1.0,
        hidden: float = 0.0,
        dashes: str = "-",
        order: float = 3,
    ) -> None:
        """Draw paths, (m, 3) points each: where the surface hides them, `hidden` times as strong, or not at all at 0.

        Short pieces of a path are visible or hidden as a whole.
        """
        from matplotlib.collections import LineCollection

        visible: list[FloatArray] = []
        behind: list[FloatArray] = []
        for path in paths:
            points = self.seen(path)
            if self._raster is not None:
                points = _refined(points)
            shown = self._is_shown(points)
            cuts = np.flatnonzero(np.diff(shown.astype(np.int8))) + 1
            for start, stop in zip([0, *cuts.tolist()], [*cuts.tolist(), len(points)], strict=True):
                (visible if shown[start] else behind).append(points[max(start - 1, 0) : stop, :2])
        style: dict[str, Any] = {"colors": [colour], "linewidths": width, "linestyles": dashes}
        style |= {"capstyle": "round", "joinstyle": "round"}
        self.ax.add_collection(LineCollection(visible, zorder=order, **style), autolim=False)
        if hidden and behind:
            self.ax.add_collection(LineCollection(behind, zorder=order - 0.5, alpha=hidden, **style), autolim=False)

    def _is_shown(self, points: FloatArray) -> BoolArray:
        """(m,) true where no surface is before (m, 3) seen points; up to 0.004 of the scene's size behind counts."""
        if self._raster is None:
            return np.ones(len(points), dtype=bool)
        (left, bottom), (right, top) = self._window
        height, width = self._raster.triangle.shape
        column, row = ((points[:, :2] - [left, bottom]) / [right - left, top - bottom] * [width, height]).T.astype(int)
        nearest = self._raster.farthest_around[row.clip(0, height - 1), column.clip(0, width - 1)]
        return np.asarray(nearest <= points[:, 2] + 0.004)

    def points(
        self,
        places: FloatArray,
        labels: Sequence[str] = (),
        *,
        colour: str = "white",
        edge: str = INK,
        size: float = 4.5,
    ) -> None:
        """Draw (m, 3) points as dots, with a label beside each."""
        seen = self.seen(places)[:, :2]
        self.ax.plot(*seen.T, "o", ms=size, color=colour, mec=edge, mew=0.8, zorder=5)
        label_all(self.ax, seen, labels)

    def triad(self) -> None:
        """Draw the directions of the axes in the lower left corner."""
        corner, length = np.array([22, 20]), 13
        for name, along in zip("xyz", self._camera.axes[:2].T * length, strict=True):
            if math.hypot(*along) < 0.12 * length:
                continue
            arrow = {"arrowstyle": "-|>,head_width=0.12,head_length=0.25", "color": FAINT, "lw": 0.9, "shrinkA": 0}
            style: dict[str, Any] = {"xycoords": "axes points", "annotation_clip": False}
            tip = (corner + along).tolist()
            self.ax.annotate("", tip, corner.tolist(), textcoords="axes points", arrowprops=arrow, **style)
            place = (corner + 1.55 * along).tolist()
            self.ax.annotate(name, place, fontsize=8, color="#666666", ha="center", va="center", **style)


def _shaded(surface: Surface, camera: Camera, raster: Raster) -> FloatArray:
    """(height, width, 4) colours and opacity, colours times opacity."""
    # Unit vector towards the light: to the right, upwards, towards the eye
    light = np.array([-0.45, 0.55, 0.70]) / math.sqrt(0.45**2 + 0.55**2 + 0.70**2)
    map_brightness = 0.68  # least brightness, from 0 to 1, where colours mean numbers and must be recognised
    back_brightness = 0.78  # brightness of the side away from the normals, relative to the other
    covered = raster.triangle >= 0
    if surface.scalars is not None:
        from matplotlib import colormaps

        base = colormaps[surface.colour_map](raster.values(surface.faces, surface.scalars))[:, :3]
    else:
        base = surface.colours[raster.triangle[covered]]
    if surface.normals is not None:
        normals = (raster.values(surface.faces, surface.normals) / camera.stretch) @ camera.axes.T
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        away = normals[:, 2] < 0
        normals = np.where(away[:, None], -normals, normals)
        halfway = light + np.array([0.0, 0.0, 1.0])
        halfway /= np.linalg.norm(halfway)
        ambient = 0.5 if surface.scalars is None else map_brightness
        bright = ambient + (1 - ambient) * np.clip(normals @ light, 0, None)
        bright *= np.where(away, back_brightness, 1.0)
        shine = 0.2 * np.clip(normals @ halfway, 0, None) ** 28 * np.where(away, 0.3, 1.0)
        base = base * bright[:, None] + shine[:, None]
    image = np.zeros((*raster.triangle.shape, 4))
    image[covered, :3] = base.clip(0, 1)
    image[covered, 3] = 1
    return image


def _smoothed(image: FloatArray) -> FloatArray:
    """Mean of `SUPERSAMPLING` by `SUPERSAMPLING` pixels each; colours no longer times opacity."""
    height, width = image.shape[0] // SUPERSAMPLING, image.shape[1] // SUPERSAMPLING
    mean = image.reshape(height, SUPERSAMPLING, width, SUPERSAMPLING, 4).mean(axis=(1, 3))
    mean[..., :3] /= np.where(mean[..., 3:] > 0, mean[..., 3:], 1)
    # Eight bits, as the file has: rounded here, whatever the last digits of the sums.
    return np.asarray(np.rint(mean * 255).astype(np.uint8))


def _refined(points: FloatArray) -> FloatArray:
    """Points of a path, with more between those that are far apart."""
    # Length, as a fraction of the scene's size, of the pieces of a line that are visible or hidden as a whole
    piece_length = 0.004
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    counts = np.maximum(np.ceil(gaps / piece_length).astype(np.int64), 1)
    place = np.repeat(np.arange(len(gaps)), counts)
    share = (np.arange(len(place)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[place]
    between = points[place] + share[:, None] * (points[place + 1] - points[place])
    return np.concatenate([between, points[-1:]])


def plain(count: int, colour: str = SURFACE_COLOUR) -> FloatArray:
    """(count, 3) times the same colour."""
    return np.tile(rgb(colour), (count, 1))
