"""Pictures of sequences: panels with one camera and one scale, and distances from the limit."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, distinct, shifted
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.files import read_file
from gtb_cli.limits.degeneration import heights_of
from gtb_cli.limits.knot_limit import knot_limit
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import runs_of
from gtb_cli.plots.look import Figure, Look, empty_figure, panels, settings, with_numbers
from gtb_cli.plots.net_lines import is_flat, net_of
from gtb_cli.plots.palette import LINE_COLOURS, NET
from gtb_cli.plots.scene import HIDDEN_STRENGTH, ShadedTriangles, plain, plane_view, space_views
from gtb_cli.plots.shape_figures import triangles_of, with_normals
from gtb_cli.sequences.sequence import degeneration, knot_sequence
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen
from gtb_cli.vocabulary import SEQUENCE_RECORD


@frozen
class Frames:
    """Meshes of a sequence, the limit last."""

    key: str  # the parameter, "x" or "step"
    values: tuple[float, ...]
    meshes: tuple[Mesh, ...]
    distances: tuple[float, ...] = ()  # from the limit; empty where they are not known
    film_distances: tuple[float, ...] | None = None  # from the limit with its film
    net_points: FloatArray = field(default_factory=lambda: np.empty((0, 3)))  # control points of the limit's net
    net: tuple[FloatArray, ...] = ()  # its lines, as paths
    film: Mesh | None = None  # the part of the limit that the last mesh lacks
    own_net: tuple[FloatArray, ...] = ()  # the lines of the net of the patch before any knot moves

    @property
    def titles(self) -> list[str]:
        """The title of each panel."""
        return [*(f"{self.key} = {value:.6g}" for value in self.values[:-1]), "limit"]


def figure_of_members(frames: Frames, members: Sequence[int], look: Look) -> Figure:
    """Draw some meshes of a sequence side by side, all with one camera, and a scale that suits the whole sequence."""
    max_panels = 24  # panels of one figure
    if len(members) > max_panels:
        raise DomainError(f"a sequence of {len(members)} meshes: a figure has room for {max_panels} panels")
    clouds = [*(mesh.vertices for mesh in frames.meshes), frames.net_points, *frames.own_net]
    limit, film = frames.meshes[-1], frames.film
    flat = limit.is_curve and is_flat(clouds)
    with settings():
        figure = empty_figure(look)
        axes = panels(figure, [frames.titles[member] for member in members], plane=flat)
        meshes = [frames.meshes[member] for member in members]
        if flat:
            views = [plane_view(ax, np.concatenate(clouds)) for ax in axes]
        else:
            smooth = [with_normals(mesh, smooth=True) for mesh in meshes]
            surfaces = [None if mesh.is_curve else triangles_of(mesh) for mesh in smooth]
            if film is not None and surfaces[-1] is not None and meshes[-1] is limit:
                surfaces[-1] = _with_film(surfaces[-1], with_normals(film, smooth=True))
            views = space_views(axes, look.camera, surfaces, clouds)
        for member, view, mesh in zip(members, views, meshes, strict=True):
            if look.net is not False:
                is_own = frames.own_net and mesh is not limit and frames.values[member] == 0
                net = frames.own_net if is_own else frames.net
                spots = np.unique(np.concatenate(net), axis=0) if is_own else frames.net_points
                view.lines(net, colour=NET, width=0.7, hidden=HIDDEN_STRENGTH, order=4)
                view.points(spots, edge=NET, size=3.6 if mesh.is_curve else 2.6)
            if mesh.is_curve:
                beside = limit if mesh is not limit else film
                if beside is not None:  # along whole pieces, so that dashes run on from segment to segment
                    dashed = [beside.vertices[run] for run in runs_of(beside.cells)]
                    view.lines(dashed, colour=LINE_COLOURS[1], width=1.4, dashes="--", order=4)
                own = [mesh.vertices[run] for run in runs_of(mesh.cells)]
                view.lines(own, colour=LINE_COLOURS[0], width=1.8, order=4)
            else:
                view.lines(list(mesh.vertices[mesh.open_sides]), width=0.9, hidden=HIDDEN_STRENGTH)
        views[0].triad()
        return figure


def _with_film(surface: ShadedTriangles, film: Mesh) -> ShadedTriangles:
    """Return a surface with its film, in another colour."""
    assert surface.normals is not None
    assert film.normals is not None
    return ShadedTriangles(
        np.concatenate([surface.vertices, film.vertices]),
        np.concatenate([surface.faces, shifted(film.faces, len(surface.vertices))]),
        np.concatenate([surface.normals, film.normals]),
        np.concatenate([surface.colours, plain(len(film.faces), "#E8894A")]),
    )


def read_frames(path: str) -> Frames:
    """Read the meshes that a folder's `sequence.json` lists, which may only name files in its own folder."""
    from gtb_cli.formats.meshfiles import read_mesh

    max_record_bytes = 10_000_000  # a record in bytes
    record = os.path.join(path, SEQUENCE_RECORD) if os.path.isdir(path) else path
    _refuse_pipe(record)
    data = read_file(record, max_record_bytes + 1)
    try:
        entries = json.loads(data if len(data) <= max_record_bytes else b"")["meshes"]
        key = next(key for key in ("x", "step") if key in entries[0])
        values = tuple(float(entry[key]) for entry in entries)
        names = [os.fspath(entry["file"]) for entry in entries]
    except (ValueError, KeyError, TypeError, IndexError, StopIteration, AttributeError, RecursionError):
        raise SpecError(f"{record}: is not a list of meshes as gtb degenerate and gtb knot-limit write it") from None
    for name in names:
        if os.path.basename(name) != name:
            raise SpecError(f"{record}: {name!r} is not the name of a file in its folder")
        _refuse_pipe(os.path.join(os.path.dirname(record), name))
    meshes = tuple(read_mesh(os.path.join(os.path.dirname(record), name)) for name in names)
    if len({mesh.is_curve for mesh in meshes}) > 1:
        raise SpecError(f"{record}: curves and surfaces are mixed")
    return Frames(key, values, meshes)


