"""Starter specs: TOML with comments, to be edited by hand; their texts are the files in ``templates``."""

from pathlib import Path

from gtb_cli.errors import SpecError
from gtb_cli.vocabulary import TEMPLATES


def template(name: str, sides: int | None = None) -> str:
    """Return a spec with comments that can be meshed as it is: one of `TEMPLATES`, some with a number of sides.

    Raises `SpecError`: no template has this name, or the number of sides is missing, out of range or not used.
    """
    if name not in TEMPLATES:
        raise SpecError(f"template: expected one of {', '.join(TEMPLATES)}, got {name!r}")
    if (most := TEMPLATES[name]) is None:
        if sides is not None:
            takers = [each for each, most in TEMPLATES.items() if most]
            raise SpecError(f"{name}: expected no number of sides, got {sides}; {', '.join(takers)} take one")
    elif sides is None:
        raise SpecError(f"{name}: expected a number of sides, such as {name} 5")
    elif not 3 <= sides <= most:
        raise SpecError(f"{name}: expected 3 to {most} sides, got {sides}")
    text = (Path(__file__).parent / "templates" / f"{name}.toml").read_text(encoding="utf-8")
    # Editors that use Taplo read the first line. It names a file: no address would serve the keys of every version.
    schema_lines = "#:schema ./spec-schema.json\n"
    schema_lines += "# gtb schema -o spec-schema.json makes the file by which editors know the keys.\n\n"
    if name == "n-gon":
        return schema_lines + text.format(**_polygon(sides or 0))
    return schema_lines + text.replace("SIDES", f"{sides}").replace("MOST", f"{most}")


def _polygon(sides: int) -> dict[str, object]:
    """Return the entries of a dome over a polygon: its corners, a knot halfway from each to the centre, the centre."""
    angles = [f"({2 * k}*pi/{sides})" for k in range(sides)]
    entries = [f'"{factor}cos{angle}", "{factor}sin{angle}"' for factor in ("2*", "") for angle in angles] + ["0, 0"]
    entries[0], entries[sides] = "2, 0", "1, 0"
    heights = [0] * sides + [1] * sides + [2]
    return {
        "sides": sides,
        "knots": "".join(f"    [{entry}],\n" for entry in entries),
        "points": "".join(f"    [{entry}, {z}],\n" for entry, z in zip(entries, heights, strict=True)),
        "ones": ", ".join(["1"] * sides),
        "twos": ", ".join(["2"] * sides),
    }
