"""Generalized toric-Bézier patches: from a short text description to a mesh, and the theory as functions.

These are the public names; each has its shapes, units, errors and source in its own help, and all of them are in
specs/PYTHON.md with examples. They are imported when first used, so that ``import gtb_cli`` costs nothing.

Specs and files
    load, load_patch, load_model, from_dict, to_dict, save, import_file, Imported
Patches
    Patch, Model, Domain, domain, Curvature, corner_limits, CornerLimits, boundary, unity_coefficients
Integrals
    quadrature, Quadrature
Limits
    regular_decomposition, RegularDecomposition, regular_decompositions, LiftingCone, convergence_rate,
    degenerate, regular_control_surface, degeneration, MeshSequence, Member,
    merge_knots, move_knots, knot_limit, KnotLimit, Film, knot_sequence
Other patches
    elevate, isocurve, bezier_pieces, split_curve, fit, Fit, fill, Filling, Contact, fair, Fairing
Meshes
    tessellate, Recipe, Mesh, write_mesh, read_mesh
Measurements
    distance, Distance, diff, Difference, joints, Joints, Joint, Seam, check, Report, ModelReport, Finding
Pictures
    plot, page
Errors
    GtbError, SpecError, DomainError, ToleranceError, ExportError, RequirementError, Fault
"""

from typing import TYPE_CHECKING

from gtb_cli.display import draw_with
from gtb_cli.version import __version__ as __version__

if TYPE_CHECKING:
    from gtb_cli.bezier.elevation import elevate as elevate
    from gtb_cli.bezier.isocurve import isocurve as isocurve
    from gtb_cli.bezier.pieces import bezier_pieces as bezier_pieces, split_curve as split_curve
    from gtb_cli.checks.properties import check as check
    from gtb_cli.checks.report import Finding as Finding, ModelReport as ModelReport, Report as Report
    from gtb_cli.distances.comparison import diff as diff, distance as distance
    from gtb_cli.errors import (
        DomainError as DomainError,
        ExportError as ExportError,
        Fault as Fault,
        GtbError as GtbError,
        RequirementError as RequirementError,
        SpecError as SpecError,
        ToleranceError as ToleranceError,
    )
    from gtb_cli.fairing.fair import Fairing as Fairing, fair as fair
    from gtb_cli.fairing.fit import Fit as Fit, fit as fit
    from gtb_cli.filling.certificate import Contact as Contact, Filling as Filling
    from gtb_cli.filling.fill import fill as fill
    from gtb_cli.formats.export import write_mesh as write_mesh
    from gtb_cli.formats.meshfiles import read_mesh as read_mesh
    from gtb_cli.importers.readers import Imported as Imported, import_file as import_file
    from gtb_cli.knots.all_decompositions import (
        LiftingCone as LiftingCone,
        regular_decompositions as regular_decompositions,
    )
    from gtb_cli.knots.convergence import convergence_rate as convergence_rate
    from gtb_cli.knots.decomposition import (
        RegularDecomposition as RegularDecomposition,
        regular_decomposition as regular_decomposition,
    )
    from gtb_cli.knots.domain import Domain as Domain, domain as domain
    from gtb_cli.language.for_paths import (
        boundary as boundary,
        corner_limits as corner_limits,
        joints as joints,
        quadrature as quadrature,
    )
    from gtb_cli.language.loading import (
        from_dict as from_dict,
        load as load,
        load_model as load_model,
        load_patch as load_patch,
    )
    from gtb_cli.language.writer import save as save, to_dict as to_dict
    from gtb_cli.limits.degeneration import degenerate as degenerate, regular_control_surface as regular_control_surface
    from gtb_cli.limits.knot_limit import (
        Film as Film,
        KnotLimit as KnotLimit,
        knot_limit as knot_limit,
        merge_knots as merge_knots,
        move_knots as move_knots,
    )
    from gtb_cli.meshes.difference import Difference as Difference
    from gtb_cli.meshes.hausdorff import Distance as Distance
    from gtb_cli.meshes.mesh import Mesh as Mesh
    from gtb_cli.models.joints import Joint as Joint, Joints as Joints
    from gtb_cli.models.model import Model as Model
    from gtb_cli.models.seams import Seam as Seam
    from gtb_cli.pages.notebook import frame as frame
    from gtb_cli.pages.page import page as page
    from gtb_cli.plots.figures import plot as plot
    from gtb_cli.sequences.sequence import (
        Member as Member,
        MeshSequence as MeshSequence,
        degeneration as degeneration,
        knot_sequence as knot_sequence,
    )
    from gtb_cli.tessellation.recipe import Recipe as Recipe
    from gtb_cli.tessellation.tessellate import tessellate as tessellate
    from gtb_cli.theory.basis import unity_coefficients as unity_coefficients
    from gtb_cli.theory.corners import CornerLimits as CornerLimits
    from gtb_cli.theory.curvature import Curvature as Curvature
    from gtb_cli.theory.patch import Patch as Patch
    from gtb_cli.theory.quadrature import Quadrature as Quadrature
else:
    # Public names by the modules that have them
    _ROOMS = {
        "bezier.elevation": "elevate",
        "bezier.pieces": "bezier_pieces split_curve",
        "checks.properties": "check",
        "checks.report": "Finding ModelReport Report",
        "filling.certificate": "Contact Filling",
        "filling.fill": "fill",
        "fairing.fit": "Fit fit",
        "bezier.isocurve": "isocurve",
        "distances.comparison": "diff distance",
        "errors": "DomainError ExportError Fault GtbError RequirementError SpecError ToleranceError",
        "fairing.fair": "Fairing fair",
        "formats.export": "write_mesh",
        "formats.meshfiles": "read_mesh",
        "importers.readers": "Imported import_file",
        "knots.all_decompositions": "LiftingCone regular_decompositions",
        "knots.convergence": "convergence_rate",
        "knots.decomposition": "RegularDecomposition regular_decomposition",
        "knots.domain": "Domain domain",
        "language.loading": "from_dict load load_model load_patch",
        "language.for_paths": "boundary corner_limits joints quadrature",
        "language.writer": "save to_dict",
        "meshes.difference": "Difference",
        "meshes.hausdorff": "Distance",
        "meshes.mesh": "Mesh",
        "pages.notebook": "frame",
        "pages.page": "page",
        "plots.figures": "plot",
        "sequences.sequence": "Member MeshSequence degeneration knot_sequence",
        "tessellation.recipe": "Recipe",
        "tessellation.tessellate": "tessellate",
        "theory.basis": "unity_coefficients",
        "theory.corners": "CornerLimits",
        "theory.curvature": "Curvature",
        "limits.degeneration": "degenerate regular_control_surface",
        "limits.knot_limit": "Film KnotLimit knot_limit merge_knots move_knots",
        "models.joints": "Joint Joints",
        "models.model": "Model",
        "models.seams": "Seam",
        "theory.patch": "Patch",
        "theory.quadrature": "Quadrature",
    }
    _HOMES = {name: room for room, names in _ROOMS.items() for name in names.split()}

    def __getattr__(name):
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from importlib import import_module

        value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
        globals()[name] = value
        return value

    __all__ = ["__version__", *(name for name in _HOMES if name != "frame")]

    draw_with(plot=lambda: __getattr__("plot"), frame=lambda: __getattr__("frame"))

    def __dir__():
        return sorted(__all__)
