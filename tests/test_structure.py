"""What the architecture promises about sizes of functions and about imports, measured."""

import ast
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

import tracknoise

ROOT = Path(tracknoise.__file__).parent
MEDIAN_LINES, P90_LINES, MOST_LINES, MOST_MODULES = 6, 15, 45, 14
"""Of functions without their docstrings, and of a chain of imports."""


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def trees() -> dict[str, ast.Module]:
    """Every module by name."""
    return {module_name(path): ast.parse(path.read_text(encoding="utf-8")) for path in ROOT.rglob("*.py")}


def lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines from ``def`` to the end, without the docstring."""
    count = function.end_lineno - function.lineno + 1
    if ast.get_docstring(function) is not None:
        count -= function.body[0].end_lineno - function.body[0].lineno + 1
    return count


def functions() -> list[tuple[int, str]]:
    """Lines and names of all functions, shortest first."""
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef)
    nodes = ((name, node) for name, tree in trees().items() for node in ast.walk(tree) if isinstance(node, kinds))
    return sorted((lines(node), f"{name}.{node.name}") for name, node in nodes)


def for_types_only(tree: ast.Module) -> set[ast.AST]:
    """Everything under ``if TYPE_CHECKING``, which is imported by no running program."""
    branches = (node for node in ast.walk(tree) if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test))
    return {inner for branch in branches for statement in branch.body for inner in ast.walk(statement)}


def imported(tree: ast.Module) -> Iterator[str]:
    """Modules of the package that a module imports anywhere, in functions too."""
    left_out = for_types_only(tree)
    for node in ast.walk(tree):
        if node in left_out:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in trees())
        elif isinstance(node, ast.ImportFrom) and node.module in trees():
            names = (f"{node.module}.{alias.name}" for alias in node.names)
            yield from (name if name in trees() else node.module for name in names)


@cache
def imports() -> dict[str, set[str]]:
    """Modules of the package that each module imports."""
    return {name: set(imported(tree)) - {name} for name, tree in trees().items()}


def find_cycle() -> list[str]:
    """Modules that import each other in a circle, the first again at the end; empty where there is no circle."""
    done: set[str] = set()

    def visit(name: str, above: list[str]) -> list[str]:
        if name in above:
            return [*above[above.index(name) :], name]
        if name in done:
            return []
        found = next((found for inner in sorted(imports()[name]) if (found := visit(inner, [*above, name]))), [])
        done.add(name)
        return found

    return next((found for name in sorted(trees()) if (found := visit(name, []))), [])


@cache
def longest_chain(name: str) -> tuple[str, ...]:
    """The longest chain of imports that begins with a module; there must be no circle."""
    return (name, *max((longest_chain(inner) for inner in sorted(imports()[name])), key=len, default=()))


def test_functions_are_short() -> None:
    found = functions()
    counts = [count for count, _ in found]
    assert len(counts) > 1000
    assert counts[len(counts) // 2] <= MEDIAN_LINES
    assert counts[int(len(counts) * 0.9)] <= P90_LINES
    assert [item for item in found if item[0] > MOST_LINES] == []


def test_docstrings_do_not_count() -> None:
    (function,) = ast.parse('def f():\n    """One.\n\n    Two.\n    """\n    return 1\n').body
    assert lines(function) == 2


def test_no_modules_import_each_other_in_a_circle() -> None:
    assert find_cycle() == []


def test_imports_in_functions_count_and_those_for_types_do_not() -> None:
    inside = "def f():\n    from tracknoise.tables import store\n    import tracknoise.exceptions\n"
    for_types = "if TYPE_CHECKING:\n    from tracknoise.tables import schema\n"
    assert set(imported(ast.parse(inside + for_types))) == {"tracknoise.tables.store", "tracknoise.exceptions"}


def test_a_circle_would_be_found(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = sorted(trees())[:2]
    monkeypatch.setitem(imports(), first, {second})
    monkeypatch.setitem(imports(), second, {first})
    assert find_cycle() == [first, second, first]


def test_no_chain_of_imports_is_long() -> None:
    chain = max((longest_chain(name) for name in sorted(trees())), key=len)
    assert all(inner in imports()[outer] for outer, inner in pairwise(chain))
    assert len(chain) <= MOST_MODULES, " > ".join(chain)
