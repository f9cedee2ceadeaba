"""`specs/study.ipynb`: a researcher's study by public names only, whose cells run, assert what they say and draw."""

import ast
import json

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import gtb_cli
from tests.marks import long
from tests.shell import SPECS

NOTEBOOK = SPECS / "study.ipynb"
CELLS = [cell for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
CODE = ["".join(cell["source"]) for cell in CELLS]


def test_it_has_public_names_only_and_no_results():
    nodes = [node for code in CODE for node in ast.walk(ast.parse(code))]
    imported = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    assert imported == {"matplotlib.pyplot", "numpy", "gtb_cli"}
    assert not [node for node in nodes if isinstance(node, ast.ImportFrom)]
    attributes = [node for node in nodes if isinstance(node, ast.Attribute)]
    used = {node.attr for node in attributes if isinstance(node.value, ast.Name) and node.value.id == "gtb_cli"}
    assert len(used) > 12
    assert used - set(gtb_cli.__all__) == set()
    assert not [node.attr for node in attributes if node.attr.startswith("_")]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in CELLS)


def shown_by(code, names):
    """Run a cell, and return the value of its last line."""
    tree = ast.parse(code)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)


@long
def test_its_cells_run_and_draw(monkeypatch, capsys):
    monkeypatch.chdir(SPECS)
    mpl.use("Agg")
    plot, names = gtb_cli.Patch.plot, {}
    monkeypatch.setattr(
        gtb_cli.Patch, "plot", lambda self, *ax, **options: plot(self, *ax, **({} if ax else {"dpi": 30}), **options)
    )
    figures = [shown for shown in (shown_by(code, names) for code in CODE) if isinstance(shown, Figure)]
    assert len(figures) == 7
    for figure in figures:
        figure.dpi = 30
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        assert (np.asarray(canvas.buffer_rgba())[..., :3].min(axis=2) < 200).mean() > 0.003
    said = capsys.readouterr().out
    assert "317 limits, of which 61 are triangulated" in said
    assert "the patch folds" in said
