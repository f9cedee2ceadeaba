"""STEP, IGES and BREP files, read by Open CASCADE: faces, free edges, and both as exact rational Bézier patches.

Its Python package is an extra: ``gtb-cli[cad]``. Lengths of STEP and IGES files become millimetres.
"""

import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.files import begin
from gtb_cli.importers.classical_nets import curve, rectangle
from gtb_cli.language.document import kind_of
from gtb_cli.language.patch_reader import MAX_PATCHES
from gtb_cli.theory.patch import Patch
from gtb_cli.values import grouped
from gtb_cli.vocabulary import CAD_FORMATS, CAD_SUFFIXES, printable, suffix_of

MISSING = "needs Open CASCADE, the extra gtb-cli[cad]: pip install cadquery-ocp-novtk"
SHAPELESS = 3  # exit status of a process that finds no shape in a file


def kernel(room: str) -> Any:
    """Import a module of Open CASCADE."""
    return import_module(f"OCP.{room}")


def read_shape(data: bytes, kind: str, source: str) -> Any:
    """Read a file of a kind, step, iges or brep, as a shape of Open CASCADE.

    Raises `SpecError`: the extra is missing, the kernel finds no shape, or faces have triangles only.
    """
    try:
        silence()
    except ModuleNotFoundError:
        raise SpecError(f"{source}: {kind.upper()} {MISSING}") from None
    ends = {"brep": rb"\*\s+[-+ie]\d+ \d+\s*\Z", "iges": rb"T[ 0]*1\s*\Z"}
    is_begun = b"TShapes" in data or data[72:73] == b"S"  # where the kernel may wait without end, or keep what there is
    if is_begun and kind in ends and not re.search(ends[kind], data[-99:]):
        raise SpecError(f"{source}: ends early, before the last line of {kind.upper()}")
    if kind == "brep" and re.search(rb"(?i)\s[-+]?(nan|inf|\d\.#)", data):  # the kernel reads other numbers instead
        raise SpecError(f"{source}: has numbers that are not finite")
    with tempfile.TemporaryDirectory(prefix=".gtb-") as folder:
        path = os.path.join(folder, f"x.{kind}")
        begin(folder)
        begin(path)
        Path(path).write_bytes(data)
        code = "import sys; from gtb_cli.importers.cad_files import probe; sys.exit(probe(*sys.argv[1:]))"
        probed = subprocess.run([sys.executable, "-c", code, kind, path], capture_output=True, check=False)
        if probed.returncode < 0:
            raise SpecError(f"{source}: Open CASCADE breaks down when it reads this file")
        if probed.returncode == SHAPELESS:
            said = re.sub(r"\x1b\[[\d;]*m|\*|ERR \w+ : (Undefined )?", "", probed.stdout.decode("utf-8", "replace"))
            words = "".join(f" ({printable(line.strip())})" for line in said.strip().splitlines()[:1])
            raise SpecError(f"{source}: Open CASCADE finds no shape in it{words}: is it {kind.upper()}?")
        shape = shape_in(kind, path)
    if any(kernel("BRep").BRep_Tool.Surface_s(face) is None for face in parts(shape, "FACE")):
        raise SpecError(f"{source}: has faces that are triangles without a surface: a mesh is STL, OBJ or PLY")
    return shape


@contextmanager
def kernel_faults(source: str = "") -> Iterator[None]:
    """Turn exceptions of the kernel into errors with its words: a `SpecError` of a source, or a `DomainError`."""
    try:
        yield
    except Exception as error:
        if type(error).__module__.partition(".")[0] != "OCP":  # in some versions, they have no class in common
            raise
        words = f"Open CASCADE: {str(error).strip() or type(error).__name__}"
        raise SpecError(f"{source}: {words}") if source else DomainError(words) from None


def cad_kind(data: bytes, path: str) -> str | None:
    """Return the kind of a CAD file, by its content or else its name: step, iges or brep; None for others."""
    kind = (kind_of(data) or "").removesuffix(" file").rpartition(" ")[2].lower()
    return kind if kind in CAD_FORMATS else CAD_SUFFIXES.get(suffix_of(path))


