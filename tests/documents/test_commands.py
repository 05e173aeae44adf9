"""Every command that the documentation shows can be called so: its options and arguments are known to the program."""

import argparse
import importlib.util
import re
import runpy
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import typer

import tracknoise
from tracknoise.cli.commands import app
from tracknoise.cli.terminal import Terminal

ROOT = Path(__file__).parents[2]
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/**/*.md"))]
FINISHED = [path for path in DOCUMENTS if path.name != "CONTRIBUTING.md"]
"""Those that name no files that the reader is to make."""
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"(?<!`)`([^`]+)`(?!`)")
SHELLS = {"", "sh", "bash", "console"}
INCOMPLETE = {"MissingParameter", "NoArgsIsHelpError"}
OPERATORS = {"|", "||", "&&", ";", ">", ">>", "&"}
PATH = re.compile(r"(?:src/tracknoise|tests|benchmarks|examples|docs)/[\w./-]*\w")
PUBLIC = re.compile(r"\b(?:tn|tracknoise)\.([A-Za-z]\w*)\(")


@dataclass(frozen=True)
class Example:
    """A command of a document. One in a sentence may name its arguments in general, or leave them out."""

    document: str
    words: tuple[str, ...]
    in_a_sentence: bool

    def __str__(self) -> str:
        return f"{self.document}: {' '.join(self.words)}"


def lines(language: str, block: str) -> Iterator[str]:
    """Commands of a block: its lines, of a console those after a prompt."""
    for line in block.replace("\\\n", " ").splitlines():
        if language != "console" or line.startswith("$ "):
            yield line.removeprefix("$ ").strip()


def commands(line: str) -> Iterator[tuple[str, ...]]:
    """The commands of this project in a line of a shell."""
    if "tracknoise" not in line and "benchmarks" not in line:
        return
    lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    words: list[str] = []
    for word in [*lexer, ";"]:
        if word in OPERATORS:
            if words[:1] == ["tracknoise"] or words[:2] == ["python", "-m"]:
                yield tuple(words)
            words = []
        else:
            words.append(word)


def examples() -> Iterator[Example]:
    for path in DOCUMENTS:
        name, text = str(path.relative_to(ROOT)), path.read_text()
        for language, block in BLOCK.findall(text):
            if language in SHELLS:
                for line in lines(language, block):
                    yield from (Example(name, words, False) for words in commands(line))
        for code in INLINE.findall(BLOCK.sub("", text)):
            if code.startswith(("tracknoise ", "python -m ")):
                yield from (Example(name, words, True) for words in commands(" ".join(code.split())))


FOUND = list(dict.fromkeys(examples()))
OF_PROGRAM = [one for one in FOUND if one.words[0] == "tracknoise"]
OF_MODULES = [one for one in FOUND if one.words[0] == "python"]


def leaves(command: Any) -> Iterator[Any]:
    """The command, or those below it that do the work."""
    below = getattr(command, "commands", None)
    if below is None:
        yield command
    else:
        for one in below.values():
            yield from leaves(one)


@pytest.fixture
def program():
    """The program that parses as always and then does nothing."""
    command: Any = typer.main.get_command(app)
    for leaf in leaves(command):
        leaf.callback = lambda **_: None
    return lambda *words: command.main(list(words), standalone_mode=False, obj=Terminal())


def test_commands_are_found():
    assert len(OF_PROGRAM) > 60
    assert len(OF_MODULES) > 30


@pytest.mark.parametrize("example", OF_PROGRAM, ids=str)
def test_the_program_understands(example, program):
    try:
        program(*example.words[1:])
    except Exception as error:  # its class is private to typer
        if not (example.in_a_sentence and type(error).__name__ in INCOMPLETE):
            raise


class ParsedError(Exception):
    """The arguments of a module were understood."""


@pytest.mark.parametrize("example", OF_MODULES, ids=str)
def test_the_module_understands(example, monkeypatch):
    _, _, module, *arguments = example.words
    found = importlib.util.find_spec(module)
    assert found is not None
    source = importlib.util.find_spec(f"{module}.__main__") if found.submodule_search_locations else found
    assert source is not None
    if "argparse" not in Path(source.origin).read_text():
        return
    understood = argparse.ArgumentParser.parse_args

    def only_parse(*parameters, **named):
        understood(*parameters, **named)
        raise ParsedError

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", only_parse)
    monkeypatch.setattr(sys, "argv", [module, *arguments])
    for imported in (module, f"{module}.__main__"):  # it is run as a program
        monkeypatch.delitem(sys.modules, imported, raising=False)
    with pytest.raises(ParsedError):
        runpy.run_module(module, run_name="__main__", alter_sys=True)


@pytest.mark.parametrize("document", FINISHED, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_and_names_that_are_mentioned_exist(document):
    text = document.read_text()
    paths = {found[0] for code in INLINE.findall(BLOCK.sub("", text)) for found in PATH.finditer(code)}
    assert [path for path in sorted(paths) if not (ROOT / path).exists()] == []
    code = "\n".join(block for language, block in BLOCK.findall(text) if language == "python")
    names = {name for name in PUBLIC.findall(code) if name not in tracknoise.__all__}
    assert names == set()


def test_an_unknown_option_is_found(program):
    with pytest.raises(Exception, match=r"(?i)no such option"):
        program("run", "demo", "--no-such-option")
