"""What the architecture promises about imports and about names of files."""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import tracknoise

ROOT = Path(tracknoise.__file__).parent


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def trees() -> dict[str, ast.Module]:
    """Every module by name."""
    return {module_name(path): ast.parse(path.read_text(encoding="utf-8")) for path in ROOT.rglob("*.py")}


@pytest.fixture(scope="module", autouse=True)
def forgotten() -> Iterator[None]:
    """The trees take 200 MiB."""
    yield
    trees.cache_clear()


def imported(tree: ast.Module) -> Iterator[str]:
    """Modules of the package that a module imports anywhere: in functions, and for types, too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in trees())
        elif isinstance(node, ast.ImportFrom) and node.module in trees():
            names = (f"{node.module}.{alias.name}" for alias in node.names)
            yield from (name if name in trees() else node.module for name in names)


@cache
def imports() -> dict[str, set[str]]:
    """Modules of the package that each module imports, without the public face, which only names them."""
    return {name: set(imported(tree)) - {name, ROOT.name} for name, tree in trees().items()}


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


def test_no_modules_import_each_other_in_a_circle() -> None:
    assert find_cycle() == []


def test_imports_in_functions_and_for_types_count() -> None:
    inside = "def f():\n    from tracknoise.tables import store\n    import tracknoise.exceptions\n"
    for_types = "if TYPE_CHECKING:\n    from tracknoise.tables import schema\n"
    expected = {"tracknoise.tables.store", "tracknoise.exceptions", "tracknoise.tables.schema"}
    assert set(imported(ast.parse(inside + for_types))) == expected


def test_a_circle_would_be_found(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = sorted(trees())[:2]
    monkeypatch.setitem(imports(), first, {second})
    monkeypatch.setitem(imports(), second, {first})
    assert find_cycle() == [first, second, first]


def names_in(tree: ast.Module) -> set[str]:
    """What a module defines, or imports, outside functions."""
    names: set[str] = set()
    for node in [*tree.body, *(inner for each in tree.body if isinstance(each, ast.ClassDef) for inner in each.body)]:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names.update(alias.asname or alias.name for alias in node.names)
        else:
            names.update(inner.id for inner in ast.walk(node) if isinstance(inner, ast.Name))
    return names


def exists(name: str) -> bool:
    """Whether a dotted name is a module, or what a module or a class in it defines."""
    parts = name.split(".")
    module = next((found for end in range(len(parts), 0, -1) if (found := ".".join(parts[:end])) in trees()), ROOT.name)
    return set(parts[module.count(".") + 1 :]) <= names_in(trees()[module]) | set(tracknoise.__all__)


def test_modules_that_docstrings_and_comments_name_exist() -> None:
    rooms = "|".join(path.name for path in ROOT.iterdir() if path.is_dir())
    cited = re.compile(rf"(?<!`)`({ROOT.name}|{rooms})((?:\.\w+)+)`(?!`)")
    wrong = [
        f"{path.relative_to(ROOT)}: {first}{rest}"
        for path in ROOT.rglob("*.py")
        for first, rest in cited.findall(path.read_text(encoding="utf-8"))
        if not exists(f"{first}{rest}" if first == ROOT.name else f"{ROOT.name}.{first}{rest}")
    ]
    assert wrong == []
    assert not exists(f"{ROOT.name}.statistics.nowhere")


def test_no_file_name_occurs_twice() -> None:
    names = Counter(path.name for path in ROOT.rglob("*.py") if path.name != "__init__.py")
    assert [name for name, count in names.items() if count > 1] == []
