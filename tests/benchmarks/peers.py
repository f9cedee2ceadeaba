"""What other libraries make of the same patches and meshes. Each is imported by the function that needs it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.interpolate import NdBSpline

from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch

Evaluation = Callable[[], np.ndarray]

# Degree of bicubic patches; their knots are the integers 0 to 3 both ways, the first coordinate running first
DEGREE = 3

ENDS = [0.0] * (DEGREE + 1) + [float(DEGREE)] * (DEGREE + 1)  # knots of the splines, with one span


def bezier_weights(patch: Patch) -> np.ndarray:
    """(16,) weights in the classical Bernstein basis: products with the coefficients, less binomial ones."""
    binomials = np.array([1, 3, 3, 1])
    return np.asarray(patch.weights * patch.coefficients / np.outer(binomials, binomials).ravel())


def homogeneous(patch: Patch) -> np.ndarray:
    """(16, 4) control points times weights, and weights."""
    weights = bezier_weights(patch)[:, None]
    return np.column_stack([patch.control_points * weights, weights])


def by_scipy(patch: Patch, u: np.ndarray) -> Evaluation:
    """One span of scipy's tensor product splines in homogeneous coordinates, and the quotient."""
    net = homogeneous(patch).reshape(4, 4, 4).transpose(1, 0, 2)
    spline = NdBSpline((np.array(ENDS), np.array(ENDS)), np.ascontiguousarray(net), DEGREE)

    def run() -> np.ndarray:
        points = spline(u)
        return np.asarray(points[:, :3] / points[:, 3:])

    return run


def by_splinepy(patch: Patch, u: np.ndarray) -> Evaluation:
    """SplineLib's rational Bézier surface, in C++, with one thread; its parameters go from 0 to 1."""
    from splinepy import RationalBezier

    surface = RationalBezier([DEGREE, DEGREE], patch.control_points, bezier_weights(patch))
    places = u / DEGREE
    return lambda: np.asarray(surface.evaluate(places, nthreads=1))


def by_splipy(patch: Patch, line: np.ndarray) -> Evaluation:
    """The grid of all pairs of parameters: (m, m, 3) points by products of two tables."""
    from splipy import BSplineBasis, Surface

    basis = BSplineBasis(DEGREE + 1, ENDS)
    surface = Surface(basis, basis, homogeneous(patch), rational=True)
    return lambda: np.asarray(surface(line, line))


def by_open_cascade(model: Model, tolerance: float, folder: Path) -> Callable[[], int]:
    """Open CASCADE's mesher, in C++, with one thread, on the sewn surfaces of a model; it counts the triangles."""
    from OCP.BRep import BRep_Builder, BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS, TopoDS_Shape

    from gtb_cli.cad.bspline_surfaces import spline_surfaces
    from gtb_cli.cad.cad_writing import encode_cad

    path, shape = folder / "x.brep", TopoDS_Shape()
    path.write_bytes(encode_cad(spline_surfaces(model, None).surfaces, "brep", "mm", "patch")[0])
    BRepTools.Read_s(shape, str(path), BRep_Builder())

    def run() -> int:
        BRepTools.Clean_s(shape)
        BRepMesh_IncrementalMesh(shape, tolerance, False, 0.5, False)
        faces, count = TopExp_Explorer(shape, TopAbs_FACE), 0
        while faces.More():
            count += BRep_Tool.Triangulation_s(TopoDS.Face(faces.Current()), TopLoc_Location()).NbTriangles()
            faces.Next()
        return count

    return run
