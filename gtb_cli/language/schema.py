"""The JSON Schema of a spec, for editors and for programs that write specs, and the page of its keys."""

import json
import re
from pathlib import Path
from typing import Any


def page() -> str:
    """Return the text of every key with an example, as Markdown."""
    return Path(__file__).with_name("spec.md").read_text(encoding="utf-8")


def schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a spec, TOML or JSON, as plain data; keys are told as the page does.

    A schema cannot express every rule. `gtb_cli.language.loading.parse` alone checks syntax, repeated keys and sizes;
    that lists have an entry for each knot; the values of expressions and the names in them; that copied patches and
    included files exist; that ribbons are for curves and for gtb fill alone; that names do not clash; that numbers are
    finite (JSON has no others); that a name has no half of a surrogate pair; that the hull is not flat, and the number
    of its edges; and whether the knots are a lattice.
    """
    texts = dict(re.findall(r"^### (\w+)\n\n((?:\S.*\n)+)", page(), re.MULTILINE))
    text = Path(__file__).with_name("schema.json").read_text(encoding="utf-8")
    definitions = {f"#/$defs/{name}": found for name, found in json.loads(text)["$defs"].items()}

    def told(table: dict[str, Any]) -> dict[str, Any]:
        for key, entry in table.get("properties", {}).items():
            if isinstance(entry, dict) and key in texts:  # not beside a reference: some editors see nothing there
                entry |= definitions.get(entry.pop("$ref", ""), {}) | {"description": " ".join(texts[key].split())}
        return table

    return json.loads(text, object_hook=told)  # type: ignore[no-any-return]
