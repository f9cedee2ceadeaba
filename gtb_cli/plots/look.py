"""The look of a picture, its figure, and bytes of figures and animations; shading: `scene`, colours: `palette`."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError, ExportError
from gtb_cli.vocabulary import CAMERA_LIMITS, COLOUR_MAPS, SIZE_LIMITS, STRETCH_LIMITS

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure
else:
    Axes = Figure = Any  # matplotlib is imported where something is drawn

AxesOf: TypeAlias = Callable[[Sequence[str]], list[Axes]]  # axes for some titles
CurvatureKind: TypeAlias = Literal["gaussian", "mean"]
MAX_PIXELS = 60_000_000


@dataclass(frozen=True)
class Camera:
    """A distant eye: its angle around the z axis from x towards y, and its angle above the xy plane, in degrees.

    The factors `stretch` lengthen what it sees along the axes.
    """

    azimuth: float = -60.0
    elevation: float = 30.0
    stretch: tuple[float, ...] = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        numbers_in("camera", (self.azimuth, self.elevation), CAMERA_LIMITS)
        object.__setattr__(self, "stretch", numbers_in("stretch", self.stretch, STRETCH_LIMITS))

    @property
    def axes(self) -> FloatArray:
        """Return (3, 3) unit vectors to the right, upwards, and towards the eye."""
        a, e = math.radians(self.azimuth), math.radians(self.elevation)
        right = [-math.sin(a), math.cos(a), 0.0]
        up = [-math.sin(e) * math.cos(a), -math.sin(e) * math.sin(a), math.cos(e)]
        return np.array([right, up, [math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)]])


def numbers_in(name: str, given: object, limits: Sequence[tuple[float, float]]) -> tuple[float, ...]:
    """Return as many numbers as there are limits, each within its own."""
    values = np.empty(0)
    with suppress(ValueError):
        values = np.asarray(given)
    fits = values.shape == (len(limits),) and values.dtype.kind in "iuf"
    if not fits or not all(low <= value <= high for value, (low, high) in zip(values, limits, strict=True)):
        ranges = ", ".join(f"{low:g} … {high:g}" for low, high in limits)
        raise DomainError(f"{name}: expected {len(limits)} numbers, within {ranges}, got {given!r}")
    return tuple(values.tolist())


@dataclass(frozen=True)
class Look:
    """The look of a picture. None, where it may stand, is what suits."""

    size: tuple[float, ...] = (6.0, 4.5)  # width and height in inches
    dpi: int = 150
    camera: Camera = field(default_factory=Camera)  # or a pair of its azimuth and elevation
    labels: bool | None = None  # number points and edges; None: if there are not too many
    net: bool | None = None  # draw control points and the lines between them; None: for a single patch
    curvature: CurvatureKind | None = None  # which colours a surface
    colours: str | None = None  # one of `gtb_cli.vocabulary.COLOUR_MAPS`
    index: tuple[int, ...] = ()  # basis functions to draw; empty: all
    unnormalised: bool = False  # draw β_i instead of T_i
    lifted: bool = False  # draw the lifted knots and their upper hull above the decomposition
    resolution: int | None = None  # segments of each edge of the mesh

    def __post_init__(self) -> None:
        if not isinstance(self.camera, Camera):
            object.__setattr__(self, "camera", Camera(*numbers_in("camera", self.camera, CAMERA_LIMITS)))
        object.__setattr__(self, "size", numbers_in("size", self.size, SIZE_LIMITS))
        object.__setattr__(self, "index", tuple(np.atleast_1d(np.asarray(self.index, dtype=object)).tolist()))
        given = [(name, getattr(self, name)) for name in ("resolution", "dpi")] + [("index", k) for k in self.index]
        for name, value in given:
            least, most = {"resolution": (1, 1000), "dpi": (20, 1200), "index": (0, 10**6)}[name]
            whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
            if not (whole and least <= value <= most) and not (value is None and name == "resolution"):
                raise DomainError(f"{name}: expected a whole number from {least} to {most}, got {value!r}")
        for name, choice in (("curvature", get_args(CurvatureKind)), ("colours", COLOUR_MAPS)):
            if getattr(self, name) not in (None, *choice):
                raise DomainError(f"{name}: expected one of {', '.join(choice)}, got {getattr(self, name)!r}")
        if self.size[0] * self.size[1] * self.dpi**2 > MAX_PIXELS:
            width, height = self.size
            room = f"{MAX_PIXELS // 10**6}M pixels"
            raise DomainError(f"`size` {width:g},{height:g} at {self.dpi} dpi is more than {room}")

    def numbers(self, count: int) -> bool:
        """Tell whether this many points are numbered: by default, up to 30 are."""
        return count <= 30 if self.labels is None else self.labels

    def draws_net(self, patches: int) -> bool:
        """Tell whether the nets of this many patches are drawn."""
        return patches == 1 if self.net is None else self.net


def settings() -> AbstractContextManager[None]:
    """Return a context with the settings of these pictures; `ExportError` if matplotlib is not installed."""
    try:
        import matplotlib.figure
    except ModuleNotFoundError:
        raise ExportError("pictures need matplotlib, which is not installed: pip install matplotlib") from None
    style = Path(__file__).with_name("gtb.mplstyle")
    return matplotlib.rc_context(matplotlib.rc_params_from_file(style, use_default_template=False))


def empty_figure(look: Look) -> Figure:
    """Return a figure of the given size, without a window."""
    from matplotlib.figure import Figure

    return Figure(figsize=(look.size[0], look.size[1]), dpi=look.dpi)


def with_numbers(figure: Figure) -> Axes:
    """Return axes with room for numbers and names at the left and below."""
    width, height = figure.get_size_inches()
    left, below, free = 0.62 / width, 0.47 / height, 0.16
    return figure.add_axes((left, below, max(1 - left - free / width, 0.1), max(1 - below - free / height, 0.1)))


def panels(figure: Figure, titles: Sequence[str], *, plane: bool = False) -> list[Axes]:
    """Return axes side by side, as nearly square as possible, each with a title; with room for numbers if `plane`."""
    count = len(titles)
    width, height = figure.get_size_inches()

    def waste(columns: int) -> float:
        """Return how far panels are from square, with a small penalty for empty places."""
        rows = -(-count // columns)
        across = width / height * rows / columns
        return float(max(across, 1 / across)) + 1.5 * (rows * columns - count) / count

    columns = min(range(1, count + 1), key=waste)
    rows = -(-count // columns)
    letter_width = 0.62  # of a title, as a fraction of the font size, with a little room
    title_size = min(9.5, 72 * width / columns / (letter_width * max(map(len, titles))))
    left, below, above = (0.42, 0.34, 0.26) if plane else (0.06, 0.06, 0.26)
    found = []
    for k, title in enumerate(titles):
        row, column = divmod(k, columns)
        x, y = column / columns + left / width, 1 - (row + 1) / rows + below / height
        across = max(1 / columns - (left + 0.1) / width, 0.02)
        ax = figure.add_axes((x, y, across, max(1 / rows - (below + above) / height, 0.02)))
        ax.set_title(title, pad=4, fontsize=title_size)
        found.append(ax)
    return found


def encoded_figure(figure: Figure, kind: str) -> bytes:
    """Return a figure as "png", "svg" or "pdf" bytes, the same for the same figure, matplotlib and fonts."""
    # Metadata that would change from day to day, or from one version of matplotlib to the next
    changing = {"png": ["Software"], "svg": ["Date", "Creator"], "pdf": ["CreationDate"]}
    buffer = io.BytesIO()
    with settings():
        figure.savefig(buffer, format=kind, metadata=dict.fromkeys(changing[kind]))
    return buffer.getvalue()


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


def subscript(symbol: str, index: int) -> str:
    """Return a letter with a subscript number, in plain characters."""
    return symbol + str(index).translate(str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉"))
