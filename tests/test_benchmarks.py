"""`python -m benchmarks` finds the modules that measure something, and no others."""

import ast
from pathlib import Path

import benchmarks
from benchmarks.__main__ import names


def test_every_benchmark_has_rows_and_every_tool_has_none():
    (folder,) = map(Path, benchmarks.__path__)
    trees = {path.stem: ast.parse(path.read_text(encoding="utf-8")) for path in folder.glob("*.py")}
    functions = {
        name: {node.name for node in tree.body if isinstance(node, ast.FunctionDef)} for name, tree in trees.items()
    }
    assert names() == sorted(name for name, defined in functions.items() if "rows" in defined)