def _refuse_pipe(path: str) -> None:
    """Refuse what is neither file nor folder: reading a pipe would wait for its writer."""
    if os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path):
        raise SpecError(f"{path}: is not a file")


def default_values(what: str) -> tuple[list[float], list[float]]:
    """Return the x of degenerations, and the steps of knot limits, of a "sequence", "animation" or "distance"."""
    if what == "distance":
        return [10 ** (k / 2) for k in range(9)], [1 - 10 ** (-k / 2) for k in range(7)]
    if what == "animation":
        return [10 ** (k / 8) for k in range(25)], [1 - 10 ** (-k / 8) for k in range(25)]
    return [1.0, 10.0, 100.0], [0.0, 0.4, 0.8]


@dataclass(frozen=True)
class Approach:
    """The degeneration (x, lifting) or knot limit (merge, steps) that a sequence shows; empty or None is what suits."""

    x: Sequence[float] = ()
    lifting: ArrayLike | None = None  # (n,) values, or the index of the knot whose weight alone grows
    merge: Mapping[int, int] = field(default_factory=dict)  # from knots to the knots at whose places they arrive
    steps: Sequence[float] | None = None  # fractions of the way

    @property
    def given(self) -> list[str]:
        """The names of what is given."""
        is_given = len(self.x) > 0, self.lifting is not None, bool(self.merge), self.steps is not None
        return [name for name, given in zip(("x", "lifting", "merge", "steps"), is_given, strict=True) if given]

    def frames(
        self, patch: Patch, resolution: int, *, x: Sequence[float], steps: Sequence[float], distances: bool
    ) -> Frames:
        """Return meshes on the way to the limit, and its net; `x` and `steps` are the defaults.

        Raises a `DomainError` if the patch has no lifting, a move is not possible, or the two limits are mixed.
        """
        if self.merge and (len(self.x) or self.lifting is not None):
            raise DomainError("`merge` is a knot limit, and `x` and `lifting` are for degenerations")
        if self.steps is not None and not self.merge:
            raise DomainError("`steps` is for a knot limit, with `merge`")
        if self.merge:
            limit = knot_limit(patch, self.merge).merged
            values = steps if self.steps is None else self.steps
            found = knot_sequence(patch, self.merge, values, resolution, distances=distances)
            net, own = net_of(limit), tuple(patch.control_points[np.array(net_of(patch))])
        else:
            heights = heights_of(patch, self.lifting)
            found = degeneration(patch, self.x if len(self.x) else x, heights, resolution, distances=distances)
            limit, net, own = patch, net_of(patch, heights if found.values[-1] else -heights), ()
        points, lines = limit.control_points[distinct(np.ravel(net))], tuple(limit.control_points[np.array(net)])
        known = found.key, found.values, found.meshes, found.distances, found.film_distances
        return Frames(*known, points, lines, found.film, own)


def figure_of_distances(frames: Frames, look: Look) -> Figure:
    """Draw the distances from the limit, both axes logarithmic: against x, or against what is left of the way."""
    if not frames.distances:
        raise DomainError("its distances were not measured: make it again without `distances=False`")
    with settings():
        figure = empty_figure(look)
        ax = with_numbers(figure)
        values = np.array(frames.values[:-1])
        steps = frames.key == "step"
        across = 1 - values if steps else values
        for label, distances, colour, dashes in (
            ("from the limit", frames.distances, LINE_COLOURS[0], "o-"),
            ("from the limit with its film", frames.film_distances, LINE_COLOURS[1], "s--"),
        ):
            if not distances:
                continue
            up = np.array(distances[:-1])
            shown = (across > 0) & (up > 0)
            ax.plot(across[shown], up[shown], dashes, color=colour, lw=1.5, ms=4.5, mec="white", mew=0.6, label=label)
        if not any(np.size(line.get_xydata()) for line in ax.lines):
            raise DomainError("no distance is other than 0: a figure needs some x, or steps, before the limit")
        ax.set(xscale="log", yscale="log", xlabel="1 − step" if steps else "x", ylabel="distance, in model units")
        if steps:
            ax.invert_xaxis()
        ax.grid(True, which="major", color="#DDDDDD", lw=0.6)
        ax.grid(True, which="minor", color="#F0F0F0", lw=0.4)
        if frames.film_distances:
            ax.legend(frameon=False, fontsize=8)
        return figure
