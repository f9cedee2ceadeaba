"""Tubes around curves and walls beside surfaces, what is wrong with them, and which smaller size is solid."""

import math
from collections.abc import Callable
from contextlib import suppress
from typing import TypeAlias

from gtb_cli.errors import DomainError, RequirementError, ToleranceError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.models.rings_of_copies import crowds
from gtb_cli.solids.crossings import CROSSING_DEPTH, crossing_pairs
from gtb_cli.solids.flat_rims import with_flat_rims
from gtb_cli.solids.solidity import crossing_remarks, where
from gtb_cli.solids.thickening import folded_faces, thicken
from gtb_cli.solids.tube import folded_segments, tube
from gtb_cli.tessellation.remarks import offset_folds, sharpest_bend, thin_wall
from gtb_cli.tessellation.requirements import places_of_folds, require
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen
from gtb_cli.vocabulary import RESOLUTION, Parametrization, Rim

Held: TypeAlias = Callable[[Mesh], tuple[Mesh, str]]
# A tube or a wall; faults of the surface, which no other thickness mends; folds; and where the wall is thin
Solid: TypeAlias = tuple[Mesh, list[str], list[str], list[str]]
FEW_CELLS, MANY_CELLS = 5_000, 20_000  # up to which there is time for eight tries, and from which on only for three


@frozen
class TubeMaker:
    """Tubes around the mesh of a curve, made within a tolerance if there is one."""

    spec: Patch | Model
    parametrization: Parametrization  # of the mesh
    tolerance: float | None
    max_faces: int

    def solid(self, curve: Mesh, radius: float) -> Solid:
        """Make the tube of a radius."""
        tangents = None
        if isinstance(self.spec, Patch) and curve.is_curve and curve.parameters is not None:
            tangents = self.spec.tangents(curve.parameters, self.parametrization)[curve.cells]
        folded = folded_segments(curve, radius, tolerance=self.tolerance, tangents=tangents)
        folds = []
        if len(folded):
            folds.append(f"a radius of {radius:g} is more than that of the curve's bends: {where(curve, folded)}")
            if isinstance(self.spec, Patch) and curve.parameters is not None:
                u, inner = curve.parameters[curve.cells[folded[0]]].mean(axis=0), self.spec.knots[:, 0].argsort()[1:-1]
                shares = self.spec.basis(u, self.parametrization)[0, inner]
                folds[-1] += f", drawn there by control point {inner[shares.argmax()]}" if len(inner) else ""
        return tube(curve, radius, tolerance=self.tolerance, tangents=tangents, max_faces=self.max_faces), [], folds, []

    def smaller(self, curve: Mesh, radius: float, held: Held) -> str:
        """Name a smaller radius whose tube is solid, judged as one that is asked for; or say that none was found."""

        def is_solid(radius: float) -> bool:
            with suppress(DomainError, ToleranceError):
                mesh, _, folds, _ = self.solid(curve, radius)
                return not folds and not crossings_of(mesh, *held(mesh))
            return False

        return _smaller(radius, radius, is_solid, len(curve.cells), "a radius of {:g}".format)


