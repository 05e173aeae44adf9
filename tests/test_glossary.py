"""The words that docs/glossary.md forbids occur nowhere: documentation, help, source code, templates and a report."""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from html.parser import HTMLParser
from pathlib import Path

import pytest
import typer
from tests.report.runs import make_run

from tracknoise.cli.commands import app
from tracknoise.report.glossary import TERMS
from tracknoise.report.page import write_report

__all__ = ["make_run"]
ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "tracknoise"
GLOSSARY = ROOT / "docs" / "glossary.md"
TEMPLATES = {".j2", ".js", ".toml"}


@dataclass(frozen=True)
class Rule:
    """A phrase to avoid, and what to write instead."""

    phrase: str
    instead: str

    @cached_property
    def first(self) -> str:
        return self.phrase.split()[0].lower()

    @cached_property
    def pattern(self) -> re.Pattern[str]:
        words = r"\s+".join(map(re.escape, self.phrase.split()))
        return re.compile(rf"(?<![\w-]){words}(?![\w-])", re.IGNORECASE)


@dataclass(frozen=True)
class Text:
    """Some text, the place it comes from and the number of its first line there."""

    place: str
    content: str
    line: int = 1


def table(heading: str) -> list[Rule]:
    """The rules in the table below a heading of the glossary."""
    section = GLOSSARY.read_text().split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("|")][2:]
    return [Rule(phrase.strip(" `"), instead.strip()) for instead, phrases in rows for phrase in phrases.split(",")]


WORDS, NAMES = table("Words"), {rule.phrase: rule.instead for rule in table("Names")}


def violations(text: Text, rules: list[Rule] = WORDS) -> Iterator[str]:
    """One message for each phrase to avoid that occurs in a text."""
    lower = text.content.lower()
    for rule in (rule for rule in rules if rule.first in lower):
        for found in rule.pattern.finditer(text.content):
            line = text.line + text.content.count("\n", 0, found.start())
            yield f"{text.place}:{line}: {' '.join(found[0].split())!r}; write: {rule.instead}"


def markdown(path: Path) -> Iterator[Text]:
    content = path.read_text()
    if path == GLOSSARY:  # the tables of words to avoid contain them
        content = content.split("\n## Words\n")[0]
    yield Text(str(path.relative_to(ROOT)), content)


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(ast.parse(path.read_text())))


@pytest.fixture(scope="module", autouse=True)
def forgotten() -> Iterator[None]:
    """The trees take 200 MiB."""
    yield
    nodes.cache_clear()


def python_text(path: Path) -> Iterator[Text]:
    """All string literals and docstrings of a module."""
    for node in nodes(path):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield Text(str(path.relative_to(ROOT)), node.value, node.lineno)


def names(path: Path) -> Iterator[tuple[str, int]]:
    """Names that a module defines, its own included, with their lines."""
    yield path.stem, 1
    for node in nodes(path):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, node.lineno
        if isinstance(node, ast.ClassDef):
            for statement in node.body:
                if isinstance(statement, ast.Assign):
                    yield from ((ast.unparse(target), statement.lineno) for target in statement.targets)


def files_of(room: str) -> list[Path]:
    """Files of a folder of the package; of the package itself for an empty name."""
    found = (SOURCE / room).rglob("*") if room else SOURCE.glob("*")
    return sorted(path for path in found if path.is_file() and "__pycache__" not in path.parts)


DOCUMENTS = ["README.md", "CONTRIBUTING.md", *sorted(str(path.relative_to(ROOT)) for path in ROOT.glob("docs/**/*.md"))]
ROOMS = ["", *sorted(path.name for path in SOURCE.iterdir() if (path / "__init__.py").exists())]
COMMANDS = sorted(typer.main.get_command(app).commands)  # type: ignore[attr-defined]


def require_clean(texts: Iterator[Text]) -> None:
    found = [message for text in texts for message in violations(text)]
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_documents(document):
    require_clean(markdown(ROOT / document))


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room or "package")
def test_strings_and_docstrings_of_the_source(room):
    require_clean(text for path in files_of(room) if path.suffix == ".py" for text in python_text(path))


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room or "package")
def test_templates_and_presets(room):
    paths = [path for path in files_of(room) if path.suffix in TEMPLATES]
    require_clean(Text(str(path.relative_to(ROOT)), path.read_text()) for path in paths)


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room or "package")
def test_names_of_the_source(room):
    found = [
        f"{path.relative_to(ROOT)}:{line}: name {name!r}; write: {NAMES[name.lstrip('_')]}"
        for path in files_of(room)
        if path.suffix == ".py"
        for name, line in names(path)
        if name.lstrip("_") in NAMES
    ]
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_help(command, tracknoise_help):
    require_clean(iter([Text(f"tracknoise {command} --help", tracknoise_help(command))]))


@pytest.fixture
def tracknoise_help():
    """Help of a command as text without line breaks, which depend on the width of the terminal."""

    def help_of(command: str) -> str:
        group = typer.main.get_command(app)
        found = group.commands[command] if command else group  # type: ignore[attr-defined]
        return "\n".join([found.help or "", *(getattr(parameter, "help", None) or "" for parameter in found.params)])

    return help_of


class Prose(HTMLParser):
    """The text of an HTML page, without scripts and styles."""

    def __init__(self) -> None:
        super().__init__()
        self.parts: list[str] = []
        self._hidden = 0

    def handle_starttag(self, tag, attrs):
        self._hidden += tag in ("script", "style")
        self.parts += [value for name, value in attrs if name in ("alt", "title", "aria-label") and value]

    def handle_endtag(self, tag):
        self._hidden -= tag in ("script", "style")

    def handle_data(self, data):
        if not self._hidden:
            self.parts.append(data)


def test_a_report(make_run):
    page = write_report(make_run(told=True), figure_formats=())
    prose = Prose()
    prose.feed(page.read_text())
    assert "error" in " ".join(prose.parts)
    require_clean(iter([Text("a report", "\n".join(prose.parts))]))


def test_the_tables_are_read_and_phrases_are_found_across_lines_but_not_within_words():
    assert Rule("tried again", "retry, retrying") in WORDS
    assert NAMES["Setting"] == "`SequenceContext`"
    text = Text("x.md", "One.\nIt is Tried\n  again. It is untried again.")
    assert list(violations(text)) == ["x.md:2: 'Tried again'; write: retry, retrying"]


def test_the_page_defines_words_as_the_glossary_does():
    rows = [line.strip("| ").split(" | ") for line in GLOSSARY.read_text().splitlines() if line.startswith("| ")]
    for word, definition in TERMS.items():
        found = [row for row in rows if re.search(rf"\b{word}\b", row[0], re.IGNORECASE) and row[1] == definition]
        assert found, word
