"""`Mesh`: vertices and cells as plain arrays, with optional data for each vertex."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, as_indices, bounds_of, index_type
from gtb_cli.display import notebook_html, plot
from gtb_cli.errors import DomainError
from gtb_cli.meshes.shading import Normals
from gtb_cli.meshes.topology import are_used, runs_of, sides_of
from gtb_cli.values import by_value, frozen

if TYPE_CHECKING:
    import trimesh

# By name: (r, w) numbers, and the (k, c) rows of them that the corners of cells have
Values: TypeAlias = dict[str, tuple[FloatArray, IntArray]]
ABSENT = -(2**62)  # among whole numbers, what NaN is among others
# Names of values that are not attributes; the normals of an STL file's facets follow from their corners
NORMALS, TEXTURE, FACETS = "normals", "texture coordinates", "facet normals"
GROUPS, OBJECTS, MATERIALS = "groups", "objects", "materials in "  # these with the format: no other has the same
COLOURS, SETTINGS = "colours of vertices", "settings: "
MARKED = " (long lists)"  # values that are marks end with it
OTHER = "other data: "  # what a file holds that belongs to neither vertices nor cells: compared as a whole
LIBRARIES = f"{OTHER}libraries and pictures"


@by_value
class Origin:
    """Where the vertices of a model's mesh come from."""

    patch: IntArray  # (m,) the patch in whose domain each vertex has its parameters; the first of several
    turned: BoolArray  # (p,) the patches whose orientation the mesh reverses


