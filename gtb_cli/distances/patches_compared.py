"""Patches of two specs that describe one surface: those that are turned over, and other names."""

from collections import Counter
from typing import TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, cross, dot
from gtb_cli.meshes.corner_values import only_in
from gtb_cli.models.model import Model
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch

Places: TypeAlias = tuple[FloatArray, FloatArray]  # (m, 3) middles of a patch's cells, and their normals


def unlike_patches(a: Patch | Model, b: Patch | Model) -> tuple[int, tuple[str, ...], str]:
    """Count the patches of one spec that are turned over in another of the same surface, and tell which names differ.

    Where there are more patches in one, they are seen as one, and names are not compared: the last text says so.
    """
    from scipy.spatial import cKDTree

    one, other = _places(a), _places(b)
    names, others = ([patch.name for patch in each.patches] for each in (a, b))
    if len(names) != len(others):
        whole, whole_other = (
            (np.concatenate(p), np.concatenate(n)) for p, n in (zip(*each, strict=True) for each in (one, other))
        )
        why = f"there are {len(names)} against {len(others)}" if 1 not in (len(names), len(others)) else ""
        return len(names) * _beside(whole, whole_other)[1], (), why if {*names} != {*others} else ""
    tree = cKDTree(np.concatenate([places for places, _ in other]))
    patch = np.repeat(np.arange(len(other)), [len(places) for places, _ in other])
    turned, moved, counts = 0, list[str](), (Counter(names), Counter(others))
    for number, (name, places) in enumerate(zip(names, one, strict=True)):
        is_named = name is not None and counts[0][name] == counts[1][name] == 1
        own = others.index(name) if is_named else number
        best = int(np.bincount(patch[tree.query(places[0])[1]]).argmax())
        apart, is_turned = _beside(places, other[own])
        nearer, is_best_turned = _beside(places, other[best])
        if nearer < apart / 4:  # places of cells are others where a patch is described otherwise
            is_turned, moved = is_best_turned, moved + [str(name)] * is_named
        turned += is_turned
    lone = [[str(name) for name in (here - there).elements() if name] for here, there in (counts, counts[::-1])]
    told = only_in("patches", *lone) if len(names) > 1 else []
    return turned, (*told, *[f"patches: {', '.join(moved[:5])} in other places"] * bool(moved)), ""


def _places(spec: Patch | Model) -> list[Places]:
    resolution = 8  # of meshes in which patches are found again
    mesh = tessellate(spec, resolution, normals=False)
    corners = mesh.vertices[mesh.cells].swapaxes(0, 1)
    normals = np.zeros_like(corners[0]) if mesh.is_curve else cross(corners[1] - corners[0], corners[2] - corners[0])
    ranges = [slice(*ends) for _, *ends in mesh.groups or [("", 0, len(mesh.cells))]]
    return [(corners.mean(axis=0)[cells], normals[cells]) for cells in ranges]


def _beside(places: Places, others: Places) -> tuple[float, bool]:
    """Return how far cells are from the nearest ones of another patch, in the middle, and whether these are turned."""
    from scipy.spatial import cKDTree

    apart, nearest = cKDTree(others[0]).query(places[0])
    return float(np.median(apart)), bool(dot(places[1], others[1][nearest]).sum() < 0)
