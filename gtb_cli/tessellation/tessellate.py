"""Patches and models to meshes: uniform (cells: `even_triangulation`), or within a tolerance (`refinement`)."""

import math
import os
from collections.abc import Iterable
from contextlib import suppress
from functools import partial
from typing import TypeAlias

from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.knots.even_triangulation import cell_count
from gtb_cli.language.spec_paths import SpecPath, loaded
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model, joints_of
from gtb_cli.tessellation.complexes import coarse_complexes, joined_complex
from gtb_cli.tessellation.finishing import finished
from gtb_cli.tessellation.sampler import Sampler, torically, torically_inside
from gtb_cli.tessellation.welding import Weld
from gtb_cli.theory.patch import Patch
from gtb_cli.theory.rational_basis import LinearParametrization
from gtb_cli.vocabulary import MAX_FACES, RESOLUTION, Parametrization, check_fineness, percentage

Shape: TypeAlias = Patch | Model | Iterable[Patch] | SpecPath


def shape_of(shape: Shape) -> Patch | Model:
    """Return a patch or model as it is, load the file of a spec, and make a model of several patches."""
    found: Patch | Model | list[Patch] | tuple[Patch, ...] = loaded(shape, Patch, Model, list, tuple)
    return Model(tuple(found)) if isinstance(found, list | tuple) else found


def tessellate(
    shape: Shape,
    resolution: int | None = None,
    tolerance: float | str | None = None,
    parametrization: Parametrization = "linear",
    *,
    normals: bool = True,
    max_faces: int = MAX_FACES,
    rounding: float = 0.0,
) -> Mesh:
    """Mesh a patch or a model, as ``gtb mesh`` does. `Recipe` has tubes, solids and attributes, too.

    Parameters
    ----------
    shape : Patch, Model, list or tuple of Patch, or path of a spec
    resolution : int, optional
        Segments along each edge of the domain, default 32; not together with a tolerance.
    tolerance : float or str, optional
        Largest distance from the surface to the mesh, in model units, or as ``"1%"`` of the bounding box's diagonal;
        certain for a curve, sampled for a surface.
    parametrization : {"linear", "toric"}
        Where vertices are put: evenly (linear), or at the paper's parameters, which crowd where edge functions have
        large exponents. With a tolerance always linear.
    normals : bool
        Whether a surface's mesh gets its unit normals, which take longer than its points.
    max_faces : int
        More faces than this are refused before they are made.
    rounding : float
        How far vertices may move afterwards: the tolerance then holds for the moved ones.

    Returns
    -------
    Mesh
        With parameters, and unit normals if asked for. Edges that patches of a model share are sampled once, by the
        curve's own data, and their vertices are one.

    Raises
    ------
    DomainError
        Something else than a shape, a number that makes no sense, or a resolution together with a tolerance.
    ToleranceError
        Too many faces would be needed.
    SpecError
        The spec cannot be read.
    """
    shape = shape_of(shape)
    if resolution is not None and tolerance is not None:
        raise DomainError("resolution: excludes a tolerance, give one of them")
    resolution = RESOLUTION if resolution is None else resolution
    check_fineness(resolution, tolerance, parametrization)
    patches, joints = shape.patches, joints_of(shape)
    weld = Weld(shape, joints)
    if tolerance is None:
        refuse_faces(sum(cell_count(patch.domain, resolution) for patch in patches), resolution, max_faces)
        mosaic = joined_complex(patches, joints, resolution)
        # Patches that share two edges are cut around their centres, into more cells than others.
        refuse_faces(len(mosaic.cells), resolution, max_faces)
        toric = torically_inside if isinstance(shape, Model) else torically
        evenly = partial(LinearParametrization.locations, resolution=resolution)  # all together: sooner
        sampler = Sampler(patches, toric if parametrization == "toric" else evenly)
        points = sampler.points(mosaic.patch, mosaic.parameters, mosaic.face)
    else:
        from gtb_cli.tessellation.refinement import refine

        largest = percentage_of_size(shape, tolerance) if isinstance(tolerance, str) else float(tolerance)
        if weld.farthest > largest:
            far = f"welding moves vertices by up to {weld.farthest:.3g}"
            raise ToleranceError(f"{far}, more than the tolerance {largest:g}")
        sampler = Sampler(patches)
        for start in coarse_complexes(patches, joints):
            mosaic, points = refine(start, sampler, largest - rounding, max_faces)
            if mosaic.is_whole:
                break
    return finished(shape, mosaic, weld.moved(mosaic, points), sampler, normals)


def refuse_faces(faces: int, resolution: int, max_faces: int, meshes: int = 1) -> None:
    """Raise `ToleranceError` if uniform meshes have more faces than are allowed, or than the machine's memory holds."""
    estimate = f"`resolution` {resolution} makes {faces} faces" + f" in {meshes} meshes" * (meshes > 1)
    if faces > max_faces:
        ways_out = f"take a smaller `resolution`, or allow them with `max_faces` {faces}"
        raise ToleranceError(f"{estimate}, more than {max_faces}: {ways_out}")
    needed = 100 * faces  # bytes, measured: 1.92 GB for twenty million faces of a model, 0.83 of a patch
    there = math.inf
    with suppress(AttributeError, ValueError, OSError):  # the system may not say
        there = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    if needed > there:
        memory = f"about {needed / 1e9:.0f} GB of memory, this machine has {there / 1e9:.0f}"
        raise ToleranceError(f"{estimate} and needs {memory}: take a smaller `resolution`")


def percentage_of_size(shape: Patch | Model, percent: str) -> float:
    """Return a percentage, such as ``"1%"``, of the diagonal of a shape's bounding box in model units."""
    resolution = 16  # of the mesh whose bounding box is meant
    diagonal = math.dist(*tessellate(shape, resolution, normals=False, max_faces=10**12).bounds)
    if diagonal == 0:
        raise DomainError(f"tolerance: {percent} of the size of a single point is nothing")
    return percentage(percent) / 100 * diagonal