def silence() -> None:
    """Keep the kernel from writing to standard output, which is for data."""
    messenger = kernel("Message").Message.DefaultMessenger_s()
    for printer in list(messenger.Printers()):
        messenger.RemovePrinter(printer)


def shape_in(kind: str, path: str) -> Any:
    """Return the kernel's shape of a file, or None; lengths of STEP and IGES become millimetres."""
    if kind == "brep":
        shape = kernel("TopoDS").TopoDS_Shape()
        return shape if kernel("BRepTools").BRepTools.Read_s(shape, path, kernel("BRep").BRep_Builder()) else None
    name = f"{kind.upper()}Control"
    reader = getattr(kernel(name), f"{name}_Reader")()
    kernel("Interface").Interface_Static.SetCVal_s("xstep.cascade.unit", "MM")  # what was written may have had another
    if reader.ReadFile(path) != kernel("IFSelect").IFSelect_ReturnStatus.IFSelect_RetDone:
        return None
    reader.TransferRoots()
    return reader.OneShape() if reader.NbShapes() else None


def probe(kind: str, path: str) -> int:
    """Read a file as a process of its own, which a broken file may end; the kernel prints what it finds wrong."""
    shape = shape_in(kind, path)
    if shape is None or shape.IsNull():
        return SHAPELESS
    for face in parts(shape, "FACE"):
        face_pieces(face)
    for edge in parts(shape, "EDGE"):
        edge_pieces(edge, 1)
    return 0


def parts(shape: Any, kind: str, avoid: str = "SHAPE") -> Iterator[Any]:
    """Yield the FACE, EDGE or other parts of a shape that are not in parts to avoid."""
    kinds = kernel("TopAbs").TopAbs_ShapeEnum
    explorer = kernel("TopExp").TopExp_Explorer(shape, *(getattr(kinds, f"TopAbs_{name}") for name in (kind, avoid)))
    cast = getattr(kernel("TopoDS").TopoDS, kind.capitalize())
    while explorer.More():
        yield cast(explorer.Current())
        explorer.Next()


def box_of(shape: Any, *, rough: bool = False) -> FloatArray:
    """Return the lowest and highest coordinates of a shape, (2, 3), or of its poles; zeros if it is empty."""
    box, tool = kernel("Bnd").Bnd_Box(), kernel("BRepBndLib").BRepBndLib
    tool.Add_s(shape, box, False) if rough else tool.AddOptimal_s(shape, box, False, False)
    box.SetGap(0.0)
    corners = [] if box.IsVoid() else [box.CornerMin(), box.CornerMax()]
    return np.array([(each.X(), each.Y(), each.Z()) for each in corners] or np.zeros((2, 3)))


def kernel_scale(size: float) -> float:
    """Return what sizes are divided by for the kernel, whose precision is absolute: 1 where it is good enough."""
    return 1.0 if 0.1 <= size <= 1e5 else size


def scaled(shape: Any, scale: float) -> Any:
    """Return the kernel's transformation of a shape to a copy that is larger by a scale."""
    transform = kernel("gp").gp_Trsf()
    transform.SetScaleFactor(scale)
    return kernel("BRepBuilderAPI").BRepBuilderAPI_Transform(shape, transform, True)


def moved(origin: FloatArray, *shapes: Any) -> list[Any]:
    """Return shapes as seen from an origin, near which points and derivatives keep their digits."""
    move = kernel("gp").gp_Trsf()
    move.SetTranslation(kernel("gp").gp_Vec(*(-origin).tolist()))
    location = kernel("TopLoc").TopLoc_Location(move)  # one for all: another one, though equal, parts edges from faces
    return [shape.Moved(location) for shape in shapes]


def extent_of(shape: Any, what: str) -> float:
    """Return the area (``Surface``) or the volume (``Volume``) of a shape, or of all its faces, to nine digits."""
    measured = kernel("GProp").GProp_GProps()
    getattr(kernel("BRepGProp").BRepGProp, f"{what}Properties_s")(shape, measured, 1e-9)
    return float(measured.Mass())


def edge_uses(shape: Any) -> dict[int, list[tuple[Any, Any]]]:
    """Return the edges of a shape, by their numbers, each with its faces."""
    return grouped((hash(edge), (edge, face)) for face in parts(shape, "FACE") for edge in parts(face, "EDGE"))


