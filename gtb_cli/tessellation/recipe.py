"""From a spec to the finished mesh: how fine, as a tube or solid, with which attributes, and what it must be.

The command line reads its options with this module, so whatever computes is imported only when a mesh is made.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, TypeAlias

from gtb_cli.errors import DomainError, RequirementError, ToleranceError
from gtb_cli.values import by_value, frozen
from gtb_cli.vocabulary import MAX_FACES, RESOLUTION, RIMS, Rim, percentage

if TYPE_CHECKING:
    from collections.abc import Callable

    from gtb_cli.meshes.mesh import Mesh
    from gtb_cli.models.model import Model
    from gtb_cli.theory.parametrization import Parametrization
    from gtb_cli.theory.patch import Patch

    Held: TypeAlias = Callable[[Mesh], tuple[Mesh, str]]


@by_value
@frozen
class Recipe:
    """The way from a patch or model to its mesh: the options of ``gtb mesh`` but for those of files.

    Attributes
    ----------
    resolution : int
        Segments along each hull edge; other values than the default exclude a tolerance.
    tolerance : float, str or None
        Largest distance between mesh and surface, in model units or as ``"1%"`` of the bounding box's diagonal;
        replaces `resolution`.
    parametrization : "linear" or "toric"
        Where vertices are put: evenly, or at the paper's parameters.
    normals : bool
        Whether a surface gets its unit normals.
    radius : float or None
        Makes a tube of this radius around a curve.
    thickness : float or None
        Makes a solid of a surface: on the side of its normals, or if negative on the other side.
    rim : "normal" or "flat"
        The rims of a solid lie along the normals, or in the planes of the surface's rims, which must be plane.
    attributes : tuple of str
        Some of `gtb_cli.vocabulary.ATTRIBUTES`.
    require : tuple of str
        Refuse what does not have these properties: "watertight", "solid", "unfolded", "smooth:1deg", see
        `gtb_cli.tessellation.requirements`. One word may stand for itself, and None for none.
    max_faces : int
        More are refused before they are made.
    weld : float, str or None
        Replaces the model's own: edges within this distance of each other are joined, in model units or as ``"0.01%"``
        of the size.

    Raises
    ------
    DomainError
        Values that make no sense, alone or together.
    """

    resolution: int = RESOLUTION
    tolerance: float | str | None = None
    parametrization: Parametrization = "linear"
    normals: bool = False
    radius: float | None = None
    thickness: float | None = None
    rim: Rim = RIMS[0]
    attributes: tuple[str, ...] = ()
    require: tuple[str, ...] = ()
    max_faces: int = MAX_FACES
    weld: float | str | None = None

    def __post_init__(self) -> None:
        from gtb_cli.tessellation.fineness import check_fineness

        check_fineness(self.resolution, self.tolerance, self.parametrization)
        if isinstance(self.max_faces, bool) or not hasattr(self.max_faces, "__index__") or self.max_faces < 1:
            raise DomainError(f"max_faces: expected a whole number of at least 1, got {self.max_faces!r}")
        if self.radius is not None and not 0 < self.radius < math.inf:
            raise DomainError(f"radius: must be positive, got {self.radius!r}")
        if self.thickness is not None and not (math.isfinite(self.thickness) and self.thickness):
            raise DomainError(f"thickness: must be a number other than zero, got {self.thickness!r}")
        if self.tolerance is not None and self.resolution != RESOLUTION:
            raise DomainError("resolution: excludes a tolerance, give one of them")
        if self.radius is not None and self.thickness is not None:
            raise DomainError("radius: excludes thickness, as a curve becomes a tube and a surface a solid")
        if self.rim not in RIMS:
            raise DomainError(f"rim: expected one of {', '.join(RIMS)}, got {self.rim!r}")
        if self.rim != RIMS[0] and self.thickness is None:
            raise DomainError("rim: needs a thickness, as only a surface made a solid has such rims")
        words = (self.require,) if isinstance(self.require, str) else tuple(self.require or ())
        object.__setattr__(self, "require", words)
        if words:
            from gtb_cli.tessellation.requirements import requirements

            requirements(words)

    def mesh(self, spec: Patch | Model, rounding: float = 0.0, held: Held | None = None) -> tuple[Mesh, list[str]]:
        """Make the mesh of a patch or model, and say what is unusual about its shape.

        Vertices may move by `rounding` afterwards, as in a file: a tolerance then holds for the moved ones.
        `held` gives a mesh as its file's numbers hold it, which is judged, and a remark for where they are too coarse.

        Raises
        ------
        DomainError
            The recipe does not suit the spec: a tube of a surface, curvatures of a curve.
        ToleranceError
            Too many faces would be needed.
        RequirementError
            Something that is required is not so; names the edges or places.
        """
        from gtb_cli.tessellation.tessellate import tessellate

        self.check_size(spec)
        spec = welded(spec, self.weld)
        tolerance = self.tolerance_for(spec)
        around = 1  # faces around each segment of a tube with a tolerance
        if tolerance is not None and self.radius is not None:
            from gtb_cli.solids.tube import ring_size

            # Of the middle line, and of the polygon of its rings: on the outside of a bend as sharp as the tube allows,
            # the middle line's error counts twice.
            tolerance *= 1 / 3
            around = 2 * ring_size(self.radius, tolerance)
        try:
            mesh = surface = tessellate(
                spec,
                None if tolerance else self.resolution,
                tolerance,
                self.parametrization,
                normals=self.normals or self.thickness is not None,
                max_faces=self.max_faces // around,
                rounding=rounding,
            )
        except ToleranceError as error:
            if around == 1:
                raise
            raise ToleranceError(f"{error}: the tube has {around} faces around each segment") from None
        remarks = self._remarks_on_surface(spec, mesh)
        faults: list[str] = []
        folds: list[str] = []
        thin: list[str] = []
        if self.attributes:
            from gtb_cli.tessellation.attributes import with_attributes

            mesh, replaced = with_attributes(spec, mesh, self.attributes, self.parametrization)
            if replaced:
                remarks.append(
                    f"the curvature has no finite limit at {replaced} of {len(mesh.vertices)} vertices, "
                    "which get the mean of their neighbours'"
                )
        if self.radius is not None:
            mesh, folds = self._tube(spec, mesh, self.radius, tolerance)
        elif self.thickness is not None:
            from gtb_cli.solids.solidity import folded_places
            from gtb_cli.solids.thickening import thicken
            from gtb_cli.tessellation.remarks import offset_folds, thin_wall

            faults = folded_places(mesh)  # of the surface, which no other thickness mends
            folds = offset_folds(spec, mesh, self.thickness)
            mesh = thicken(mesh, self.thickness)
            thin = thin_wall(mesh, self.thickness)
            mesh = _rimmed(mesh, self.thickness, self.rim)
        stored, coarse = mesh, ""
        if held and not mesh.is_curve and (self.thickness is not None or {"watertight", "solid"} & {*self.require}):
            stored, coarse = held(mesh)
        if self.thickness is not None or ("solid" in self.require and not mesh.is_curve):
            crossings = _crossings(mesh, stored, coarse)
            folds += crossings
        if self.thickness is not None and folds and not faults:
            folds[-1] += f"; {_smaller_thickness(spec, surface, self.thickness, self.rim, held, bool(crossings))}"
        if self.radius is not None and folds:
            folds[-1] += f"; {self._smaller_radius(spec, surface, self.radius, tolerance, held)}"
        if self.require:
            from gtb_cli.tessellation.requirements import require

            finer = self._fine(spec, surface) if "unfolded" in self.require else surface
            require(self.require, spec, mesh, finer, faults + folds, (stored, coarse))
        return mesh, remarks + faults + folds + thin

    def _fine(self, spec: Patch | Model, surface: Mesh) -> Mesh:
        """The mesh of a surface if it folds or is fine, else one of at most half a million faces that may fold."""
        from gtb_cli.knots.triangulation import cell_count
        from gtb_cli.solids.solidity import folded_places
        from gtb_cli.tessellation.tessellate import tessellate

        most_faces, segments = 500_000, RESOLUTION
        while sum(cell_count(patch.domain, segments) for patch in spec.patches) > most_faces and segments > 1:
            segments //= 2
        is_fine = surface.is_curve or len(surface.cells) >= most_faces
        if is_fine or (self.tolerance is None and self.resolution >= segments) or folded_places(surface):
            return surface
        return tessellate(spec, segments, normals=False)

    def _remarks_on_surface(self, spec: Patch | Model, mesh: Mesh) -> list[str]:
        """Remarks on corners, on the seams of a model, and on how its mesh is spread."""
        from gtb_cli.tessellation.doubtful_corners import doubtful_corners

        remarks = doubtful_corners(spec)
        model = _model(spec)
        if model is not None:
            from gtb_cli.models.openings import seam_remarks

            remarks += seam_remarks(model)
        if self.tolerance is None and (self.parametrization == "toric" or self.resolution <= 2):
            from gtb_cli.tessellation.remarks import coarse_sides, crowding

            remarks += coarse_sides(model, mesh, self.resolution) if model is not None else []
            remarks += crowding(spec, self.resolution) if self.parametrization == "toric" else []
        return remarks

    def _tube(self, spec: Patch | Model, mesh: Mesh, radius: float, tolerance: float | None) -> tuple[Mesh, list[str]]:
        """The tube around the mesh of a curve, and where it folds."""
        from gtb_cli.solids.solidity import where
        from gtb_cli.solids.tube import folded_segments, tube
        from gtb_cli.tessellation.attributes import curve_tangents
        from gtb_cli.theory.patch import Patch

        tangents = None
        if mesh.is_curve and isinstance(spec, Patch):
            tangents = curve_tangents(spec, mesh, self.parametrization)
        folded = folded_segments(mesh, radius, tolerance=tolerance, tangents=tangents)
        remarks = []
        if len(folded):
            remarks.append(f"a radius of {radius:g} is more than that of the curve's bends: {where(mesh, folded)}")
        return tube(mesh, radius, tolerance=tolerance, tangents=tangents, max_faces=self.max_faces), remarks

    def _smaller_radius(
        self, spec: Patch | Model, curve: Mesh, radius: float, tolerance: float | None, held: Held | None
    ) -> str:
        def is_solid(radius: float) -> bool:
            try:
                mesh, folds = self._tube(spec, curve, radius, tolerance)
            except (DomainError, ToleranceError):
                return False
            return not folds and not _crossings(mesh, *(held(mesh) if held else (mesh, "")))

        return _smaller("radius", radius, is_solid, len(curve.cells))

    def tolerance_for(self, spec: Patch | Model) -> float | None:
        """Return the tolerance in model units; a percentage is of the spec's own size."""
        if not isinstance(self.tolerance, str):
            return self.tolerance
        from gtb_cli.tessellation.fineness import tolerance_for

        return tolerance_for(spec, self.tolerance)

    def assurance(self, spec: Patch | Model) -> Literal["certified", "sampled"] | None:
        """Say how sure the tolerance is: certified for curves, sampled for surfaces; None without a tolerance.

        The middle line of a tube is certified, its surface is not.
        """
        if self.tolerance is None:
            return None
        return "certified" if spec.dimension == 1 and self.radius is None else "sampled"

    def leaves_open(self, spec: Patch | Model) -> bool:
        """Tell whether the mesh has a boundary: it is no tube, no solid, and the spec is not a closed model."""
        if self.radius is not None or self.thickness is not None:
            return False
        model = _model(welded(spec, self.weld))
        return model is None or not model.joints.closed

    def faces(self, spec: Patch | Model) -> int:
        """Count the faces (of a curve: segments) of a mesh of this resolution, without making it."""
        from gtb_cli.knots.triangulation import cell_count

        cells = sum(cell_count(patch.domain, self.resolution) for patch in spec.patches)
        if self.radius is not None:
            from gtb_cli.solids.tube import RING_SIDES

            return 2 * RING_SIDES * cells
        if self.thickness is not None:
            rim = sum(len(patch.domain.vertices) for patch in spec.patches) * self.resolution
            return 2 * (cells + rim)
        return cells

    def check_size(self, spec: Patch | Model) -> None:
        """Raise `ToleranceError` for more faces than are allowed, or than the machine's memory holds."""
        if self.tolerance is not None:
            return
        from gtb_cli.tessellation.fineness import refuse_faces

        refuse_faces(self.faces(spec), self.resolution, self.max_faces)


