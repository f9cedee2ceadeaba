"""Surfaces as STEP, IGES and BREP: faces of `bspline_surfaces`, sewn to shells and solids by Open CASCADE.

Its Python package is an extra: ``gtb-cli[cad]``.
"""

import os
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gtb_cli.cad.cad_seams import Seams, measured_seams
from gtb_cli.cad.exact_surfaces import SplineSurface
from gtb_cli.errors import ExportError
from gtb_cli.files import begin
from gtb_cli.importers.cad_files import MISSING, kernel, kernel_scale, parts, scaled, shape_in, silence

KERNEL_PRECISION = 1e-7  # length, in units of the file, below which the kernel does not distinguish points
KERNEL_UNITS = {"mm": "MM", "cm": "CM", "m": "M", "in": "INCH", "ft": "FT"}  # the kernel's names


def encode_cad(
    surfaces: Sequence[SplineSurface], kind: str, unit: str, name: str, part: Any = None, *, curved: bool = False
) -> tuple[bytes, int, int, Seams | None]:
    """Sew surfaces along edges that agree, and encode them as a CAD file; closed shells become solids.

    Return the file, its numbers of shells outside solids and of solids, and, of a filled part, how its seams fit.

    With a part, a shape of the kernel, the surfaces are sewn to its faces; `curved` seams have measured curvatures.

    The file states the name of the whole and the unit of coordinates (BREP files have none). An `ExportError` says that
    the extra is missing, or that the kernel finds the result invalid or cannot write it.
    """
    what = kind.upper()
    try:
        kernel("collections")
        silence()
    except ModuleNotFoundError:
        raise ExportError(f"{what} {MISSING}") from None
    size = float(np.ptp(np.concatenate([surface.net[..., :3].reshape(-1, 3) for surface in surfaces]), axis=0).max())
    if size < 1e3 * KERNEL_PRECISION:
        raise ExportError(f"{what}: a size of {size:.3g} is too small for a kernel that works to {KERNEL_PRECISION:g}")
    scale = kernel_scale(size)
    nets = [surface._replace(net=surface.net / [scale, scale, scale, 1]) for surface in surfaces]
    body = part if part is None or scale == 1 else scaled(part, 1 / scale).Shape()
    for within in (1e-6, 2e-5):  # of the size: edges of neighbours agree to rounding, those of a part's splines to 1e-5
        shape, faces, shells, solids = _sewn(nets, within * size / scale, body)
        if part is None or not shells:
            break
    if scale != 1:
        back = scaled(shape, scale)
        shape, faces = back.Shape(), [(back.ModifiedShape(face), face_name) for face, face_name in faces]
    times = {  # of writing, without which the same surfaces give the same bytes
        "step": (rb"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d'", b"'1970-01-01T00:00:00'"),
        "iges": (rb"15H\d{8}\.\d{6}", b"15H19700101.000000"),
    }
    with tempfile.TemporaryDirectory(prefix=".gtb-") as folder:
        path = os.path.join(folder, f"x.{kind}")
        begin(folder)
        begin(path)
        if not _WRITERS[kind](shape, faces, path, KERNEL_UNITS[unit], name):
            raise ExportError(f"{what}: the kernel cannot write it")
        data = Path(path).read_bytes()
        # Readers may find edges elsewhere in faces than the kernel has them
        found = shape if part is None else shape_in(kind, path)
    written, read = ([*parts(each, "FACE")] for each in (shape, found))
    if len(read) != len(written) or not kernel("BRepCheck").BRepCheck_Analyzer(found).IsValid():
        raise ExportError(f"{what}: the kernel calls the sewn surfaces invalid: do they fold or cross themselves?")
    new = dict(zip(map(hash, written), read, strict=True))
    seams = None if part is None else measured_seams(found, [new[hash(face)] for face, _ in faces], curved=curved)
    return re.sub(*times[kind], data) if kind in times else data, shells, solids, seams