def edge_pieces(edge: Any, count: int) -> list[list[FloatArray]]:
    """Return parts of equal lengths of an edge, each as Bézier curves, along the edge's own curve.

    Each curve has (m + 1, 4) homogeneous points (x w, y w, z w, w). An edge that is a point, as a pole is, has none.
    """
    if kernel("BRep").BRep_Tool.Degenerated_s(edge):
        return []
    convert, adaptor = kernel("GeomConvert"), kernel("BRepAdaptor").BRepAdaptor_Curve(edge)
    whole = kernel("BRep").BRep_Tool.Curve_s(edge, adaptor.FirstParameter(), adaptor.LastParameter())
    ends, found = (adaptor.FirstParameter(), adaptor.LastParameter()), []
    even = kernel("GCPnts").GCPnts_UniformAbscissa(adaptor, count + 1, *ends)
    for first, last in pairwise([ends[0], *(even.Parameter(k) for k in range(2, count + 1)), ends[1]]):
        trimmed = kernel("Geom").Geom_TrimmedCurve(whole, first, last)
        pieces = convert.GeomConvert_BSplineCurveToBezierCurve(convert.GeomConvert.CurveToBSplineCurve_s(trimmed))
        arcs = [pieces.Arc(k) for k in range(1, pieces.NbArcs() + 1)]
        found.append([_net(arc.Pole, arc.Weight, (arc.NbPoles(),)) for arc in arcs])
    return found


