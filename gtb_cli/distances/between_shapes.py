"""Distances between patches, models and curves themselves, and not between meshes of them."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from gtb_cli.arrays import EPS
from gtb_cli.distances.search import FarthestSearch
from gtb_cli.distances.strata import surface_of
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.even_triangulation import cell_count
from gtb_cli.meshes.hausdorff import Distance, Farthest
from gtb_cli.models.model import Model, joints_of
from gtb_cli.tessellation.complexes import Complex, joined_complex
from gtb_cli.tessellation.refinement import refine
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.theory.patch import Patch


def shape_distance(a: Patch | Model, b: Patch | Model) -> Distance:
    """Measure how far two surfaces, or curves, are from each other at most, whatever their parameters.

    The distance is found by a search that starts from points all over both, so it is not proved. It is too large if a
    nearest point was missed, as happens between surfaces with hundreds of knots, and too small if the farthest one is
    on a peak between starting points. The bound has room for missed nearest points where any came to light.
    """
    # Fraction of half the size below which surfaces cannot be told apart: with weights of 1e-12 beside 1e12, points of
    # one surface were up to 9e-11 from its other descriptions. Far from the origin, coordinates are rounded as well.
    blur, rounding = 2e-10, 16 * EPS
    rough_cells, least = 512, 4  # in all, and along each edge
    surfaces = []
    for shape in (a, b):
        mosaic = joined_complex(shape.patches, joints_of(shape), cells_along_edges(shape.patches, rough_cells, least))
        surfaces.append(surface_of(shape.patches, layered(mosaic, shape.patches)))
    found, at, errors = FarthestSearch(surfaces, [(0, 1), (1, 0)], 2).farthest()
    ways = [Farthest(float(distance), tuple(point.tolist())) for distance, point in zip(found, at, strict=True)]
    half = max(float(np.ptp(surface.points, axis=0).max()) for surface in surfaces) / 2
    scale = max(float(np.abs(surface.points).max()) for surface in surfaces)
    bound = float((found + errors).max()) + blur * half + rounding * scale
    return Distance(ways[0], ways[1], bound, is_proved=False)


def layered(mosaic: Complex, patches: Sequence[Patch]) -> Complex:
    """Refine a complex where a surface is still far from its mesh, as in thin layers along edges."""
    share, most_cells, samples = 0.02, 5000, 2000  # of the size, and in all
    size = max(float(np.ptp(patch.control_points, axis=0).max()) for patch in patches)
    with suppress(ToleranceError):
        return refine(mosaic, Sampler(patches), share * size, most_cells, samples)[0]
    return mosaic


def cells_along_edges(patches: Sequence[Patch], cells: int, least: int) -> int:
    """Return the number of cells along each edge, at least `least`, with which there are roughly `cells` in all."""
    share = cells / sum(cell_count(patch.domain, 1) for patch in patches)
    return max(least, int(share if patches[0].dimension == 1 else np.sqrt(share)))