def welded(spec: Patch | Model, weld: float | str | None) -> Patch | Model:
    """A model with another weld, in model units or as a percentage of its size; else the spec as it is."""
    model = _model(spec)
    if model is None or weld is None:
        return spec
    from gtb_cli.models.model import diagonal_of

    return model.replace(weld=percentage(weld) / 100 * diagonal_of(model.patches) if isinstance(weld, str) else weld)


def _crossings(mesh: Mesh, stored: Mesh, coarse: str) -> list[str]:
    """Say where a mesh, as it is stored, passes through itself, and with a remark, if it does not before."""
    from gtb_cli.solids.solidity import crossing_remarks

    crossings = crossing_remarks(stored)
    if crossings and stored is not mesh and not crossing_remarks(mesh):
        return [f"{line}: {coarse}" for line in crossings]
    return crossings


def _rimmed(solid: Mesh, thickness: float, rim: Rim) -> Mesh:
    if rim == "normal":
        return solid
    from gtb_cli.solids.rims import with_flat_rims

    return with_flat_rims(solid, thickness)


def _smaller_thickness(
    spec: Patch | Model, surface: Mesh, thickness: float, rim: Rim, held: Held | None, crosses: bool
) -> str:
    """Name a smaller thickness that makes a solid of a surface, or say that none was found.

    Each is judged as one that is asked for. A surface that passes through itself, which only a solid that `crosses`
    has, is a side of all: none is tried.
    """
    from gtb_cli.solids.crossings import CROSSING_DEPTH, crossing_pairs
    from gtb_cli.solids.thickening import thicken
    from gtb_cli.tessellation.remarks import offset_folds
    from gtb_cli.tessellation.requirements import require

    def is_solid(thickness: float) -> bool:
        if offset_folds(spec, surface, thickness):
            return False
        try:
            solid = _rimmed(thicken(surface, thickness), thickness, rim)
            stored, coarse = held(solid) if held else (solid, "")
            require(("solid",), spec, solid, surface, _crossings(solid, stored, coarse), (stored, coarse))
        except (DomainError, RequirementError):
            return False
        return True

    if crosses and len(crossing_pairs(surface.vertices, surface.faces)[0]):
        return "no thickness is solid, as the surface passes through itself"
    if abs(thickness) <= CROSSING_DEPTH * max(surface.bounds[1] - surface.bounds[0]):
        return f"a wall thinner than {CROSSING_DEPTH:g} of the size cannot be told from one that does"
    return _smaller("thickness", thickness, is_solid, len(surface.cells))


def _smaller(name: str, value: float, is_solid: Callable[[float], bool], cells: int) -> str:
    """Name the largest of a few smaller values that make a solid, or say that none does.

    The first are 1/2, 1/8, 1/64 and 1/1024 of it; when one is solid, it is bisected upwards.
    """
    few, many = 5_000, 20_000  # cells up to which there is time for eight tries, and from which on only for one
    tries = 8 if cells < few else 4 if cells < many else 1
    low, high, tried = 0.0, value, 0
    while tried < (tries if low else min(tries, 4)):
        middle = float(f"{(low + high) / 2 if low else high / 2 ** (tried + 1):.3g}")
        low, high = (middle, high) if is_solid(middle) else (low, middle)
        tried += 1
    if low:
        return f"{'a radius of' if name == 'radius' else '`thickness`'} {low:g} was tried and is solid"
    if tried == 1:
        return f"a {name} of {high:g} was tried and is not solid"
    return f"{tried} {'radii' if name == 'radius' else 'thicknesses'} down to {high:g} were tried, and none is solid"


def _model(spec: Patch | Model) -> Model | None:
    from gtb_cli.models.model import Model

    return spec if isinstance(spec, Model) else None
