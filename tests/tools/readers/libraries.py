"""Readers that are Python libraries. `python libraries.py NAME FOLDER FILE...` puts what NAME reads there, as JSON.

This file knows nothing of this project: it runs where the library is installed, and numpy comes with each of them.
"""

import importlib.metadata
import itertools
import json
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

Found = dict[str, Any]  # what a reader found, for `kinds.agreement`


# Parameters at which curved cells are evaluated, three of them a triangle; of curves the first ones, two a segment
SAMPLES = [(0.1, 0.2), (0.7, 0.1), (0.3, 0.6), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]


def joined(parts: Iterable[Found]) -> Found:
    """Make one mesh of several; `points`, `normals` and `uv` may be flat."""
    found: Found = {"points": [], "cells": [], "names": [], "attributes": {}}
    for part in parts:
        start = len(found["points"])
        found["points"] += np.asarray(part["points"], dtype=float).reshape(-1, 3).tolist()
        found["cells"] += [[start + int(corner) for corner in cell] for cell in part["cells"]]
        found["names"].append(part.get("name"))
        found["attributes"] |= {name: np.ravel(v).tolist() for name, v in part.get("attributes", {}).items()}
        for key, width in (("normals", 3), ("uv", 2)):
            if part.get(key) is not None:
                found.setdefault(key, []).extend(np.asarray(part[key], dtype=float).reshape(-1, width).tolist())
    return found


def segments(line: Sequence[int]) -> list[tuple[int, int]]:
    """Cut a polyline."""
    return list(itertools.pairwise(line))


def read_trimesh(path: str) -> Found:
    import trimesh

    parts = []
    for name, geometry in trimesh.load_scene(path, process=False).geometry.items():
        part = {"name": name, "points": geometry.vertices, "cells": getattr(geometry, "faces", [])}
        if hasattr(geometry, "entities"):
            part["cells"] = [pair for entity in geometry.entities for pair in segments(entity.points)]
        elif len(part["cells"]):
            part["uv"] = getattr(geometry.visual, "uv", None)
            if "vertex_normals" in geometry._cache.cache:  # not computed, but read
                part["normals"] = geometry.vertex_normals
            part["attributes"] = geometry.vertex_attributes
        parts.append(part)
    return joined(parts)


def read_meshio(path: str) -> Found:
    import meshio

    mesh = meshio.read(path)
    data = mesh.point_data
    part = {"points": mesh.points, "cells": [row for block in mesh.cells for row in block.data], "attributes": data}
    if "nx" in data:
        part["normals"] = np.column_stack([data[name] for name in ("nx", "ny", "nz")])
    if "s" in data:
        part["uv"] = np.column_stack([data["s"], data["t"]])
    if "obj:vn" in data:
        part["normals"] = data["obj:vn"]
    if "obj:vt" in data:
        part["uv"] = data["obj:vt"]
    return joined([part])


def read_plyfile(path: str) -> Found:
    import plyfile

    data = plyfile.PlyData.read(path)
    columns = {p.name: np.asarray(data["vertex"][p.name], dtype=float) for p in data["vertex"].properties}
    if "face" in data:
        cells = np.vstack(data["face"]["vertex_indices"])
    else:
        cells = np.column_stack([data["edge"]["vertex1"], data["edge"]["vertex2"]])
    part: Found = {"points": np.column_stack([columns[axis] for axis in "xyz"]), "cells": cells, "attributes": columns}
    if "nx" in columns:
        part["normals"] = np.column_stack([columns[name] for name in ("nx", "ny", "nz")])
    if "s" in columns:
        part["uv"] = np.column_stack([columns["s"], columns["t"]])
    return joined([part])


def read_numpy_stl(path: str) -> Found:
    import stl

    corners = stl.Mesh.from_file(path).vectors.reshape(-1, 3)
    return joined([{"points": corners, "cells": np.arange(len(corners)).reshape(-1, 3)}])


def read_pymeshlab(path: str) -> Found:
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(path)
    parts = []
    for mesh in meshes:
        part = {"name": mesh.label(), "points": mesh.vertex_matrix(), "normals": mesh.vertex_normal_matrix()}
        part["cells"] = mesh.face_matrix() if mesh.face_number() else mesh.edge_matrix()
        if mesh.has_vertex_tex_coord():
            part["uv"] = mesh.vertex_tex_coord_matrix()
        part["attributes"] = {"quality": mesh.vertex_scalar_array()} if mesh.has_vertex_scalar() else {}
        parts.append(part)
    return joined(parts)


