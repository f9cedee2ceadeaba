"""The public names, by sections: the package reads here in which modules they are, and type checkers their types."""

from gtb_cli.pages.notebook import notebook_html as notebook_html  # which nobody calls
from gtb_cli.version import __version__ as __version__

# Specs and files
from gtb_cli.language.loading import load as load, load_patch as load_patch, load_model as load_model
from gtb_cli.language.loading import from_dict as from_dict
from gtb_cli.language.writer import to_dict as to_dict, save as save
from gtb_cli.importers.readers import import_file as import_file, Imported as Imported

# Patches
from gtb_cli.theory.patch import Patch as Patch
from gtb_cli.models.model import Model as Model
from gtb_cli.knots.domain import Domain as Domain, domain as domain
from gtb_cli.theory.curvature import Curvature as Curvature
from gtb_cli.language.for_paths import corner_limits as corner_limits
from gtb_cli.theory.corners import CornerLimits as CornerLimits
from gtb_cli.language.for_paths import boundary as boundary
from gtb_cli.theory.basis import unity_coefficients as unity_coefficients

# Integrals
from gtb_cli.language.for_paths import quadrature as quadrature
from gtb_cli.theory.quadrature import Quadrature as Quadrature

# Limits
from gtb_cli.knots.decomposition import regular_decomposition as regular_decomposition
from gtb_cli.knots.decomposition import RegularDecomposition as RegularDecomposition
from gtb_cli.knots.all_decompositions import regular_decompositions as regular_decompositions
from gtb_cli.knots.all_decompositions import LiftingCone as LiftingCone
from gtb_cli.knots.convergence import convergence_rate as convergence_rate
from gtb_cli.limits.degeneration import degenerate as degenerate, regular_control_surface as regular_control_surface
from gtb_cli.sequences.sequence import degeneration as degeneration, MeshSequence as MeshSequence, Member as Member
from gtb_cli.limits.knot_limit import merge_knots as merge_knots, move_knots as move_knots, knot_limit as knot_limit
from gtb_cli.limits.knot_limit import KnotLimit as KnotLimit, Film as Film
from gtb_cli.sequences.sequence import knot_sequence as knot_sequence

# Other patches
from gtb_cli.bezier.elevation import elevate as elevate
from gtb_cli.bezier.isocurve import isocurve as isocurve
from gtb_cli.bezier.pieces import bezier_pieces as bezier_pieces, split_curve as split_curve
from gtb_cli.fairing.fit import fit as fit, Fit as Fit
from gtb_cli.filling.fill import fill as fill
from gtb_cli.filling.certificate import Filling as Filling, Contact as Contact
from gtb_cli.fairing.fair import fair as fair, Fairing as Fairing

# Meshes
from gtb_cli.tessellation.tessellate import tessellate as tessellate
from gtb_cli.tessellation.recipe import Recipe as Recipe
from gtb_cli.meshes.mesh import Mesh as Mesh
from gtb_cli.formats.export import write_mesh as write_mesh
from gtb_cli.formats.meshfiles import read_mesh as read_mesh

# Measurements
from gtb_cli.distances.diff_and_distance import distance as distance
from gtb_cli.meshes.hausdorff import Distance as Distance
from gtb_cli.distances.diff_and_distance import diff as diff
from gtb_cli.meshes.difference import Difference as Difference
from gtb_cli.language.for_paths import joints as joints
from gtb_cli.models.joints import Joints as Joints, Joint as Joint
from gtb_cli.models.smoothness import Seam as Seam
from gtb_cli.checks.properties import check as check
from gtb_cli.checks.report import Report as Report, ModelReport as ModelReport, Finding as Finding

# Pictures
from gtb_cli.plots.figures import plot as plot
from gtb_cli.pages.page import page as page

# Errors
from gtb_cli.errors import GtbError as GtbError, SpecError as SpecError, DomainError as DomainError
from gtb_cli.errors import ToleranceError as ToleranceError, ExportError as ExportError
from gtb_cli.errors import RequirementError as RequirementError, Fault as Fault
