"""Pictures of basis functions: over t, or as graphs over Δ."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.plots.look import Axes, AxesOf, Look, subscript
from gtb_cli.plots.palette import FAINT, INK, line_style
from gtb_cli.plots.scene import GRAPH_HEIGHT, HALO, HIDDEN_STRENGTH, View, note, space_views
from gtb_cli.plots.shape_figures import triangles_of, with_normals
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.basis import gt_bernstein
from gtb_cli.theory.patch import Patch


def basis_values(patch: Patch, u: FloatArray, unnormalised: bool) -> FloatArray:
    """Return (m, n) values of T_i, or β_i, at parameters."""
    return gt_bernstein(patch.domain, patch.coefficients, u) if unnormalised else patch.basis(u)


def chosen(look: Look, patch: Patch) -> tuple[int, ...]:
    """Return the indices of the basis functions to draw."""
    count = len(patch.knots)
    for index in look.index:
        if not 0 <= index < count:
            raise DomainError(f"index: expected 0 … {count - 1}, got {index}")
    return look.index or tuple(range(count))


def draw_basis(ax: Axes, curves: Sequence[Patch], look: Look, names: Sequence[str] = ()) -> None:
    """Draw basis functions of curves over t; several curves are variants of one curve, each with a name."""
    basis_points = 480  # number of points at which a basis is evaluated; knots and their neighbours are among them
    indices = chosen(look, curves[0])
    symbol = "β" if look.unnormalised else "T"
    for variant, curve in enumerate(curves):
        low, high = (float(x) for x in curve.domain.vertices[:, 0])
        even = (1 - np.cos(np.linspace(0, np.pi, basis_points + 1))) / 2
        t = np.union1d(low + (high - low) * even, curve.knots[:, 0]).clip(low, high)
        values = basis_values(curve, t, look.unnormalised)
        for number, index in enumerate(indices, variant * len(indices)):
            colour, dashes = line_style(number)
            ax.plot(t, values[:, index], dashes, color=colour, lw=1.6, zorder=3, clip_on=False)
            top = int(np.argmax(values[:, index]))
            text = names[variant] if names else subscript(symbol, index)
            edge, offset = {0: ("left", 5), len(t) - 1: ("right", -3)}.get(top, ("center", 0))
            place = t[top], values[top, index]
            note(ax, text, place, (offset, 3), ha=edge, va="bottom", color=colour, fontsize=9, bbox=HALO)
    low, high = (float(x) for x in curves[0].domain.vertices[:, 0])
    function = symbol if len(indices) != 1 else subscript(symbol, indices[0])
    ax.set(xlim=(low, high), ylim=(0, None), xlabel="t", ylabel=f"{function}(t)")
    ax.grid(True, color="#EEEEEE", lw=0.6)
    shown = np.concatenate([curve.knots for curve in curves])
    View(ax).points(np.column_stack([shown, np.zeros(len(shown))]), size=5)
    if look.numbers(len(curves[0].knots)) and not names:
        heights: dict[float, int] = {}
        for i, place in enumerate(curves[0].knots[:, 0].tolist()):
            again = heights[place] = heights.get(place, -1) + 1
            beside = (9 * ((place == low) - (place == high)), 8 + 9 * again)
            note(ax, subscript("a", i), (place, 0.0), beside, color="#555555")


def draw_bases(axes_of: AxesOf, variants: Sequence[Patch], look: Look, names: Sequence[str]) -> None:
    """Draw basis functions of a surface, or of variants of it, as graphs over Δ, each on axes of its own scale."""
    indices = chosen(look, variants[0])
    symbol = "β" if look.unnormalised else "T"
    fine = look.resolution or (64 if len(indices) * len(variants) <= 4 else 48)
    # A pixel is enough for a segment.
    fine = min(fine, math.ceil(max(look.size) * look.dpi / math.sqrt(len(indices) * len(variants))))
    share = (1 - np.cos(np.linspace(0, np.pi, 65)[:-1, None])) / 2  # of an edge, at places denser towards its ends
    surfaces, titles, rims = [], [], []
    for patch, name in zip(variants, names, strict=True):
        flat = Patch(patch.knots, patch.knots, patch.weights, patch.coefficients, log_weights=patch.log_weights)
        mesh = tessellate(flat, fine, parametrization="toric", normals=False)
        assert mesh.parameters is not None
        corners = patch.domain.vertices
        ends = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        around = np.concatenate([*(a + (b - a) * share for a, b in ends), corners[:1]])
        for index in indices:
            values, rim = (basis_values(patch, u, look.unnormalised)[:, index] for u in (mesh.parameters, around))
            highest = values.max()
            column = values / (highest or 1.0)
            plane = (mesh.parameters - patch.domain.center) / patch.domain.size
            graph = with_normals(Mesh(np.column_stack([plane, GRAPH_HEIGHT * column]), mesh.faces), smooth=True)
            colours = look.colours or "viridis"
            surfaces.append(replace(triangles_of(graph), scalars=column.clip(0, 1), colour_map=colours))
            edge = (around - patch.domain.center) / patch.domain.size
            rims.append(np.column_stack([edge, GRAPH_HEIGHT * rim / (highest or 1.0)]))
            titles.append(f"{name}{': ' if name else ''}{subscript(symbol, index)}, up to {highest:.3g}")
    domain = variants[0].domain
    corners, knots = ((place - domain.center) / domain.size for place in (domain.vertices, variants[0].knots))
    floor = np.column_stack([corners, np.zeros(len(corners))])
    box = np.concatenate([floor, floor + np.array([0, 0, GRAPH_HEIGHT])])
    drawn = space_views(axes_of(titles), look.camera, surfaces, [box])
    for view, index, rim in zip(drawn, indices * len(variants), rims, strict=True):
        view.lines([np.vstack([floor, floor[:1]])], colour=FAINT, width=0.7, hidden=0.6)
        view.lines([rim], width=0.8, hidden=HIDDEN_STRENGTH)
        spots = np.column_stack([knots, np.zeros(len(knots))])
        view.points(np.delete(spots, index, axis=0), edge=FAINT, size=2.6)
        view.points(spots[[index]], colour=INK, edge="white", size=4.2)
