"""Who is asked to read, how each is had, and what each is known not to read."""

from dataclasses import dataclass, field

from tests.tools.readers.kinds import SINGLE, SIX_DIGITS


@dataclass(frozen=True)
class Reader:
    """A program or library that reads mesh files of some formats."""

    name: str
    key: str  # its function is `read_` and this, in `libraries`, `programs` or `node.mjs`
    source: str  # package of PyPI or npm, and what else it needs; or the command of a program
    formats: str
    tolerance: float = SINGLE  # relative error of what it gives
    limits: dict[str, str] = field(default_factory=dict)  # kinds that it does not read, and why: these must fail


NO_LINES = {"OBJ curve": "leaves lines out"}
NO_EDGES = {"PLY curve": "leaves edges out", "PLY curve ascii": "leaves edges out"}
REFUSES_EDGES = {"PLY curve": "refuses edges", "PLY curve ascii": "refuses edges"}
NO_CELLS = dict.fromkeys(("VTU", "VTU triangle", "VTU model", "VTU curve"), "knows no Bézier cells")
NO_GLB_LINES = {"GLB curve": "leaves lines out"}

LIBRARIES = (
    Reader("trimesh", "trimesh", "trimesh scipy", "obj ply stl glb", limits=NO_LINES),
    Reader("meshio", "meshio", "meshio", "obj ply stl vtu", limits=NO_LINES | REFUSES_EDGES | NO_CELLS),
    Reader("plyfile", "plyfile", "plyfile", "ply"),
    Reader("numpy-stl", "numpy_stl", "numpy-stl", "stl"),
    Reader("PyMeshLab", "pymeshlab", "pymeshlab", "obj ply stl glb", limits={"GLB curve": "crashes"}),
    Reader("VTK", "vtk", "vtk", "obj ply stl glb vtu", limits=NO_EDGES),
    Reader("Open3D", "open3d", "open3d", "obj ply stl glb", limits=NO_LINES | NO_GLB_LINES),
    Reader("Blender", "bpy", "bpy", "obj ply stl glb"),
)

PROGRAMS = (
    Reader("Assimp", "assimp", "assimp", "obj ply stl glb", SIX_DIGITS, limits=REFUSES_EDGES),
    Reader(
        "PrusaSlicer",
        "prusa_slicer",
        "prusa-slicer",
        "obj stl",
        SIX_DIGITS,
        limits=NO_LINES | {"STL 2 facets": "refuses so few"},
    ),
)

WEB = (
    Reader("three.js", "three", "three", "obj ply stl glb", limits=NO_EDGES),
    Reader("Khronos validator", "validator", "gltf-validator", "glb"),
)
