"""Generalized toric-Bézier patches: from a short text description to a mesh, and the theory as functions.

The public names are listed below by the modules that have them. Each has its shapes, units, errors and source in its
own help, and all are in specs/PYTHON.md with examples. They are imported when first used, and cost nothing before.
"""

from typing import TYPE_CHECKING

from gtb_cli.display import draws
from gtb_cli.version import __version__ as __version__

if TYPE_CHECKING:
    from gtb_cli.bezier.elevation import elevate as elevate
    from gtb_cli.bezier.isocurve import isocurve as isocurve
    from gtb_cli.bezier.pieces import bezier_pieces as bezier_pieces, split_curve as split_curve
    from gtb_cli.checks.properties import check as check
    from gtb_cli.checks.report import Finding as Finding, ModelReport as ModelReport, Report as Report
    from gtb_cli.distances.diff_and_distance import diff as diff, distance as distance
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
    _NAMES = """
Specs and files
    language.loading: load, load_patch, load_model, from_dict
    language.writer: to_dict, save
    importers.readers: import_file, Imported
Patches
    theory.patch: Patch
    models.model: Model
    knots.domain: Domain, domain
    theory.curvature: Curvature
    language.for_paths: corner_limits
    theory.corners: CornerLimits
    language.for_paths: boundary
    theory.basis: unity_coefficients
Integrals
    language.for_paths: quadrature
    theory.quadrature: Quadrature
Limits
    knots.decomposition: regular_decomposition, RegularDecomposition
    knots.all_decompositions: regular_decompositions, LiftingCone
    knots.convergence: convergence_rate
    limits.degeneration: degenerate, regular_control_surface
    sequences.sequence: degeneration, MeshSequence, Member
    limits.knot_limit: merge_knots, move_knots, knot_limit, KnotLimit, Film
    sequences.sequence: knot_sequence
Other patches
    bezier.elevation: elevate
    bezier.isocurve: isocurve
    bezier.pieces: bezier_pieces, split_curve
    fairing.fit: fit, Fit
    filling.fill: fill
    filling.certificate: Filling, Contact
    fairing.fair: fair, Fairing
Meshes
    tessellation.tessellate: tessellate
    tessellation.recipe: Recipe
    meshes.mesh: Mesh
    formats.export: write_mesh
    formats.meshfiles: read_mesh
Measurements
    distances.diff_and_distance: distance
    meshes.hausdorff: Distance
    distances.diff_and_distance: diff
    meshes.difference: Difference
    language.for_paths: joints
    models.joints: Joints, Joint
    models.seams: Seam
    checks.properties: check
    checks.report: Report, ModelReport, Finding
Pictures
    plots.figures: plot
    pages.page: page
Errors
    errors: GtbError, SpecError, DomainError, ToleranceError, ExportError, RequirementError, Fault
"""
    __doc__ = f"{__doc__}{_NAMES}"
    _LINES = [line.strip().split(": ") for line in _NAMES.split("\n") if ": " in line]
    _HOMES = {name: room for room, names in _LINES for name in names.split(", ")}
    __all__ = ["__version__", *_HOMES]
    _HOMES["frame"] = "pages.notebook"  # what a notebook shows, which nobody calls

    def __getattr__(name):
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from importlib import import_module

        value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
        globals()[name] = value
        return value

    draws.update(plot=lambda: __getattr__("plot"), frame=lambda: __getattr__("frame"))

    def __dir__():
        return sorted(__all__)
