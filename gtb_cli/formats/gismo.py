"""XML files for G+Smo: exact rational Bézier rectangles, which of their sides meet, and names of all others."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from gtb_cli.arrays import EPS, FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.formats.bspline_surfaces import exact_surfaces
from gtb_cli.formats.kinds_of_surfaces import shortened
from gtb_cli.models.model import Model
from gtb_cli.theory.edges import edge_points_at, patch_name
from gtb_cli.theory.patch import Patch

SAME = 1e-9  # differences of sides that are one: of points, as a fraction of the size, and of ratios of weights


class Interface(NamedTuple):
    """Two sides that are one curve with one parameter: numbers of pieces, and their sides from 0 to 3.

    Sides are u = 0, u = 1, v = 0 and v = 1. `forward` says whether both run the same way.
    """

    first: tuple[int, int]
    second: tuple[int, int]
    forward: bool

    @property
    def line(self) -> str:
        """Pieces and sides, the direction of the second for each of the first, and whether these run the same way."""
        (p, s), (q, t) = self.first, self.second
        across = s // 2
        directions, same = [0, 0], [0, 0]
        directions[across], directions[1 - across] = t // 2, 1 - t // 2
        same[across], same[1 - across] = int(s % 2 != t % 2), int(self.forward)
        return " ".join(map(str, (p, s + 1, q, t + 1, *directions, *same)))


def encode_gismo(spec: Patch | Model) -> tuple[bytes, str, list[str]]:
    """Return a file of the exact Bézier pieces of a patch or model, what it holds, and warnings.

    Sides that are the same curve with the same parameter are interfaces; each edge of a patch with other sides is a
    boundary of a name, "PATCH edge J". A `DomainError` refuses curves, and says why a patch has no pieces.
    """
    if spec.dimension == 1:
        raise DomainError("is a curve, and files for G+Smo hold surfaces")
    nets, owners = [], []
    for index, patch in enumerate(spec.patches):
        try:
            surfaces = exact_surfaces(patch, index)
        except DomainError as fault:
            who = "" if isinstance(spec, Patch) else f"{patch_name(patch, index)}: "
            reason = shortened(str(fault))
            raise DomainError(f"{who}{reason}. Files for G+Smo hold exact pieces; VTU files, other cells") from None
        nets += [surface.net for surface in surfaces]
        owners += [index] * len(surfaces)
    points = np.concatenate([net[..., :3].reshape(-1, 3) for net in nets])
    # Control points of pieces are sums, with roundings of the coordinates.
    near = max(SAME * float(np.ptp(points, axis=0).max()), 64 * EPS * float(np.abs(points).max()))
    interfaces, unlike = interfaces_of(nets, near)
    met = {side for found in interfaces for side in (found.first, found.second)}
    boundaries: dict[str, list[str]] = {}
    edges: dict[int, list[FloatArray]] = {}
    for piece, net in enumerate(nets):
        owner, patch = owners[piece], spec.patches[owners[piece]]
        for side, rows in enumerate(_sides(net)):
            if (piece, side) not in met:
                if owner not in edges:
                    count = len(patch.domain.vertices)
                    edges[owner] = [edge_points_at(patch, edge, np.linspace(0, 1, 257)) for edge in range(count)]
                name = f"{patch.name or f'patch{owner}'} edge {_edge_of(rows, edges[owner])}"
                boundaries.setdefault(name, []).append(f"{piece} {side + 1}")
    warnings = []
    if unlike:
        warnings.append(f"{unlike} pairs of sides have the same points at other parameters, and are boundaries here")
    text = "".join(f"{line}\n" for line in _lines(nets, interfaces, boundaries))
    counts = {"piece": len(nets), "interface": len(interfaces), "boundary side": sum(map(len, boundaries.values()))}
    size_text = ", ".join(f"{count} {name}{'s' if count != 1 else ''}" for name, count in counts.items())
    return text.encode("utf-8"), size_text, warnings


def interfaces_of(nets: Sequence[FloatArray], near: float) -> tuple[list[Interface], int]:
    """Return the pairs of sides with points as `near`, and the number of those that have other parameters."""
    from scipy.spatial import cKDTree

    sides = [(piece, side, rows) for piece, net in enumerate(nets) for side, rows in enumerate(_sides(net))]
    middles = np.array([rows[[0, -1], :3].mean(axis=0) for _, _, rows in sides])
    found: list[Interface] = []
    taken: set[tuple[int, int]] = set()
    unlike = 0
    for a, b in sorted(cKDTree(middles).query_pairs(near)):
        (p, s, one), (q, t, other) = sides[a], sides[b]
        if {(p, s), (q, t)} & taken or np.ptp(one[:, :3], axis=0).max() <= near:
            continue
        for forward in (True, False):
            rows = other if forward else other[::-1]
            if len(rows) != len(one) or np.abs(one[:, :3] - rows[:, :3]).max() > near:
                continue
            ratios = rows[:, 3] / one[:, 3]
            if np.ptp(ratios) > SAME * ratios.max():
                unlike += 1
                continue
            found.append(Interface((p, s), (q, t), forward))
            taken |= {(p, s), (q, t)}
            break
    return found, unlike


def _sides(net: FloatArray) -> tuple[FloatArray, ...]:
    return net[0], net[-1], net[:, 0], net[:, -1]


def _edge_of(rows: FloatArray, edges: Sequence[FloatArray]) -> int:
    """The edge on which a side lies: that which is nearest to its ends and to a point between."""
    degree = len(rows) - 1
    shares = np.array([math.comb(degree, k) for k in range(degree + 1)]) * rows[:, 3]
    between = shares @ rows[:, :3] / shares.sum()
    spots = np.array([rows[0, :3], between, rows[-1, :3]])
    far = [np.linalg.norm(spots[:, None] - points, axis=2).min(axis=1).max() for points in edges]
    return int(np.argmin(far))


def _lines(
    nets: Sequence[FloatArray], interfaces: Sequence[Interface], boundaries: dict[str, list[str]]
) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield '<xml>\n<MultiPatch parDim="2" id="0">'
    yield f'<patches type="id_range">0 {len(nets) - 1}</patches>'
    if interfaces:
        yield "<interfaces>"
        yield from (interface.line for interface in interfaces)
        yield "</interfaces>"
    for name, sides in boundaries.items():
        yield f"<boundary name={quoteattr(name)}>"
        yield from sides
        yield "</boundary>"
    yield "</MultiPatch>"
    for number, net in enumerate(nets):
        rows = net.transpose(1, 0, 2).reshape(-1, 4) + 0.0  # the first direction runs fastest; no negative zeros
        yield f'<Geometry type="TensorNurbs2" id="{number}">\n<Basis type="TensorNurbsBasis2">'
        yield '<Basis type="TensorBSplineBasis2">'
        for index, count in enumerate(net.shape[:2]):
            knots = " ".join(["0"] * count + ["1"] * count)
            vector = f'<KnotVector degree="{count - 1}">{knots}</KnotVector>'
            yield f'<Basis type="BSplineBasis" index="{index}">{vector}</Basis>'
        yield "</Basis>\n<weights>"
        yield from (repr(weight) for weight in rows[:, 3].tolist())
        yield '</weights>\n</Basis>\n<coefs geoDim="3">'
        yield from (" ".join(map(repr, row)) for row in rows[:, :3].tolist())
        yield "</coefs>\n</Geometry>"
    yield "</xml>"
