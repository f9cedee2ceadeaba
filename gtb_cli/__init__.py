"""Generalized toric-Bézier patches: from a short text description to a mesh.

The names below are the public API. They are imported when first used, so that ``import gtb_cli`` costs nothing.
"""

from typing import TYPE_CHECKING

from gtb_cli.display import register
from gtb_cli.version import __version__ as __version__

if TYPE_CHECKING:
    from gtb_cli.assembly.seams import joints as joints
    from gtb_cli.bezier.elevation import elevate as elevate
    from gtb_cli.checks.check import check as check
    from gtb_cli.design.filling import fill as fill
    from gtb_cli.design.fit import fit as fit
    from gtb_cli.distances.comparison import diff as diff
    from gtb_cli.distances.comparison import distance as distance
    from gtb_cli.errors import DomainError as DomainError
    from gtb_cli.errors import ExportError as ExportError
    from gtb_cli.errors import Fault as Fault
    from gtb_cli.errors import GtbError as GtbError
    from gtb_cli.errors import RequirementError as RequirementError
    from gtb_cli.errors import SpecError as SpecError
    from gtb_cli.errors import ToleranceError as ToleranceError
    from gtb_cli.fairing.fair import fair as fair
    from gtb_cli.formats.export import write_mesh as write_mesh
    from gtb_cli.formats.meshfiles import read_mesh as read_mesh
    from gtb_cli.knots.all_decompositions import regular_decompositions as regular_decompositions
    from gtb_cli.knots.convergence import convergence_rate as convergence_rate
    from gtb_cli.knots.decomposition import regular_decomposition as regular_decomposition
    from gtb_cli.language.loading import from_dict as from_dict
    from gtb_cli.language.loading import load as load
    from gtb_cli.language.writer import save as save
    from gtb_cli.language.writer import to_dict as to_dict
    from gtb_cli.meshes.mesh import Mesh as Mesh
    from gtb_cli.pictures.figures import plot as plot
    from gtb_cli.pictures.page import frame as frame
    from gtb_cli.pictures.page import page as page
    from gtb_cli.tessellation.recipe import Recipe as Recipe
    from gtb_cli.tessellation.tessellate import tessellate as tessellate
    from gtb_cli.theory.degeneration import degenerate as degenerate
    from gtb_cli.theory.degeneration import regular_control_surface as regular_control_surface
    from gtb_cli.theory.knot_limit import merge_knots as merge_knots
    from gtb_cli.theory.knot_limit import move_knots as move_knots
    from gtb_cli.theory.model import Model as Model
    from gtb_cli.theory.patch import Patch as Patch

_ROOMS = {
    "DomainError": "errors",
    "ExportError": "errors",
    "Fault": "errors",
    "GtbError": "errors",
    "Mesh": "meshes.mesh",
    "Model": "theory.model",
    "Patch": "theory.patch",
    "Recipe": "tessellation.recipe",
    "RequirementError": "errors",
    "SpecError": "errors",
    "ToleranceError": "errors",
    "check": "checks.check",
    "convergence_rate": "knots.convergence",
    "degenerate": "theory.degeneration",
    "diff": "distances.comparison",
    "distance": "distances.comparison",
    "elevate": "bezier.elevation",
    "fair": "fairing.fair",
    "fill": "design.filling",
    "fit": "design.fit",
    "frame": "pictures.page",
    "from_dict": "language.loading",
    "joints": "assembly.seams",
    "load": "language.loading",
    "merge_knots": "theory.knot_limit",
    "move_knots": "theory.knot_limit",
    "page": "pictures.page",
    "plot": "pictures.figures",
    "read_mesh": "formats.meshfiles",
    "regular_control_surface": "theory.degeneration",
    "regular_decomposition": "knots.decomposition",
    "regular_decompositions": "knots.all_decompositions",
    "save": "language.writer",
    "tessellate": "tessellation.tessellate",
    "to_dict": "language.writer",
    "write_mesh": "formats.export",
}

__all__ = ["__version__", *(name for name in _ROOMS if name != "frame")]


def __getattr__(name: str) -> object:
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_ROOMS[name]}"), name)
    globals()[name] = value
    return value


register(__getattr__)


def __dir__() -> list[str]:
    return sorted(__all__)