@frozen
class WallMaker:
    """Walls beside the mesh of a surface."""

    spec: Patch | Model
    rim: Rim
    signs: tuple[str, str]  # what is written before a thickness against the normals and along them

    def solid(self, surface: Mesh, thickness: float) -> Solid:
        """Make the wall of a thickness."""
        for edges, why in crowds(self.spec.joints, self.spec.patches) if isinstance(self.spec, Model) else ():
            raise DomainError(f"thickness: {edges}, where at most two may meet{why and f': {why}'}")
        wall = thicken(surface, thickness)
        places = offset_folds(self.spec, surface, wall, thickness)
        folds = [f"with {self._words(thickness)} the offset folds: {places}"] * bool(places)
        mesh, kept = self._rimmed(wall, thickness)
        return mesh, places_of_folds(self.spec, surface), folds, thin_wall(wall, thickness) + kept

    def smaller(self, surface: Mesh, thickness: float, held: Held) -> str:
        """Name a coarser mesh or a smaller thickness that is solid, judged as asked, and the other side if it is."""

        def is_solid(thickness: float, surface: Mesh = surface) -> bool:
            with suppress(DomainError, RequirementError):
                wall = thicken(surface, thickness)
                if len(folded_faces(wall)) or sharpest_bend(self.spec, surface, thickness)[0] < math.inf:
                    return False
                wall, _ = self._rimmed(wall, thickness)
                stored, coarse = held(wall)
                require(("solid",), self.spec, wall, surface, crossings_of(wall, stored, coarse), (stored, coarse))
                return True
            return False

        if len(crossing_pairs(surface.vertices, surface.faces)[0]):
            return "no thickness is solid, as the surface passes through itself"
        if abs(thickness) <= CROSSING_DEPTH * (size := max(surface.bounds[1] - surface.bounds[0])):
            return f"a wall thinner than {CROSSING_DEPTH:g} of the size cannot be told from one that does"
        radius, cells = sharpest_bend(self.spec, surface, thickness)[0], len(surface.cells)
        tolerances = [min(abs(thickness) / share, size / 500) for share in (50, 10)]
        ways = [(f"`tolerance` {each:.1g}", None, float(f"{each:.1g}"), min(cells, MANY_CELLS)) for each in tolerances]
        coarse = RESOLUTION // 2  # finer meshes that are hopeless take many seconds
        even = f"`resolution` {coarse}", coarse, None, max(2 * cells, FEW_CELLS)
        for way, n, tolerance, most in (*ways, even) if radius == math.inf else ():  # else no fineness helps
            with suppress(ToleranceError):
                other = tessellate(self.spec, n, tolerance, normals=True, max_faces=most)
                if len(other.cells) != cells and is_solid(thickness, other):
                    return f"it hangs on the fineness: with {way} it was tried and is solid"
        found = _smaller(thickness, radius, is_solid, cells, self._words)
        is_other = cells < MANY_CELLS and is_solid(-thickness)
        return found + f"; on the other side {self._words(-thickness)} is solid" * is_other

    def _words(self, thickness: float) -> str:
        return f"`thickness` {self.signs[thickness > 0]}{abs(thickness):g}"

    def _rimmed(self, wall: Mesh, thickness: float) -> tuple[Mesh, list[str]]:
        return (wall, []) if self.rim == "normal" else with_flat_rims(wall, thickness, self._words(-thickness))


def crossings_of(mesh: Mesh, stored: Mesh, coarse: str) -> list[str]:
    """Say where a mesh, as it is stored, passes through itself, and with a remark, if it does not before."""
    crossings = crossing_remarks(stored)
    if crossings and stored is not mesh and not crossing_remarks(mesh):
        return [f"{line}: {coarse}" for line in crossings]
    return crossings


def _smaller(
    value: float, most: float, is_solid: Callable[[float], bool], cells: int, words: Callable[[float], str]
) -> str:
    """Name a smaller value that makes a solid, near the largest that does, or say that none was found."""
    # The first are 95 % of what bends allow, if that is less, or 1/2, and 1/8, 1/64 and 1/1024; from one that is solid,
    # it is bisected upwards.
    near, tries = 0.95, 8 if cells < FEW_CELLS else 5 if cells < MANY_CELLS else 3
    low, high, tried = 0.0, min(abs(value), most), 0
    while (tried < tries and low < near * high) if low else tried < min(tries, 4):
        first = 0.95 if most < abs(value) and not tried else 1 / 2 ** (tried + 1)
        middle = float(f"{math.sqrt(low * high) if low else first * high:.3g}")
        low, high = (middle, high) if is_solid(math.copysign(middle, value)) else (low, middle)
        tried += 1
    if low:
        return f"{words(math.copysign(low, value))} was tried and is solid"
    return f"{tried} down to {words(math.copysign(high, value))} were tried, and none is solid"
