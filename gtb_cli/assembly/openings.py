"""Why a model is open."""

from __future__ import annotations

from collections.abc import Sequence

from gtb_cli.theory.joints import EdgeRef, Joints, edge_name
from gtb_cli.theory.patch import Patch


def obstacles(joints: Joints, patches: Sequence[Patch]) -> list[str]:
    """Say, edge by edge, what keeps a model from being closed; empty where it is."""
    near: dict[EdgeRef, list[str]] = {}
    for first, second, distance in joints.almost:
        for one, other in ((first, second), (second, first)):
            near.setdefault(one, []).append(f"{distance:.3g} from {edge_name(patches, other)}")
    lines = []
    for ref in joints.open:
        hint = f" (but only {', '.join(near[ref])})" if ref in near else ""
        lines.append(f"{edge_name(patches, ref)} is open{hint}")
    for refs in joints.crowded:
        lines.append(f"{', '.join(edge_name(patches, ref) for ref in refs)} are one curve: more than two meet there")
    for joint in joints.one_sided:
        ends = " and ".join(edge_name(patches, ref) for ref in (joint.first, joint.second))
        lines.append(f"{ends} cannot be given the same orientation")
    return lines
