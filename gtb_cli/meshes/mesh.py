"""`Mesh`: vertices and cells as plain arrays, with optional data for each vertex."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, as_indices, bounds_of, index_type
from gtb_cli.display import frame, plot
from gtb_cli.errors import DomainError
from gtb_cli.meshes.topology import are_used, sides_of
from gtb_cli.values import by_value, frozen

if TYPE_CHECKING:
    import trimesh


@by_value
@frozen
class Origin:
    """Where the vertices of a model's mesh come from.

    Attributes
    ----------
    patch : (m,) int
        The patch in whose domain each vertex has its parameters; the first one if several share the vertex.
    turned : (p,) bool
        The patches whose orientation the mesh reverses.
    shared : (q, 2) int
        Vertices with several parameters, and the patch of each further parameter; only if normals were asked for.
    places : (q, d) float
        These further parameters.
    """

    patch: IntArray
    turned: BoolArray
    shared: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    places: FloatArray = field(default_factory=lambda: np.empty((0, 2)))


@by_value
@frozen
class Mesh:
    """A polyline or a triangle mesh.

    A value: meshes with equal contents are equal and have the same hash, also after pickling or copying. Its arrays are
    read-only views of the given ones, which are copied only if their type differs.

    Parameters
    ----------
    vertices : (m, 3) float
        Positions, in model units.
    cells : (k, 2) or (k, 3) int
        Segments of a polyline, or triangles, as indices into `vertices`; triangles
        counter-clockwise in the domain. 32 bits, where these suffice for the vertices: products need more.
    parameters : (m, d) float, optional
        Domain parameter of each vertex; for a model, in the patch given by `origin`.
    normals : (m, 3) float, or a function that returns them, optional
        Unit normal of each vertex; a function is called when they are first asked for.
    groups : tuple of (name, start, stop)
        Ranges of `cells`, one for each patch; empty for a single patch.
    origin : Origin, optional
        For a model.
    attributes : mapping of name to (m,) float
        Further scalars, one per vertex.
    name : str
        Name of the mesh in formats that have names.
    """

    vertices: FloatArray
    cells: IntArray
    parameters: FloatArray | None = None
    normals: FloatArray | None = field(default_factory=lambda: None)  # no class attribute: see `__getattr__`
    groups: tuple[tuple[str, int, int], ...] = ()
    attributes: Mapping[str, FloatArray] = field(default_factory=lambda: MappingProxyType({}))
    name: str = "patch"
    origin: Origin | None = None

    def __post_init__(self) -> None:
        self._take("vertices", np.float64)
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3:
            raise DomainError(f"vertices: expected shape (m, 3), got {self.vertices.shape}")
        count = len(self.vertices)
        self._take("cells", index_type(count))
        self._take("parameters", np.float64)
        if callable(self.normals):
            object.__setattr__(self, "_make_normals", self.__dict__.pop("normals"))
        attributes = {name: _view(values, np.float64) for name, values in self.attributes.items()}
        object.__setattr__(self, "attributes", MappingProxyType(attributes))
        if self.cells.ndim != 2 or self.cells.shape[1] not in (2, 3):
            raise DomainError(f"cells: expected shape (k, 2) or (k, 3), got {self.cells.shape}")
        for label, values in (("parameters", self.parameters), *self.attributes.items()):
            if values is not None and len(values) != count:
                raise DomainError(f"{label}: {len(values)} rows for {count} vertices")
        if "normals" in self.__dict__:
            self._take_normals()

    def __getattr__(self, name: str) -> Any:
        make = self.__dict__.get("_make_normals") if name == "normals" else None
        if make is None:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        object.__setattr__(self, "normals", make())
        self._take_normals()
        return self.normals

    def _take_normals(self) -> None:
        self._take("normals", np.float64)
        if self.normals is not None and len(self.normals) != len(self.vertices):
            raise DomainError(f"normals: {len(self.normals)} rows for {len(self.vertices)} vertices")

    def _take(self, label: str, kind: type) -> None:
        values = getattr(self, label)
        if values is not None:
            try:
                object.__setattr__(self, label, _view(values, kind))
            except (TypeError, ValueError) as error:
                raise DomainError(f"{label}: not a regular array of numbers ({error})") from None

    def __repr__(self) -> str:
        what = "segments" if self.is_curve else "faces"
        return f"<Mesh {self.name}: {len(self.vertices)} vertices, {len(self.cells)} {what}>"

    @property
    def is_curve(self) -> bool:
        """Whether the cells are segments."""
        return bool(self.cells.shape[1] == 2)

    @property
    def faces(self) -> IntArray:
        """(k, 3) triangles; raises `DomainError` for a polyline."""
        if self.is_curve:
            raise DomainError("a curve has edges, not faces")
        return self.cells

    @property
    def edges(self) -> IntArray:
        """(k, 2) segments of a polyline, or all edges of the triangles once, sorted, with ascending ends."""
        return self.cells if self.is_curve else sides_of(self.cells).edges

    @property
    def open_sides(self) -> IntArray:
        """(k, 2) sides of triangles that do not meet exactly one other side, in the opposite direction.

        A mesh without open sides is closed and consistently oriented.
        """
        sides = sides_of(self.faces)
        return sides.directed[sides.open]

    @property
    def crowded_sides(self) -> IntArray:
        """(k, 2) edges of more than two triangles, ends ascending: there the mesh is not a manifold."""
        sides = sides_of(self.faces)
        return sides.edges[sides.uses > 2]

    @property
    def with_y_up(self) -> Mesh:
        """The mesh turned about the x axis, so that y is up instead of z: (x, z, −y)."""

        def turned(rows: FloatArray) -> FloatArray:
            return np.column_stack([rows[:, 0], rows[:, 2], 0.0 - rows[:, 1]])  # not -0

        def normals() -> FloatArray | None:
            return None if self.normals is None else turned(self.normals)

        return replace(self, vertices=turned(self.vertices), normals=normals)  # type: ignore[arg-type]

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) lowest and highest coordinates of the vertices that cells use, or of all where there are no cells."""
        return bounds_of(self.used if len(self.cells) else self.vertices)

    @property
    def used(self) -> FloatArray:
        """(u, 3) the vertices that cells use, in order."""
        used = are_used(self.cells, len(self.vertices))
        return self.vertices if used.all() else self.vertices[used]

    plot = plot
    _repr_html_ = frame

    def to_trimesh(self) -> trimesh.Trimesh | trimesh.path.Path3D:
        """Return the same vertices and faces, in the same order, as a trimesh object (a `Path3D` for a curve)."""
        import trimesh

        if self.is_curve:
            breaks = np.flatnonzero(self.cells[1:, 0] != self.cells[:-1, 1]) + 1
            runs = [np.append(run[:, 0], run[-1, 1]) for run in np.split(self.cells, breaks)]
            lines = [trimesh.path.entities.Line(run) for run in runs]
            return trimesh.path.Path3D(entities=lines, vertices=self.vertices.copy(), process=False)
        return trimesh.Trimesh(
            vertices=self.vertices, faces=self.cells, vertex_normals=self.normals, process=False, validate=False
        )


def _view(values: ArrayLike, kind: type) -> NDArray[Any]:
    """A read-only view of an array, or of a copy if its type differs."""
    array = np.asarray(values)
    if array.dtype == kind and not array.flags.writeable:
        return array
    view: NDArray[Any] = (array.astype(kind, copy=False) if kind is np.float64 else as_indices(array, kind)).view()
    view.flags.writeable = False
    return view
