"""Axes on which things are drawn: in space a surface is an image, shaded or striped, and hides what is behind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, bounds_of
from gtb_cli.plots.look import Axes, Camera
from gtb_cli.plots.palette import FAINT, INK, OPEN, SURFACE_COLOUR, rgb
from gtb_cli.plots.raster import Raster, rasterised
from gtb_cli.values import frozen

SUPERSAMPLING = 3  # computed pixels along one of the picture: their mean gives smooth outlines
HIDDEN_STRENGTH = 0.3  # opacity of what is behind a surface
GRAPH_HEIGHT = 0.62  # height of a graph relative to the width of Δ

# Box behind a label, so that lines do not run through it
HALO = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}


@frozen
class ShadedTriangles:
    """Triangles with colours, shaded by their normals."""

    vertices: FloatArray  # (m, 3)
    faces: IntArray  # (k, 3)
    normals: FloatArray | None  # (m, 3) unit vectors, without which all triangles are equally bright
    colours: FloatArray  # (k, 3) red, green and blue
    scalars: FloatArray | None = None  # (m,) numbers from 0 to 1 on the map `colour_map`, in place of colours
    colour_map: str = "cividis"
    stripes: bool = False  # mirror a room with parallel lamps: stripes bend where curvature differs


@frozen
class Projection:
    """The view of a camera on a (2, 3) box, which holds all that is drawn."""

    camera: Camera
    box: FloatArray

    def seen(self, points: ArrayLike) -> FloatArray:
        """Project points, (m, 3): right, up and towards the eye, from the box's middle in units of its diagonal."""
        stretch = self.camera.stretch
        size = float(np.linalg.norm((self.box[1] - self.box[0]) * stretch)) or 1.0  # 1: everything is at one place
        centred = (np.asarray(points, dtype=np.float64) - (self.box[0] + self.box[1]) / 2) / size
        return np.asarray((centred * stretch) @ self.camera.axes.T)


def space_views(
    axes: Sequence[Axes], camera: Camera, surfaces: Sequence[ShadedTriangles | None], others: Sequence[FloatArray] = ()
) -> list[View]:
    """Draw a surface, or none, on each of the axes; all have one window, which holds all surfaces and other points."""
    scene_margin = 0.07  # free border around a scene, as a fraction of its size: room for labels
    clouds = np.concatenate([*(surface.vertices for surface in surfaces if surface is not None), *others])
    projection = Projection(camera, bounds_of(clouds))
    window = bounds_of(projection.seen(clouds)[:, :2])
    margin = scene_margin * max(float(np.ptp(window, axis=0).max()), 1e-3)
    window += np.array([[-margin], [margin]])
    (left, bottom), (right, top) = window.tolist()
    views = []
    for ax, surface in zip(axes, surfaces, strict=True):
        ax.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
        ax.set_axis_off()
        views.append(View(ax, projection, None if surface is None else _drawn(ax, projection, surface)))
    return views


def plane_view(ax: Axes, points: FloatArray) -> View:
    """Give axes the same scale in both directions, and room around (m, 2) or (m, 3) points."""
    low, high = bounds_of(points[:, :2])
    spans = np.maximum(high - low, 0.02 * float((high - low).max()) or 1.0)
    spans += 0.18 * spans.max()
    box = ax.get_window_extent()
    spans = np.maximum(spans, np.array([spans[1] * box.width / box.height, spans[0] * box.height / box.width]))
    middle = (low + high) / 2
    x, y = np.transpose([middle - spans / 2, middle + spans / 2]).tolist()
    ax.set(xlim=x, ylim=y, aspect="equal", axisbelow=True)
    ax.grid(True, color="#E6E6E6", lw=0.6)
    return View(ax)


