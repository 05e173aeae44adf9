"""`python -m benchmarks` finds the modules that measure something, and no others."""

import ast
from pathlib import Path

import benchmarks
import polars as pl
import pytest
from benchmarks import same_tables
from benchmarks.__main__ import names


def test_every_benchmark_has_rows_and_every_tool_has_none():
    (folder,) = map(Path, benchmarks.__path__)
    trees = {path.stem: ast.parse(path.read_text(encoding="utf-8")) for path in folder.glob("*.py")}
    functions = {
        name: {node.name for node in tree.body if isinstance(node, ast.FunctionDef)} for name, tree in trees.items()
    }
    assert names() == sorted(name for name, defined in functions.items() if "rows" in defined)


TABLE = {
    "key": ["a", "b"],
    "n": [1, 2],
    "error": [1.0, None],
    "several": [[1.0, 2.0], [3.0]],
    "text": ["1 px", "2 px"],
}
CHANGED = {
    "key": ["a", "c"],
    "n": [1, 3],
    "error": [1.0 + 1e-4, None],
    "several": [[1.0, 2.0 - 1e-3], [3.0]],
    "text": ["1 px", "3 px"],
}


def compared(folder, change, *options):
    """Exit status of `same_tables compare` of two run folders, the second of which has other columns."""
    for name, columns in (("before", TABLE), ("after", {**TABLE, **change})):
        (folder / name).mkdir()
        (folder / name / "manifest.json").write_text("{}")
        pl.DataFrame(columns).write_parquet(folder / name / "table.parquet")
    return same_tables.compare(folder / "before", folder / "after", *options)


@pytest.mark.parametrize("column", TABLE)
@pytest.mark.parametrize("tolerance", [1e-9, 1e-6])
def test_tables_within_a_tolerance_differ_in_floats_only(tmp_path, column, tolerance):
    assert compared(tmp_path, {column: CHANGED[column]}, tolerance) == 1


@pytest.mark.parametrize(
    "change", [{"error": [1.0 + 1e-9, None]}, {"several": [[1.0 - 1e-9, 2.0], [3.0]]}, {"error": [1.0, None]}]
)
def test_floats_may_differ_within_the_tolerance(tmp_path, capsys, change):
    assert compared(tmp_path, change, 1e-8) == 0
    assert "largest relative difference" in capsys.readouterr().out


@pytest.mark.parametrize("error", [[1.0, 0.0], [float("nan"), None], [float("inf"), None], [-1.0, None]])
def test_no_tolerance_allows_a_value_for_a_missing_one_or_another_sign(tmp_path, error):
    assert compared(tmp_path, {"error": error}, 0.5) == 1


def test_without_a_tolerance_the_last_bit_counts_and_sentences_may_be_reworded(tmp_path):
    (tmp_path / "floats").mkdir()
    (tmp_path / "texts").mkdir()
    assert compared(tmp_path / "floats", {"error": [1.0 + 2e-16, None]}) == 1
    assert compared(tmp_path / "texts", {"text": CHANGED["text"]}) == 0
