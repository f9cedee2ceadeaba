"""``.3dm`` files of Rhino: curves, surfaces and the faces of solids, as exact Bézier patches.

The format is read by McNeel's own library, which is an extra of this package.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.design.imports import Found
from gtb_cli.design.nurbs import MAX_CONTROL_POINTS, curve_spans, surface_spans
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.spec.copies import MAX_PATCHES
from gtb_cli.spec.values import name_fault
from gtb_cli.theory.patch import Patch


def read_3dm(data: bytes, source: str) -> Found:
    """Read the curves and surfaces of a ``.3dm`` file; faces of solids are whole, not trimmed.

    Raises
    ------
    SpecError
        The extra is missing, or what was found.
    """
    try:
        rhino3dm: Any = import_module("rhino3dm")
    except ImportError:
        raise SpecError(f"{source}: .3dm files need the extra gtb-cli[rhino]: pip install 'gtb-cli[rhino]'") from None
    file = rhino3dm.File3dm.FromByteArray(data)
    if file is None:
        raise SpecError(f"{source}: is not a .3dm file, or is damaged")
    patches: list[Patch] = []
    others = trimmed = 0
    for index, entry in enumerate(file.Objects):
        name = entry.Attributes.Name or None
        name = None if name is None or name_fault(name) else name
        forms, is_trimmed = _forms(rhino3dm, entry.Geometry)
        others += not forms
        trimmed += is_trimmed
        for face, form in enumerate(forms):
            label = name if len(forms) == 1 or name is None else f"{name}-{face}"
            try:
                patches += _surface(form, label) if hasattr(form, "KnotsU") else _curve(form, label)
            except DomainError as error:
                raise SpecError(f"{source}: objects[{index}]: {error}") from None
            if len(patches) > MAX_PATCHES:
                raise SpecError(f"{source}: objects[{index}]: here the model has more than {MAX_PATCHES} patches")
    remarks = [f"its unit of length is {str(file.Settings.ModelUnitSystem).rpartition('.')[2].lower()}"]
    if others:
        remarks.append(f"{others} objects that are neither curves nor surfaces are left out")
    if trimmed:
        remarks.append(f"{trimmed} solids or trimmed surfaces: their faces are given whole, not trimmed")
    return Found(patches, remarks)


def _forms(rhino3dm: Any, geometry: Any) -> tuple[list[Any], bool]:
    """NURBS forms of an object, and whether its faces may be trimmed."""
    if isinstance(geometry, rhino3dm.Extrusion):
        geometry = geometry.ToBrep(False)
    if isinstance(geometry, rhino3dm.Brep):
        count = len(geometry.Faces)
        faces = [geometry.Faces[i].UnderlyingSurface().ToNurbsSurface() for i in range(count)]
        return [face for face in faces if face is not None], True
    if isinstance(geometry, rhino3dm.Surface):
        form = geometry.ToNurbsSurface()
    elif isinstance(geometry, rhino3dm.Curve):
        form = geometry.ToNurbsCurve()
    else:
        form = None
    return ([] if form is None else [form]), False


def _surface(form: Any, name: str | None) -> list[Patch]:
    m, n = form.Points.CountU, form.Points.CountV
    if m * n > MAX_CONTROL_POINTS:
        raise DomainError(f"control points: at most {MAX_CONTROL_POINTS}, got {m} × {n}")
    net = np.array([[_row(form.Points[i, j]) for j in range(n)] for i in range(m)])
    degrees = form.Degree(0), form.Degree(1)
    return surface_spans(degrees, (_knots(form.KnotsU), _knots(form.KnotsV)), net, name)


def _curve(form: Any, name: str | None) -> list[Patch]:
    rows = np.array([_row(form.Points[i]) for i in range(len(form.Points))])
    return curve_spans(form.Degree, _knots(form.Knots), rows, name)


def _row(point: Any) -> list[float]:
    """Homogeneous coordinates: this library keeps them as x w, y w, z w, w."""
    return [point.X, point.Y, point.Z, point.W]


def _knots(knots: Any) -> FloatArray:
    """Knots with the first and the last, which do not matter and which this format leaves out."""
    values = [knots[i] for i in range(len(knots))]
    return np.array([values[0], *values, values[-1]])
