"""STEP, IGES and BREP files, read by Open CASCADE: faces, free edges, and both as exact rational Bézier patches.

Its Python package is an extra: ``gtb-cli[cad]``. Lengths of STEP and IGES files become millimetres.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import SpecError
from gtb_cli.files import begin
from gtb_cli.importers.classical_nets import curve, rectangle
from gtb_cli.language.patch_reader import MAX_PATCHES
from gtb_cli.theory.patch import Patch

MISSING = "needs Open CASCADE, the extra gtb-cli[cad]: pip install 'gtb-cli[cad]'"

PROBE = "import sys; from gtb_cli.importers.cad_files import probe; probe(*sys.argv[1:])"

UNTRIMMED = 1e-7  # relative difference of a face's area to that between its bounds: the kernel's precision


def kernel(room: str) -> Any:
    """Import a module of Open CASCADE."""
    return import_module(f"OCP.{room}")


def read_shape(data: bytes, kind: str, source: str) -> Any:
    """Read a file of a kind, step, iges or brep, as a shape of Open CASCADE.

    Raises `SpecError`: the extra is missing, or the kernel cannot read the file.
    """
    try:
        silence()
    except ModuleNotFoundError:
        raise SpecError(f"{source}: {kind.upper()} {MISSING}") from None
    with tempfile.TemporaryDirectory(prefix=".gtb-") as folder:
        path = os.path.join(folder, f"x.{kind}")
        begin(folder)
        begin(path)
        with open(path, "wb") as file:
            file.write(data)
        if subprocess.run([sys.executable, "-c", PROBE, kind, path], capture_output=True, check=False).returncode < 0:
            raise SpecError(f"{source}: Open CASCADE breaks down when it reads this file")
        shape = _shape(kind, path)
    if shape is None or shape.IsNull():
        raise SpecError(f"{source}: Open CASCADE finds no shape in it: is it a {kind.upper()} file?")
    return shape


def silence() -> None:
    """Keep the kernel from writing to standard output, which is for data."""
    room = kernel("Message")
    for printer in list(room.Message.DefaultMessenger_s().Printers()):
        printer.SetTraceLevel(room.Message_Gravity.Message_Fail)


def _shape(kind: str, path: str) -> Any:
    return _brep(path) if kind == "brep" else _transferred(path, kind)


def probe(kind: str, path: str) -> None:
    """Read a file as a process of its own, which a broken file may end."""
    silence()
    shape = _shape(kind, path)
    if shape is not None and not shape.IsNull():
        for face in parts(shape, "FACE"):
            face_pieces(face)
        for edge in parts(shape, "EDGE"):
            edge_pieces(edge)


def _brep(path: str) -> Any:
    shape = kernel("TopoDS").TopoDS_Shape()
    return shape if kernel("BRepTools").BRepTools.Read_s(shape, path, kernel("BRep").BRep_Builder()) else None


def _transferred(path: str, kind: str) -> Any:
    name = {"step": "STEPControl", "iges": "IGESControl"}[kind]
    reader = getattr(kernel(name), f"{name}_Reader")()
    if reader.ReadFile(path) != kernel("IFSelect").IFSelect_ReturnStatus.IFSelect_RetDone:
        return None
    reader.TransferRoots()
    return reader.OneShape() if reader.NbShapes() else None


def parts(shape: Any, kind: str, avoid: str = "SHAPE") -> Iterator[Any]:
    """Yield the FACE, EDGE or other parts of a shape that are not in parts to avoid."""
    kinds = kernel("TopAbs").TopAbs_ShapeEnum
    explorer = kernel("TopExp").TopExp_Explorer(
        shape, getattr(kinds, f"TopAbs_{kind}"), getattr(kinds, f"TopAbs_{avoid}")
    )
    cast = getattr(kernel("TopoDS").TopoDS, kind.capitalize())
    while explorer.More():
        yield cast(explorer.Current())
        explorer.Next()


def edge_pieces(edge: Any) -> list[FloatArray]:
    """Return an edge as Bézier curves, each (m + 1, 4) homogeneous points (x w, y w, z w, w), along its own curve."""
    convert, adaptor = kernel("GeomConvert"), kernel("BRepAdaptor").BRepAdaptor_Curve(edge)
    first, last = adaptor.FirstParameter(), adaptor.LastParameter()
    whole = kernel("BRep").BRep_Tool.Curve_s(edge, first, last)
    trimmed = kernel("Geom").Geom_TrimmedCurve(whole, first, last)
    pieces = convert.GeomConvert_BSplineCurveToBezierCurve(convert.GeomConvert.CurveToBSplineCurve_s(trimmed))
    arcs = [pieces.Arc(k) for k in range(1, pieces.NbArcs() + 1)]
    return [_net(arc.Pole, arc.Weight, (arc.NbPoles(),)) for arc in arcs]


def face_pieces(face: Any) -> list[FloatArray] | None:
    """Return a face as Bézier rectangles, (m + 1, n + 1, 4) homogeneous points, or None if it is trimmed.

    It is not where its area is that of its surface between its bounds. Rectangles have the orientation of the face.
    """
    surface = kernel("BRep").BRep_Tool.Surface_s(face)
    bounds, most = list(kernel("BRepTools").BRepTools.UVBounds_s(face)), surface.Bounds()
    for first, is_periodic in ((0, surface.IsUPeriodic()), (2, surface.IsVPeriodic())):
        if not is_periodic:  # by rounding, the bounds of a file may be beyond
            bounds[first : first + 2] = max(bounds[first], most[first]), min(bounds[first + 1], most[first + 1])
    whole = kernel("BRepBuilderAPI").BRepBuilderAPI_MakeFace(surface, *bounds, 1e-9)
    if not whole.IsDone():
        return None
    areas = []
    for one in (face, whole.Face()):
        measured = kernel("GProp").GProp_GProps()
        kernel("BRepGProp").BRepGProp.SurfaceProperties_s(one, measured, 1e-9)
        areas.append(abs(measured.Mass()))
    if abs(areas[0] - areas[1]) > UNTRIMMED * areas[1]:
        return None
    convert = kernel("GeomConvert")
    spline = convert.GeomConvert.SurfaceToBSplineSurface_s(
        kernel("Geom").Geom_RectangularTrimmedSurface(surface, *bounds)
    )
    pieces = convert.GeomConvert_BSplineSurfaceToBezierSurface(spline)
    places = [(i, j) for i in range(1, pieces.NbUPatches() + 1) for j in range(1, pieces.NbVPatches() + 1)]
    patches = [pieces.Patch(*place) for place in places]
    nets = [_net(patch.Pole, patch.Weight, (patch.NbUPoles(), patch.NbVPoles())) for patch in patches]
    turned = face.Orientation() == kernel("TopAbs").TopAbs_Orientation.TopAbs_REVERSED
    return [net.swapaxes(0, 1) if turned else net for net in nets]


def _net(pole: Callable[..., Any], weight: Callable[..., float], shape: tuple[int, ...]) -> FloatArray:
    places = [(index, tuple(k + 1 for k in index)) for index in np.ndindex(shape)]
    net = np.ones((*shape, 4))
    for index, place in places:
        point, w = pole(*place), weight(*place)
        net[index] = point.X() * w, point.Y() * w, point.Z() * w, w
    return net


def _read(kind: str, data: bytes, source: str) -> tuple[list[Patch], list[str]]:
    """Return the untrimmed faces of a file, and the edges of no face, as patches; remarks name the others."""
    shape = read_shape(data, kind, source)
    patches: list[Patch] = []
    trimmed = 0
    try:
        for number, face in enumerate(parts(shape, "FACE")):
            nets = face_pieces(face)
            trimmed += nets is None
            patches += _patches(nets or [], f"face-{number}")
        for number, edge in enumerate(parts(shape, "EDGE", "FACE")):
            patches += _patches(edge_pieces(edge), f"edge-{number}")
    except kernel("Standard").Standard_Failure as error:
        raise SpecError(f"{source}: Open CASCADE: {error}") from None
    if len(patches) > MAX_PATCHES:
        raise SpecError(f"{source}: has {len(patches)} spans, a model has at most {MAX_PATCHES} patches")
    remarks = [f"{trimmed} trimmed faces are left out, as patches have no trimming"] if trimmed else []
    if kind != "brep":
        remarks.append("lengths are millimetres")
    return patches, remarks


def _patches(nets: list[FloatArray], name: str) -> list[Patch]:
    found = []
    for k, net in enumerate(nets):
        points, weights = net[..., :3] / net[..., 3:], net[..., 3]
        weights = weights / weights.flat[0]
        patch = rectangle(points, weights) if net.ndim == 3 else curve(points, weights)
        found.append(patch.replace(name=name if len(nets) == 1 else f"{name}-{k}"))
    return found


read_step, read_iges, read_brep = (partial(_read, kind) for kind in ("step", "iges", "brep"))