def face_frames(face: Any, places: Iterable[Sequence[float]]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return points of a face at n places, both derivatives, and outward unit normals, NaN without one: (n, 3)."""
    surface, gp, rows = kernel("BRep").BRep_Tool.Surface_s(face), kernel("gp"), []
    for u, v in places:
        vectors = gp.gp_Pnt(), gp.gp_Vec(), gp.gp_Vec()
        surface.D1(u, v, *vectors)
        rows.append([(each.X(), each.Y(), each.Z()) for each in vectors])
    points, along, across = np.array(rows).swapaxes(0, 1)
    turned = face.Orientation() == kernel("TopAbs").TopAbs_Orientation.TopAbs_REVERSED
    normals = np.cross(across, along) if turned else np.cross(along, across)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    has_normal = lengths > 1e-9 * lengths.max()  # beyond what is rounding at a pole
    return points, along, across, np.where(has_normal, normals / np.where(has_normal, lengths, 1.0), np.nan)


def nearest_normals(face: Any, start: FloatArray, points: FloatArray, size: float) -> FloatArray:
    """Return outward unit normals of a face at the places nearest to points, which are from a start; (n, 3)."""
    gp, project, scale = kernel("gp"), kernel("GeomAPI").GeomAPI_ProjectPointOnSurf, kernel_scale(size)
    near = kernel("TopoDS").TopoDS.Face(*moved(start / scale, face if scale == 1 else scaled(face, 1 / scale).Shape()))
    surface = kernel("BRep").BRep_Tool.Surface_s(near)
    places = [project(gp.gp_Pnt(*each), surface).LowerDistanceParameters() for each in (points / scale).tolist()]
    return face_frames(near, places)[3]


def face_forms(face: Any, places: Sequence[Sequence[float]]) -> FloatArray:
    """Return second fundamental forms of a face at n places, (n, 3, 3): of v, times the outward normal, it is v · F v.

    They are NaN where the face has no normal, or the kernel no second derivatives.
    """
    surface, gp, rows = kernel("BRep").BRep_Tool.Surface_s(face), kernel("gp"), []
    _, along, across, normals = face_frames(face, places)
    for u, v in places:
        vectors = gp.gp_Pnt(), *(gp.gp_Vec(*(math.nan,) * 3) for _ in range(5))
        with suppress(DomainError), kernel_faults():
            surface.D2(u, v, *vectors)
        rows.append([(each.X(), each.Y(), each.Z()) for each in vectors[3:]])
    known = np.isfinite(normals).all(axis=1)
    parts_of = np.full((len(normals), 3, 2), math.nan)  # of vectors, along both derivatives
    parts_of[known] = np.linalg.pinv(np.stack([along, across], axis=1)[known])
    first, second, mixed = (np.array(rows) * normals[:, None]).sum(axis=2).T
    forms = np.array([[first, mixed], [mixed, second]]).transpose(2, 0, 1)
    return np.asarray(parts_of @ forms @ parts_of.swapaxes(1, 2))


def face_pieces(face: Any) -> list[FloatArray] | None:
    """Return a face as Bézier rectangles, (m + 1, n + 1, 4) homogeneous points, or None if it is trimmed.

    It is not where its area is that of its surface between its bounds. Rectangles have the orientation of the face.
    """
    surface = kernel("BRep").BRep_Tool.Surface_s(face)
    bounds, most = list(kernel("BRepTools").BRepTools.UVBounds_s(face)), surface.Bounds()
    for first, is_periodic in ((0, surface.IsUPeriodic()), (2, surface.IsVPeriodic())):
        start, end = most[first : first + 2]  # by rounding, the bounds of a file may be beyond, or more than a period
        bounds[first] = bounds[first] if is_periodic else max(bounds[first], start)
        bounds[first + 1] = min(bounds[first + 1], bounds[first] + end - start if is_periodic else end)
    whole = kernel("BRepBuilderAPI").BRepBuilderAPI_MakeFace(surface, *bounds, 1e-9)
    if not whole.IsDone():
        return None
    area, untrimmed = (abs(extent_of(one, "Surface")) for one in (face, whole.Face()))
    if abs(area - untrimmed) > 1e-7 * untrimmed:  # the kernel's precision
        return None
    convert, part = kernel("GeomConvert"), kernel("Geom").Geom_RectangularTrimmedSurface(surface, *bounds)
    pieces = convert.GeomConvert_BSplineSurfaceToBezierSurface(convert.GeomConvert.SurfaceToBSplineSurface_s(part))
    u, v = (range(1, count + 1) for count in (pieces.NbUPatches(), pieces.NbVPatches()))
    patches = [pieces.Patch(i, j) for i in u for j in v]
    nets = [_net(patch.Pole, patch.Weight, (patch.NbUPoles(), patch.NbVPoles())) for patch in patches]
    turned = face.Orientation() == kernel("TopAbs").TopAbs_Orientation.TopAbs_REVERSED
    return [net.swapaxes(0, 1) if turned else net for net in nets]


def _net(pole: Callable[..., Any], weight: Callable[..., float], shape: tuple[int, ...]) -> FloatArray:
    net = np.ones((*shape, 4))
    for index in np.ndindex(shape):
        place = [k + 1 for k in index]
        point, w = pole(*place), weight(*place)
        net[index] = point.X() * w, point.Y() * w, point.Z() * w, w
    return net


def _read(kind: str, data: bytes, source: str) -> tuple[list[Patch], list[str]]:
    """Return the untrimmed faces of a file, and the edges of no face, as patches; remarks name the others."""
    patches, trimmed = list[Patch](), 0
    with kernel_faults(source):
        shape = read_shape(data, kind, source)
        for number, face in enumerate(parts(shape, "FACE")):
            nets = face_pieces(face)
            trimmed += nets is None
            patches += _patches(nets or [], f"face-{number}")
        for number, edge in enumerate(parts(shape, "EDGE", "FACE")):
            patches += _patches([piece for pieces in edge_pieces(edge, 1) for piece in pieces], f"edge-{number}")
    if len(patches) > MAX_PATCHES:
        raise SpecError(f"{source}: has {len(patches)} spans, a model has at most {MAX_PATCHES} patches")
    remarks = [f"{trimmed} trimmed faces are left out, as patches have no trimming"] if trimmed else []
    return patches, remarks + ["lengths are millimetres"] * (kind != "brep")


def _patches(nets: list[FloatArray], name: str) -> Iterator[Patch]:
    for k, net in enumerate(nets):
        points, weights = net[..., :3] / net[..., 3:], net[..., 3] / net.flat[3]
        patch = rectangle(points, weights) if net.ndim == 3 else curve(points, weights)
        yield patch.replace(name=name if len(nets) == 1 else f"{name}-{k}")


read_step, read_iges, read_brep = (partial(_read, kind) for kind in ("step", "iges", "brep"))