def _drawn(ax: Axes, projection: Projection, surface: ShadedTriangles) -> Raster:
    """Draw a surface, shaded, as an image that fills the window, and return what is where in it."""
    ax.apply_aspect()
    place = ax.get_window_extent()
    width, height = (max(round(length), 8) * SUPERSAMPLING for length in (place.width, place.height))
    shrink = math.sqrt(min(12_000_000 / (width * height), 1.0))  # which bounds time and memory of one image
    width, height = (max(int(length * shrink) // SUPERSAMPLING, 1) * SUPERSAMPLING for length in (width, height))
    points = projection.seen(surface.vertices)
    low, high = _window(ax)
    points[:, :2] = (points[:, :2] - low) * (np.array([width, height]) / (high - low))
    raster = rasterised(points, surface.faces, width, height)
    image = _image(raster, _shaded(surface, projection.camera, raster))
    extent = (*ax.get_xlim(), *ax.get_ylim())
    ax.imshow(image, extent=extent, origin="lower", interpolation="antialiased", zorder=1, aspect="equal")
    return raster


def _window(ax: Axes) -> FloatArray:
    """Return (2, 2) lowest and highest coordinates that axes show."""
    return np.array([ax.get_xlim(), ax.get_ylim()]).T


@frozen
class View:
    """Axes on which lines and points are drawn: in the plane, by their first two coordinates, or in space."""

    ax: Axes
    projection: Projection | None = None
    raster: Raster | None = None  # of the surface that hides them

    def seen(self, points: ArrayLike) -> FloatArray:
        """Return (m, 2) or (m, 3) places on the axes and, in space, how near they are to the eye."""
        return np.asarray(points) if self.projection is None else self.projection.seen(points)

    def lines(
        self,
        paths: Sequence[FloatArray],
        *,
        colour: str = INK,
        width: float = 1.0,
        hidden: float = 0.0,
        dashes: str = "-",
        order: float = 3,
        label: str | None = None,
    ) -> None:
        """Draw paths, (m, 2) or (m, 3) points each; `hidden` times as strong where a surface is before them."""
        from matplotlib.collections import LineCollection

        visible, behind = list[FloatArray](), list[FloatArray]()
        for path in paths:
            points = self.seen(path)
            if self.raster is None:
                visible.append(points[:, :2])
                continue
            points = _refined(points)
            shown = self._is_shown(points, self.raster)
            cuts = np.flatnonzero(np.diff(shown.astype(np.int8))) + 1
            for start, stop in zip([0, *cuts.tolist()], [*cuts.tolist(), len(points)], strict=True):
                piece = points[max(start - 1, 0) : stop, :2]
                # Along an outline, rounding shows specks of a line that is behind it, and ends at a surface poke out.
                is_speck = len(cuts) > 0 and np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() < 0.03
                (visible if shown[start] and not is_speck else behind).append(piece)
        style: dict[str, Any] = {"colors": [colour], "linewidths": width, "linestyles": dashes}
        style |= {"capstyle": "round", "joinstyle": "round"}
        self.ax.add_collection(LineCollection(visible, zorder=order, label=label, **style), autolim=False)
        if hidden and behind:
            self.ax.add_collection(LineCollection(behind, zorder=order - 0.5, alpha=hidden, **style), autolim=False)

    def _is_shown(self, points: FloatArray, raster: Raster) -> BoolArray:
        """Mark the (m, 3) seen points that no surface hides, (m,); it may be nearer by 0.004 of the scene's size."""
        low, high = _window(self.ax)
        height, width = raster.triangle.shape
        column, row = ((points[:, :2] - low) / (high - low) * [width, height]).T.astype(int)
        nearest = raster.farthest_around[row.clip(0, height - 1), column.clip(0, width - 1)]
        return np.asarray(nearest <= points[:, 2] + 0.004)

    def points(
        self, spots: FloatArray, texts: Sequence[str] = (), *, colour: str = "white", edge: str = INK, size: float = 4.5
    ) -> None:
        """Draw (m, 2) or (m, 3) points as dots, with a text beside each, on the side away from their middle."""
        seen = self.seen(spots)[:, :2]
        self.ax.plot(*seen.T, "o", ms=size, color=colour, mec=edge, mew=0.8, zorder=5, clip_on=False)
        for place, text in zip(seen, texts, strict=False):
            x, y = place - seen.mean(axis=0)
            length = math.hypot(x, y)
            away = (9 * x / length, 9 * y / length) if length else (6.3, 6.3)
            note(self.ax, text, place, away, va="center", color=INK, bbox=HALO)

    def names(self, texts: Sequence[str], places: Sequence[FloatArray]) -> None:
        """Write names of open edges at seen places, moved into the frame; one that would cover another is left out."""
        frame, taken = self.ax.get_window_extent(), list[Any]()
        for text, place in zip(texts, places, strict=True):
            written = note(self.ax, text, place, (0, 0), va="center", color=OPEN, bbox=HALO)
            box = written.get_window_extent()
            right, up = (
                max(low - start, 0.0) - max(stop - high, 0.0)
                for start, stop, low, high in zip(box.min, box.max, frame.min, frame.max, strict=True)
            )
            written.set_position((right * 72 / self.ax.figure.dpi, up * 72 / self.ax.figure.dpi))
            box = box.translated(right, up)
            if box.count_overlaps(taken):
                written.remove()
            else:
                taken.append(box)

    def triad(self) -> None:
        """Draw the directions of the axes of space in the first corner without surface, from the lower left one on."""
        if self.projection is None:
            return
        length, room = 13, np.array([22.0, 20.0])  # in points: of an axis, and from its foot to the border
        whole = np.array(self.ax.get_window_extent().size) * 72 / self.ax.figure.dpi
        feet = [np.where(sides, whole - room, room) for sides in ((0, 0), (1, 0), (1, 1), (0, 1))]
        corner = next((foot for foot in feet if not self._covers(foot / whole, 2 * room / whole)), feet[0])
        for name, along in zip("xyz", self.projection.camera.axes[:2].T * length, strict=True):
            if math.hypot(*along) < 0.12 * length:
                continue
            arrow = {"arrowstyle": "-|>,head_width=0.12,head_length=0.25", "color": FAINT, "lw": 0.9, "shrinkA": 0}
            style: dict[str, Any] = {"xycoords": "axes points", "annotation_clip": False}
            tip = (corner + along).tolist()
            self.ax.annotate("", tip, corner.tolist(), textcoords="axes points", arrowprops=arrow, **style)
            place = (corner + 1.55 * along).tolist()
            self.ax.annotate(name, place, fontsize=8, color="#666666", ha="center", va="center", **style)

    def _covers(self, middle: FloatArray, size: FloatArray) -> bool:
        """Tell whether the surface covers a part of a rectangle, given in parts of the axes' width and height."""
        if self.raster is None:
            return False
        height, width = self.raster.triangle.shape
        (left, low), (right, high) = (((middle + size * side / 2) * [width, height]).astype(int) for side in (-1, 1))
        return bool((self.raster.triangle[max(low, 0) : high, max(left, 0) : right] >= 0).any())


def _shaded(surface: ShadedTriangles, camera: Camera, raster: Raster) -> FloatArray:
    """Return the colours, (p, 3), of a surface at the pixels that it covers."""
    # Unit vector towards the light: to the right, upwards, towards the eye
    light = np.array([-0.45, 0.55, 0.70]) / math.sqrt(0.45**2 + 0.55**2 + 0.70**2)
    map_brightness = 0.68  # least brightness, from 0 to 1, where colours mean numbers and must be recognised
    lamps = 4.0  # that stripes mirror, between the ceiling and the horizon
    back_brightness = 0.78  # brightness of the side away from the normals, relative to the other
    if surface.scalars is not None:
        from matplotlib import colormaps

        base = colormaps[surface.colour_map](raster.values(surface.faces, surface.scalars))[:, :3]
    else:
        base = surface.colours[raster.triangle[raster.triangle >= 0]]
    if surface.normals is not None:
        normals = (raster.values(surface.faces, surface.normals) / camera.stretch) @ camera.axes.T
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        away = normals[:, 2] < 0
        normals = np.where(away[:, None], -normals, normals)
        if surface.stripes:
            upwards = np.clip(2 * normals[:, 2] * normals[:, 1], -1, 1)  # of the mirrored direction of the eye
            place = lamps * np.arccos(upwards) / (np.pi / 2)
            bright = np.where(np.abs(place % 1 - 0.5) > 0.25, 0.92, 0.16) * (0.75 + 0.25 * normals[:, 2])
            return np.repeat(bright[:, None], 3, axis=1)
        halfway = light + np.array([0.0, 0.0, 1.0])
        halfway /= np.linalg.norm(halfway)
        ambient = 0.5 if surface.scalars is None else map_brightness
        bright = ambient + (1 - ambient) * np.clip(normals @ light, 0, None)
        bright *= np.where(away, back_brightness, 1.0)
        shine = 0.2 * np.clip(normals @ halfway, 0, None) ** 28 * np.where(away, 0.3, 1.0)
        base = base * bright[:, None] + shine[:, None]
    return base


def _image(raster: Raster, colours: FloatArray) -> FloatArray:
    """(height, width, 4) image, opaque where (p, 3) colours are, of the means of blocks of computed pixels."""
    covered, image = raster.triangle >= 0, np.zeros((*raster.triangle.shape, 4))
    image[covered, :3] = colours.clip(0, 1)
    image[covered, 3] = 1
    height, width = image.shape[0] // SUPERSAMPLING, image.shape[1] // SUPERSAMPLING
    mean = image.reshape(height, SUPERSAMPLING, width, SUPERSAMPLING, 4).mean(axis=(1, 3))
    mean[..., :3] /= np.where(mean[..., 3:] > 0, mean[..., 3:], 1)
    # Eight bits, as the file has: rounded here, whatever the last digits of the sums.
    return np.asarray(np.rint(mean * 255).astype(np.uint8))


def note(ax: Axes, text: str, place: ArrayLike, offset: tuple[float, float], **style: Any) -> Any:
    """Write a text beside a place, by an offset in points to the right and upwards."""
    defaults = {"textcoords": "offset points", "ha": "center", "fontsize": 8, "zorder": 7}
    return ax.annotate(text, place, offset, **{**defaults, **style})  # type: ignore[arg-type]


def _refined(points: FloatArray) -> FloatArray:
    """Return the points of a path, with more between neighbours that are far apart."""
    piece_length = 0.004  # of the scene's size: pieces of a line are visible or hidden as a whole
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    counts = np.maximum(np.ceil(gaps / piece_length).astype(np.int64), 1)
    place = np.repeat(np.arange(len(gaps)), counts)
    share = (np.arange(len(place)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[place]
    return np.concatenate([points[place] + share[:, None] * (points[place + 1] - points[place]), points[-1:]])


def plain(count: int, colour: str = SURFACE_COLOUR) -> FloatArray:
    """Return a colour `count` times, (count, 3)."""
    return np.tile(rgb(colour), (count, 1))
