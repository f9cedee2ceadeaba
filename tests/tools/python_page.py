"""specs/PYTHON.md: the reference of the Python library, from the docstrings of its public names.

``python -m tests.tools.python_page`` writes it anew, which ``make reference`` is for. What stands before the first name
of a section, its text and examples, is kept as it is; the sections and their names are those of ``gtb_cli.__doc__``.
"""

import inspect
import re
from collections.abc import Iterator
from functools import cached_property

import gtb_cli
from tests.shell import REPOSITORY

MADE = (gtb_cli.Patch, gtb_cli.Model, gtb_cli.Mesh, gtb_cli.Recipe)
"""Classes of which callers make objects."""

PAGE = REPOSITORY / "specs" / "PYTHON.md"


def sections() -> dict[str, list[str]]:
    """Public names by their headings in the docstring of the package."""
    found = re.findall(r"^(\S.*)\n((?: {4}\S+: .*\n?)+)", inspect.cleandoc(gtb_cli.__doc__), re.M)
    return {title: re.findall(r"\w+(?=,|$)", lines, re.M) for title, lines in found}


def page(before: str) -> str:
    """The page, with the parts of another one that are written by hand."""
    preface = before.partition("\n## ")[0].rstrip()
    by_hand = dict(re.findall(r"^## ([^\n]*)\n\n(.*?)(?=\n### |\n## |\Z)", before, re.M | re.S))
    parts = [preface]
    for title, names in sections().items():
        parts.append(f"## {title}\n\n{by_hand.get(title, '').strip()}".rstrip())
        for name in names:
            parts += entries(name)
    return "\n\n".join(parts) + "\n"


def entries(name: str) -> Iterator[str]:
    """The entry of a name and, for a class, those of its methods and properties."""
    value = getattr(gtb_cli, name)
    yield f"### `{name}{'' if inspect.isclass(value) and value not in MADE else signature(value)}`\n\n{text_of(value)}"
    for member, found in vars(value).items() if inspect.isclass(value) else ():
        if not member.startswith("_") and inspect.getdoc(found):
            if isinstance(found, property | cached_property):
                yield f"#### `{name}.{member}`\n\n{text_of(found)}"
            elif inspect.isfunction(found):
                yield f"#### `{name}.{member}{signature(found, is_method=True)}`\n\n{text_of(found)}"


def signature(value: object, is_method: bool = False) -> str:
    """The parameters and their defaults."""
    parameters = []
    for found in [*inspect.signature(value).parameters.values()][is_method:]:
        plain = found.replace(annotation=found.empty, name="patch" if found.name == "self" else found.name)
        if plain.default is not plain.empty and "<" in repr(plain.default):
            plain = plain.replace(default=...)
        parameters.append(plain)
    return str(inspect.Signature(parameters)).replace("Ellipsis", "...").replace("'", '"')


def text_of(value: object) -> str:
    """A docstring as Markdown."""
    lines = inspect.getdoc(value).replace("``", "`").splitlines()
    blocks, heading = [[]], None
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if set(line) == {"-"}:
            continue
        if following and set(following) == {"-"}:
            heading = line
            blocks += [[f"**{heading}**"], []]
        elif heading in ("Parameters", "Returns", "Raises", "Attributes") and line and not line.startswith(" "):
            blocks.append([f"- `{line}`"])
        elif line:
            blocks[-1].append(line.strip())
        else:
            blocks.append([])
    joined = "\n\n".join(" ".join(block) for block in blocks if block)
    return re.sub(r"(?m)^(- .*)\n\n(?=- )", r"\1\n", joined)


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
