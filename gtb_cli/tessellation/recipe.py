"""`Recipe`: the options of a mesh in one value, and the mesh they make; how fine: `tessellate`. Light to import."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.values import by_value
from gtb_cli.vocabulary import (
    MAX_FACES,
    RESOLUTION,
    RIMS,
    SIDES,
    Parametrization,
    Rim,
    check_fineness,
    requirements,
    thickness_of,
)

if TYPE_CHECKING:
    from gtb_cli.meshes.mesh import Mesh
    from gtb_cli.models.model import Model
    from gtb_cli.tessellation.solid_making import Held, TubeMaker, WallMaker
    from gtb_cli.theory.patch import Patch


@by_value
class Recipe:
    """The way from a patch or model to its mesh: the options of ``gtb mesh`` without the options of files.

    Attributes
    ----------
    resolution, tolerance, parametrization, normals, max_faces
        As `tessellate` takes them; other resolutions than the default exclude a tolerance.
    radius : float or None
        Makes a tube of this radius around a curve.
    thickness : float, str or None
        Makes a solid of a surface: on the side of its normals, or if negative on the other side. ``"inwards:1.6"`` and
        ``"outwards:1.6"`` name the side, whatever the normals.
    rim : "normal" or "flat"
        The rims of a solid lie along the normals, or in the planes of the surface's rims that are plane.
    attributes : tuple of str
        Some of `gtb_cli.vocabulary.ATTRIBUTES`.
    require : tuple of str
        Refuse what does not have these properties: "watertight", "solid", "one-piece", "unfolded", "smooth:1deg", see
        `gtb_cli.tessellation.requirements`. One word may stand for itself, and None for none.
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
    thickness: float | str | None = None
    rim: Rim = RIMS[0]
    attributes: tuple[str, ...] = ()
    require: tuple[str, ...] = ()
    max_faces: int = MAX_FACES
    weld: float | str | None = None

    def __post_init__(self) -> None:
        check_fineness(self.resolution, self.tolerance, self.parametrization)
        if isinstance(self.max_faces, bool) or not hasattr(self.max_faces, "__index__") or self.max_faces < 1:
            raise DomainError(f"max_faces: expected a whole number of at least 1, got {self.max_faces!r}")
        if self.radius is not None and not 0 < self.radius < math.inf:
            raise DomainError(f"radius: must be positive, got {self.radius!r}")
        if self.thickness is not None:
            thickness_of(self.thickness)
        if self.tolerance is not None and self.resolution != RESOLUTION:
            raise DomainError("resolution: excludes a tolerance, give one of them")
        if self.radius is not None and self.thickness is not None:
            raise DomainError("radius: excludes thickness, as a curve becomes a tube and a surface a solid")
        if self.rim not in RIMS:
            raise DomainError(f"rim: expected one of {', '.join(RIMS)}, got {self.rim!r}")
        if self.rim != RIMS[0] and self.thickness is None:
            raise DomainError("rim: needs a thickness, as only a surface made a solid has such rims")
        words = (self.require,) if isinstance(self.require, str) else tuple(self.require or ())
        object.__setattr__(self, "require", tuple(dict.fromkeys(words)))
        requirements(words)

    def mesh(self, spec: Patch | Model, rounding: float = 0.0, held: Held | None = None) -> tuple[Mesh, list[str]]:
        """Make the mesh of a patch or model, and say what is unusual about its shape.

        Vertices may move by `rounding` afterwards, as in a file: a tolerance then holds for the moved ones.
        `held` gives a mesh as its file's numbers hold it, which is judged, and a remark for where they are too coarse.
        Raises `DomainError` where the recipe does not suit the spec, as a tube of a surface, `ToleranceError` where too
        many faces would be needed, and `RequirementError`, with edges or places, where what is required is not so.
        """
        from gtb_cli.models.model import Model, with_weld
        from gtb_cli.solids.solidity import AS_IF

        self.check_size(spec)
        spec = with_weld(spec, self.weld)
        surface, tolerance = self._surface(spec, rounding)
        remarks = self._remarks(spec)
        mesh = surface
        if self.attributes:
            from gtb_cli.tessellation.attributes import with_attributes

            mesh, lost = with_attributes(spec, surface, self.attributes, self.parametrization)
            where = f"at {lost} of {len(mesh.vertices)} vertices, which get the mean of their neighbours'"
            remarks += [f"the curvature has no finite limit {where}"] * bool(lost)
        maker: TubeMaker | WallMaker | None = None
        size = self.radius or 0.0
        faults, folds, thin = list[str](), list[str](), list[str]()
        try:
            if self.radius is not None:
                from gtb_cli.tessellation.solid_making import TubeMaker

                maker = TubeMaker(spec, self.parametrization, tolerance, self.max_faces)
            elif self.thickness is not None:
                from gtb_cli.solids.thickening import signed_thickness
                from gtb_cli.tessellation.solid_making import WallMaker

                size, side = signed_thickness(surface, self.thickness), thickness_of(self.thickness)[0]
                words = (f"{SIDES[0]}:", f"{SIDES[1]}:") if side else ("-", "")
                maker = WallMaker(spec, self.rim, words[::-1] if side and (side == SIDES[1]) != (size > 0) else words)
            if maker is not None:
                mesh, faults, folds, thin = maker.solid(mesh, size)
        except DomainError as error:
            from gtb_cli.models.openings import gaps_of

            causes = [remark for remark in remarks if AS_IF in remark]
            causes += gaps_of(spec) if isinstance(spec, Model) else []
            raise DomainError(*causes, *error.args) from None
        held = held or (lambda mesh: (mesh, ""))
        is_solid = not mesh.is_curve and (self.thickness is not None or "solid" in self.require)
        must_close = is_solid or ("watertight" in self.require and not mesh.is_curve)
        stored, coarse = held(mesh) if must_close else (mesh, "")
        if is_solid:
            from gtb_cli.tessellation.solid_making import crossings_of

            folds += crossings_of(mesh, stored, coarse)
        if maker is not None and folds and not faults:
            from gtb_cli.models.openings import gaps_of

            if not (isinstance(spec, Model) and gaps_of(spec)):  # else these are the cause
                folds[-1] += f"; {maker.smaller(surface, size, held)}"
        if self.require:
            from gtb_cli.tessellation.requirements import require

            causes = [remark for remark in remarks if (faults or folds) and AS_IF in remark]
            require(self.require, spec, mesh, surface, [*causes, *faults, *folds], (stored, coarse))
        return mesh, sorted(remarks + faults, key=lambda line: AS_IF not in line) + folds + thin

    def _surface(self, spec: Patch | Model, rounding: float) -> tuple[Mesh, float | None]:
        """Mesh the surface or curve; also return the tolerance, for a tube without what its rings need."""
        from gtb_cli.tessellation.tessellate import tessellate

        tolerance, around = self.tolerance_for(spec), 1 + (self.thickness is not None)
        if tolerance is not None and self.radius is not None and spec.dimension == 1:  # others are refused later
            from gtb_cli.solids.tube import ring_size

            # Of the middle line, and of the polygon of its rings: on the outside of a bend as sharp as the tube allows,
            # the middle line's error counts twice.
            tolerance *= 1 / 3
            around = 2 * ring_size(self.radius, tolerance)
        normals, most = self.normals or self.thickness is not None, self.max_faces // around
        n, kind = None if tolerance else self.resolution, self.parametrization
        try:
            mesh = tessellate(spec, n, tolerance, kind, normals=normals, max_faces=most, rounding=rounding)
        except ToleranceError as error:
            if around == 1 or f"more than {most}" not in str(error):  # as a weld may be beyond the tolerance
                raise
            more = "the solid has both sides" if around == 2 else f"the tube has {around} faces around each segment"
            raise ToleranceError(f"{error}: {more}") from None
        return mesh, tolerance

    def _remarks(self, spec: Patch | Model) -> list[str]:
        """Return remarks on corners, on the seams of a model, and on how its mesh is spread."""
        from gtb_cli.models.model import Model
        from gtb_cli.tessellation.doubtful_corners import doubtful_corners

        remarks = doubtful_corners(spec)
        if isinstance(spec, Model):
            from gtb_cli.models.openings import seam_remarks

            remarks += seam_remarks(spec)
        if self.tolerance is None and self.parametrization == "toric":
            from gtb_cli.tessellation.remarks import crowding

            remarks += crowding(spec, self.resolution)
        return remarks

    def tolerance_for(self, spec: Patch | Model) -> float | None:
        """Return the tolerance in model units; a percentage is of the spec's size, as `percentage_of_size` says."""
        if not isinstance(self.tolerance, str):
            return self.tolerance
        from gtb_cli.tessellation.tessellate import percentage_of_size

        return percentage_of_size(spec, self.tolerance)

    def assurance(self, spec: Patch | Model) -> Literal["certified", "sampled"] | None:
        """Say how sure the tolerance is: certified for curves, sampled for surfaces and tubes; None without one."""
        if self.tolerance is None:
            return None
        return "certified" if spec.dimension == 1 and self.radius is None else "sampled"

    def leaves_open(self, spec: Patch | Model) -> bool:
        """Tell whether the mesh has a boundary: it is no tube, no solid, and the spec is not a closed model."""
        return self.radius is None and self.thickness is None and self._is_open(spec)

    def direction(self, spec: Patch | Model, solid: Mesh) -> str:
        """Say to which side a wall grows."""
        if self.thickness is None:
            return ""
        side, length = thickness_of(self.thickness)
        if not self._is_open(spec):
            return f", thickened {side or ('inwards' if length < 0 else 'outwards')}, hollow"
        from gtb_cli.solids.thickening import side_of_wall

        otherwise = f"{side} for the most part" if side else f"{'against' if length < 0 else 'along'} its normals"
        found = side_of_wall(solid, otherwise)
        word = found.partition(",")[0]
        if side and word.endswith("wards") and word != side:  # as up or down, or towards its axis where it is flat
            found = otherwise if word in SIDES else f"{side}, {found}"
        return f", thickened {found}"

    def _is_open(self, spec: Patch | Model) -> bool:
        from gtb_cli.models.model import joints_of, with_weld

        return not joints_of(with_weld(spec, self.weld)).closed

    def faces(self, spec: Patch | Model) -> int:
        """Count the faces (of a curve: segments) of a mesh of this resolution, without making it."""
        from gtb_cli.knots.even_triangulation import cell_count

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
        from gtb_cli.tessellation.tessellate import refuse_faces

        refuse_faces(self.faces(spec), self.resolution, self.max_faces)