def _sewn(surfaces: Sequence[SplineSurface], within: float, part: Any) -> tuple[Any, list[tuple[Any, str]], int, int]:
    """Return a compound of solids and shells, its faces with their names, and the numbers of shells and solids."""
    builder, topology = kernel("BRepBuilderAPI"), kernel("TopoDS")
    sewing = builder.BRepBuilderAPI_Sewing(within)
    given = [builder.BRepBuilderAPI_MakeFace(_surface(one), KERNEL_PRECISION).Face() for one in surfaces]
    for face in [*([] if part is None else parts(part, "FACE")), *given]:
        sewing.Add(face)
    sewing.Perform()
    named = [(sewing.ModifiedSubShape(face), one.name) for face, one in zip(given, surfaces, strict=True)]
    sewn, compound, pile = sewing.SewedShape(), topology.TopoDS_Compound(), kernel("BRep").BRep_Builder()
    shells = [(shell, bool(kernel("BRep").BRep_Tool.IsClosed_s(shell))) for shell in parts(sewn, "SHELL")]
    for face in parts(sewn, "FACE", "SHELL"):  # without neighbours
        shells.append((topology.TopoDS_Shell(), False))
        pile.MakeShell(shells[-1][0])
        pile.Add(shells[-1][0], face)
    pile.MakeCompound(compound)
    for shell, is_closed in shells:
        body = builder.BRepBuilderAPI_MakeSolid(shell).Solid() if is_closed else shell
        if is_closed:
            kernel("BRepLib").BRepLib.OrientClosedSolid_s(body)  # its faces outwards
        pile.Add(compound, body)
    solids = sum(is_closed for _, is_closed in shells)
    return compound, named, len(shells) - solids, solids


def _surface(surface: SplineSurface) -> Any:
    """Return the kernel's surface; polynomial where all weights are equal."""
    collections, point = kernel("collections"), kernel("gp").gp_Pnt
    m, n = surface.net.shape[:2]
    poles = collections.Array2_gp_Pnt(1, m, 1, n)
    weights = collections.Array2_double(1, m, 1, n)
    for i, j in np.ndindex(m, n):
        x, y, z, w = surface.net[i, j].tolist()
        poles.SetValue(i + 1, j + 1, point(x, y, z))
        weights.SetValue(i + 1, j + 1, w)
    given = (poles,) if (surface.net[..., 3] == surface.net[0, 0, 3]).all() else (poles, weights)
    if m == surface.degrees[0] + 1 and n == surface.degrees[1] + 1:
        return kernel("Geom").Geom_BezierSurface(*given)
    tables = [np.unique(knots, return_counts=True) for knots in surface.knots]
    rows = [_filled(collections.Array1_double, places.tolist()) for places, _ in tables]
    multiplicities = [_filled(collections.Array1_int, counts.tolist()) for _, counts in tables]
    return kernel("Geom").Geom_BSplineSurface(*given, *rows, *multiplicities, *surface.degrees, False, False)


def _filled(kind: Any, values: list[float]) -> Any:
    array = kind(1, len(values))
    for place, value in enumerate(values, 1):
        array.SetValue(place, value)
    return array


def _write_step(shape: Any, faces: list[tuple[Any, str]], path: str, unit: str, name: str) -> bool:
    text = kernel("TCollection").TCollection_ExtendedString
    document = kernel("TDocStd").TDocStd_Document(text("XmlXCAF"))
    tool = kernel("XCAFDoc").XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    label = tool.AddShape(shape, False)
    naming = kernel("TDataStd").TDataStd_Name
    naming.Set_s(label, text(name))
    for face, face_name in faces:
        part = tool.AddSubShape(label, face)
        if not part.IsNull():
            naming.Set_s(part, text(face_name))
    writer = kernel("STEPCAFControl").STEPCAFControl_Writer()
    statics = kernel("Interface").Interface_Static
    statics.SetIVal_s("write.stepcaf.subshapes.name", 1)
    statics.SetIVal_s("write.surfacecurve.mode", 0)  # no edges in parameters of faces, which readers find to 1e-7
    statics.SetCVal_s("xstep.cascade.unit", unit)
    statics.SetCVal_s("write.step.unit", unit)
    kinds = kernel("STEPControl").STEPControl_StepModelType
    return writer.Transfer(document, kinds.STEPControl_AsIs) and int(writer.Write(path).value) == 1


def _write_iges(shape: Any, faces: list[tuple[Any, str]], path: str, unit: str, name: str) -> bool:
    room = kernel("IGESControl")
    room.IGESControl_Controller.Init_s()
    kernel("Interface").Interface_Static.SetCVal_s("xstep.cascade.unit", unit)
    writer = room.IGESControl_Writer(unit, 1)
    if not writer.AddShape(shape):
        return False
    writer.ComputeModel()
    header = writer.Model().GlobalSection()
    header.SetAuthorName(kernel("TCollection").TCollection_HAsciiString("gtb"))  # by default, the user's name
    writer.Model().SetGlobalSection(header)
    return bool(writer.Write(path))


def _write_brep(shape: Any, faces: list[tuple[Any, str]], path: str, unit: str, name: str) -> bool:
    return bool(kernel("BRepTools").BRepTools.Write_s(shape, path))


_WRITERS = {"step": _write_step, "iges": _write_iges, "brep": _write_brep}
