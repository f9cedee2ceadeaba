"""Starter specs: TOML with comments, to be edited by hand; their texts are the files in ``templates``."""

import os

from gtb_cli.errors import SpecError
from gtb_cli.vocabulary import TEMPLATES


def template(name: str, sides: int | None = None) -> str:
    """Return a spec with comments that can be meshed as it is.

    Parameters
    ----------
    name : str
        One of `TEMPLATES`.
    sides : int, optional
        Number of sides, only for "n-gon".

    Returns
    -------
    str
        TOML.

    Raises
    ------
    SpecError
        No template has this name, or the number of sides is missing, out of range or not used.
    """
    min_sides, max_sides = 3, 100
    if name not in TEMPLATES:
        raise SpecError(f"template: expected one of {', '.join(TEMPLATES)}, got {name!r}")
    if name == "n-gon":
        if sides is None:
            raise SpecError("n-gon: expected a number of sides, such as n-gon 7")
        if not min_sides <= sides <= max_sides:
            raise SpecError(f"n-gon: expected {min_sides} to {max_sides} sides, got {sides}")
    elif sides is not None:
        raise SpecError(f"{name}: expected no number of sides, got {sides}; n-gon takes one")
    with open(os.path.join(os.path.dirname(__file__), "templates", f"{name}.toml"), encoding="utf-8") as file:
        text = file.read()
    # Editors that use Taplo read the first line. It names a file: no address would serve the keys of every version.
    schema_lines = "#:schema ./spec-schema.json\n"
    schema_lines += "# gtb schema -o spec-schema.json makes the file by which editors know the keys.\n\n"
    return schema_lines + (text if sides is None else text.format(**_polygon(sides)))


def _polygon(sides: int) -> dict[str, object]:
    """The entries of a dome over a regular polygon: its corners, a knot halfway from each to the centre, the centre."""
    entries = [_place(factor, k, sides) for factor in ("2*", "") for k in range(sides)] + ["0, 0"]
    heights = [0] * sides + [1] * sides + [2]
    return {
        "sides": sides,
        "knots": "".join(f"    [{entry}],\n" for entry in entries),
        "points": "".join(f"    [{entry}, {z}],\n" for entry, z in zip(entries, heights, strict=True)),
        "ones": ", ".join(["1"] * sides),
        "twos": ", ".join(["2"] * sides),
    }


def _place(factor: str, k: int, sides: int) -> str:
    """The coordinates of corner k, as expressions."""
    if k == 0:
        return ("2" if factor else "1") + ", 0"
    return f'"{factor}cos({2 * k}*pi/{sides})", "{factor}sin({2 * k}*pi/{sides})"'