def read_vtk(path: str) -> Found:
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    if path.endswith("vtu"):
        return vtk_cells(path)
    readers = {"obj": vtk.vtkOBJReader, "ply": vtk.vtkPLYReader, "stl": vtk.vtkSTLReader, "glb": vtk.vtkGLTFReader}
    reader = readers[path[-3:]]()
    reader.SetFileName(path)
    reader.Update()
    output = reader.GetOutputDataObject(0)
    meshes = [output]
    if output.IsA("vtkCompositeDataSet"):
        meshes = []
        iterator = output.NewIterator()
        while not iterator.IsDoneWithTraversal():
            meshes.append(iterator.GetCurrentDataObject())
            iterator.GoToNextItem()
    parts = []
    for mesh in meshes:
        part: Found = {"points": vtk_to_numpy(mesh.GetPoints().GetData()), "cells": []}
        for number in range(mesh.GetNumberOfCells()):
            ids = mesh.GetCell(number).GetPointIds()
            corners = [ids.GetId(corner) for corner in range(ids.GetNumberOfIds())]
            lines = mesh.GetCell(number).GetCellDimension() == 1
            part["cells"] += segments(corners) if lines else [corners]
        data = mesh.GetPointData()
        arrays = {data.GetArrayName(number): data.GetArray(number) for number in range(data.GetNumberOfArrays())}
        part["attributes"] = {name: vtk_to_numpy(values) for name, values in arrays.items()}
        for key, values in (("normals", data.GetNormals()), ("uv", data.GetTCoords())):
            part[key] = None if values is None else vtk_to_numpy(values)
        if part["uv"] is not None and path.endswith("glb"):  # as they are in the file, downwards
            part["uv"] = part["uv"] * [1, -1] + [0, 1]
        parts.append(part)
    return joined(parts)


def vtk_cells(path: str) -> Found:
    """Curved cells where VTK has their points."""
    import vtk

    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutput()
    points, width = [], 3
    for number in range(grid.GetNumberOfCells()):
        cell = grid.GetCell(number)
        width = cell.GetCellDimension() + 1
        for sample in SAMPLES:
            place = [0.0, 0.0, 0.0]
            cell.EvaluateLocation(vtk.reference(0), [*sample, 0.0], place, [0.0] * cell.GetNumberOfPoints())
            points.append(place)
    return joined([{"points": points, "cells": np.arange(len(points)).reshape(-1, width)}])


def read_open3d(path: str) -> Found:
    import open3d

    if "curve" in path:  # for lines it has another function
        lines = open3d.io.read_line_set(path)
        return joined([{"points": lines.points, "cells": lines.lines}])
    mesh = open3d.io.read_triangle_mesh(path)
    normals = mesh.vertex_normals if mesh.has_vertex_normals() else None
    return joined([{"points": mesh.vertices, "cells": mesh.triangles, "normals": normals}])


def read_bpy(path: str) -> Found:
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.endswith("obj"):
        bpy.ops.wm.obj_import(filepath=path, forward_axis="Y", up_axis="Z", use_split_groups=True)
    elif path.endswith("ply"):
        bpy.ops.wm.ply_import(filepath=path)
    elif path.endswith("stl"):
        bpy.ops.wm.stl_import(filepath=path)
    else:
        bpy.ops.import_scene.gltf(filepath=path)
    # Blender's z points upwards, and so glTF's y becomes its z.
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]) if path.endswith("glb") else np.eye(3)
    parts = []
    for item in bpy.data.objects:
        mesh = item.data
        points = np.array([item.matrix_world @ vertex.co for vertex in mesh.vertices])
        cells = [face.vertices for face in mesh.polygons] or [edge.vertices for edge in mesh.edges]
        part: Found = {"name": item.name, "points": points @ turn, "cells": cells, "attributes": {}}
        corners = [loop.vertex_index for loop in mesh.loops]
        if mesh.has_custom_normals:
            part["normals"] = np.zeros((len(points), 3))
            part["normals"][corners] = np.array([normal.vector for normal in mesh.corner_normals]) @ turn
        if mesh.uv_layers:
            part["uv"] = np.zeros((len(points), 2))
            part["uv"][corners] = [uv.vector for uv in mesh.uv_layers[0].uv]
        for attribute in mesh.attributes:
            if attribute.domain == "POINT" and attribute.data_type == "FLOAT":
                part["attributes"][attribute.name] = [entry.value for entry in attribute.data]
        parts.append(part)
    return joined(parts)


def results(read: Callable[[str], Found], version: str, folder: str, paths: Sequence[str]) -> None:
    """Read each file, and put what is found, or why nothing is, into a file of the same name with `.json`."""
    for path in paths:
        try:
            found = read(path)
        except (Exception, SystemExit) as error:  # noqa: BLE001 (whatever the reader raises is what we ask for)
            found = {"error": f"{type(error).__name__}: {error}"}
        target = os.path.join(folder, os.path.basename(path) + ".json")
        with open(target + ".part", "w", encoding="utf-8") as file:
            json.dump(found | {"version": version}, file)
        os.replace(target + ".part", target)


if __name__ == "__main__":
    name, package, folder, *paths = sys.argv[1:]
    results(globals()[f"read_{name}"], importlib.metadata.version(package), folder, paths)
