"""The example notebook works on a finished run, and holds no outputs."""

import ast
import json
from pathlib import Path

import pytest

import tracknoise as tn
from tracknoise.tables.store import RunFolder

NOTEBOOK = json.loads((Path(__file__).parents[2] / "examples" / "first-steps.ipynb").read_text(encoding="utf-8"))
CODE = ["".join(cell["source"]) for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]


def test_every_cell_after_the_first_works_on_a_run(
    fitted_run: RunFolder,
    capsys: pytest.CaptureFixture[str],
) -> None:
    first, *others = CODE
    assert "tn.analyse" in first  # docs/python.md measures likewise, which another test runs
    names = {"tn": tn, "run": tn.open_run(fitted_run.path)}
    shown = []
    for cell in others:
        *before, last = ast.parse(cell).body
        exec(compile(ast.Module(before, []), "cell", "exec"), names)
        if isinstance(last, ast.Expr):
            shown.append(eval(compile(ast.Expression(last.value), "cell", "eval"), names))
        else:
            exec(compile(ast.Module([last], []), "cell", "exec"), names)
    sigmas, table, _ = shown
    assert sigmas["oracle"].sigma_px > 0
    assert len(table.columns) == 12
    assert "Truth: " in capsys.readouterr().out


def test_the_notebook_holds_no_outputs() -> None:
    assert all(not cell.get("outputs") for cell in NOTEBOOK["cells"])