@by_value
class Mesh:
    """A polyline or a triangle mesh.

    A value: meshes with equal contents are equal and have the same hash, also after pickling or copying. Its arrays are
    read-only views of the given ones, which are copied only if their type differs.

    Parameters
    ----------
    vertices : (m, 3) float
        Positions, in model units.
    cells : (k, 2) or (k, 3) int
        Segments of a polyline, or triangles, counter-clockwise in the domain, as indices into `vertices`. 32 bits,
        where these suffice for the vertices: products need more.
    parameters : (m, d) float, optional
        Domain parameter of each vertex; for a model, in the patch given by `origin`.
    normals : (k, 3) float, or a function that returns `Normals` or None, optional
        Unit normals: first one of each vertex, then more of some vertices, as each patch has its own where it meets
        others at an angle. A function is called when they are first asked for.
    groups : tuple of (name, start, stop)
        Ranges of `cells`, one for each patch; empty for a single patch.
    origin : Origin, optional
        For a model.
    normal_of : (f, 3) int, optional
        The normal of each corner of each face: that of its vertex, or one of those behind. Default: `cells`.
    exact_normals : bool
        Whether all normals are the surface's own, and none is estimated from facets.
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
    normal_of: IntArray = field(default_factory=lambda: None)  # type: ignore[arg-type,return-value]
    exact_normals: bool = field(default_factory=lambda: False)

    if TYPE_CHECKING:

        def __init__(
            self,
            vertices: ArrayLike,
            cells: ArrayLike,
            parameters: ArrayLike | None = None,
            normals: ArrayLike | Callable[[], Normals | None] | None = None,
            groups: tuple[tuple[str, int, int], ...] = (),
            attributes: Mapping[str, ArrayLike] = ...,
            name: str = "patch",
            origin: Origin | None = None,
            normal_of: IntArray | None = None,
            exact_normals: bool = False,
        ) -> None: ...

    def __post_init__(self) -> None:
        self._take("vertices", np.float64)
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3:
            raise DomainError(f"vertices: expected shape (m, 3), got {self.vertices.shape}")
        count = len(self.vertices)
        self._take("cells", index_type(count))
        self._take("parameters", np.float64)
        if callable(self.normals):
            object.__setattr__(self, "_make_normals", self.__dict__.pop("normals"))
            del self.__dict__["normal_of"], self.__dict__["exact_normals"]
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
        make = self.__dict__.get("_make_normals") if name in ("normals", "normal_of", "exact_normals") else None
        if make is None:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        for label, value in zip(("normals", "normal_of", "exact_normals"), make() or (None, None, False), strict=True):
            object.__setattr__(self, label, value)
        self._take_normals()
        return getattr(self, name)

    def _take_normals(self) -> None:
        count = len(self.vertices)
        self._take("normals", np.float64)
        if self.normals is None or len(self.normals) == count:
            object.__setattr__(self, "normal_of", self.cells)
            return
        if len(self.normals) < count or self.normal_of is None:
            raise DomainError(f"normals: {len(self.normals)} rows for {count} vertices")
        self._take("normal_of", index_type(len(self.normals)))
        low, high = self.normal_of.min(initial=0), self.normal_of.max(initial=0)
        if self.normal_of.shape != self.cells.shape or low < 0 or high >= len(self.normals):
            raise DomainError("normal_of: expected a row of normals for each corner of each face")
        if (self.vertex_of_normal[self.normal_of] != self.cells).any():
            raise DomainError("normal_of: a normal is of another vertex than the corner")

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
        """(k, 2) sides of triangles that do not meet exactly one other, in the opposite direction; none if closed."""
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

        def normals() -> Normals | None:
            return None if self.normals is None else Normals(turned(self.normals), self.normal_of, self.exact_normals)

        return replace(self, vertices=turned(self.vertices), normals=normals, normal_of=None, exact_normals=False)  # type: ignore[arg-type]

    @property
    def vertex_of_normal(self) -> IntArray:
        """(k,) the vertex of each normal."""
        assert self.normals is not None
        vertex = np.arange(len(self.normals))
        vertex[self.normal_of] = self.cells
        return vertex

    @property
    def vertex_normals(self) -> FloatArray | None:
        """(m, 3) one unit normal of each vertex: the mean of those that it has."""
        if self.normals is None or len(self.normals) == len(self.vertices):
            return self.normals
        sums = np.zeros_like(self.vertices)
        np.add.at(sums, self.vertex_of_normal, self.normals)
        lengths = np.linalg.norm(sums, axis=1, keepdims=True)
        return np.where(lengths > EPS, sums / np.where(lengths > EPS, lengths, 1.0), self.normals[: len(sums)])

    @property
    def split(self) -> Mesh:
        """The mesh with a vertex for each normal: the same ones, then a copy of a vertex for each further normal."""
        if self.normals is None or len(self.normals) == len(self.vertices):
            return self
        vertex = self.vertex_of_normal
        return replace(self, vertices=self.vertices[vertex], cells=self.normal_of, **self.carried(vertex))

    def carried(self, rows: IntArray) -> dict[str, Any]:
        """Arguments of a mesh with these (m,) vertices: their parameters, attributes and origin, and the name."""
        return {
            "parameters": None if self.parameters is None else self.parameters[rows],
            "attributes": {name: values[rows] for name, values in self.attributes.items()},
            "name": self.name,
            "origin": None if self.origin is None else replace(self.origin, patch=self.origin.patch[rows]),
        }

    @property
    def largest_split(self) -> float:
        """The largest angle in degrees between two normals of a vertex."""
        if self.normals is None or len(self.normals) == len(self.vertices):
            return 0.0
        vertex = self.vertex_of_normal
        order = np.argsort(vertex, kind="stable")
        vertex, normals, chord, apart = vertex[order], self.normals[order], 0.0, 1
        while len(same := np.flatnonzero(vertex[apart:] == vertex[:-apart])):
            chord = max(chord, float(np.linalg.norm(normals[same] - normals[same + apart], axis=1).max()))
            apart += 1
        return math.degrees(2 * math.asin(min(chord / 2, 1.0)))

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
    _repr_html_ = notebook_html

    def to_trimesh(self) -> trimesh.Trimesh | trimesh.path.Path3D:
        """Return the same vertices and faces, in the same order, as a trimesh object (a `Path3D` for a curve)."""
        import trimesh

        if self.is_curve:
            lines = [trimesh.path.entities.Line(run) for run in runs_of(self.cells)]
            return trimesh.path.Path3D(entities=lines, vertices=self.vertices.copy(), process=False)
        return trimesh.Trimesh(
            vertices=self.vertices, faces=self.cells, vertex_normals=self.vertex_normals, process=False, validate=False
        )


def _view(values: ArrayLike, kind: type) -> NDArray[Any]:
    """A read-only view of an array, or of a copy if its type differs."""
    array = np.asarray(values)
    view: NDArray[Any] = (array.astype(kind, copy=False) if kind is np.float64 else as_indices(array, kind)).view()
    view.flags.writeable = False
    return view


def vertices_to_measure(mesh: Mesh, otherwise: str) -> FloatArray:
    """Return the vertices that cells use; a `DomainError` refuses none, with what follows, or those not finite."""
    if not len(mesh.cells):
        raise DomainError(f"mesh: has no cells, so that {otherwise}")
    if not np.isfinite(used := mesh.used).all():
        raise DomainError("mesh: vertices must be finite")
    return used


@frozen
class KnownMesh:
    """A mesh, and how accurately its coordinates are known."""

    mesh: Mesh
    # (3,) largest error of a coordinate along each axis: half a unit in the last digit or bit of the file, at the size
    # of the largest coordinate of a vertex that cells use, plus a few roundings.
    half_steps: FloatArray
    format: str  # one of `FORMATS`, or "spec"
    space: str = ""  # what the file says of its unit and vertical axis
    values: Callable[[], Values] = dict  # normals, texture coordinates and attributes, which are read when asked
    libraries: tuple[str, ...] = ()  # names of files with its materials and pictures
    doubtful: tuple[str, ...] = ()  # names of values that are compared only where faces are the same
    has_polygons: bool = False  # which are cut into triangles
    fans: int = 0  # polygons whose triangles, around the first corners, may overlap

    @property
    def has_indices(self) -> bool:
        """Whether its faces tell which vertices they share: STL has none, GLB and 3MF those of each part."""
        return self.format not in ("stl", "glb", "3mf")


def are_marks(name: str) -> bool:
    """Tell whether values of this name only say what belongs together: then no distance between them counts."""
    return name == GROUPS or name.startswith((OBJECTS, MATERIALS, SETTINGS)) or name.endswith(MARKED)


def known_exactly(mesh: Mesh) -> KnownMesh:
    """A mesh that was computed here."""
    held = {name: (numbers[:, None], mesh.cells) for name, numbers in mesh.attributes.items()}
    return KnownMesh(mesh, rounding(largest_coordinates(mesh.used)), "spec", values=lambda: held)


def rounding(largest: FloatArray) -> FloatArray:
    """(3,) error of computed coordinates along each axis, from the largest absolute values."""
    return largest * 2.0**-50  # rounding of a few operations


def largest_coordinates(vertices: FloatArray) -> FloatArray:
    """(3,) largest absolute values of the coordinates of (m, 3) vertices."""
    return np.array([np.maximum(x.max(initial=0.0), -x.min(initial=0.0)) for x in vertices.T])
