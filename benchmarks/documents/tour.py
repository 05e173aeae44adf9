"""The outputs and figures of docs/tour.md, made again: its commands are run, and what they print is put below them.

    python -m benchmarks.documents.tour FOLDER

The commands run in this folder, one after another. Runs that are complete there are not measured again. Figures are
copied from the report of the run.
"""

import argparse
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "tour.md"
FIGURES = "runs/demo/report/figures"
DRAW = "tracknoise report runs/demo --figures"
PROMPT = "$ "
_BLOCK = re.compile(r"(?<=^```console\n).*?(?=^```$)", re.DOTALL | re.MULTILINE)
_FIGURE = re.compile(r"\]\(figures/([\w-]+\.svg)\)")
_SETTINGS = {"COLUMNS": "100", "NO_COLOR": "1"}
"""Of the environment, so that outputs do not depend on the terminal."""


def outputs(page: str) -> dict[str, str]:
    """What the commands in the console blocks of a page print, by command, in order."""
    found: dict[str, str] = {}
    for block in _BLOCK.findall(page):
        for line in block.splitlines(keepends=True):
            if line.startswith(PROMPT):
                command = line.removeprefix(PROMPT).rstrip()
                found[command] = ""
            else:
                found[command] += line
    return found


def figures(page: str) -> list[str]:
    """Names of the files of the figures that a page shows."""
    return _FIGURE.findall(page)


def remade(page: str, output: Callable[[str], str]) -> str:
    """The page with other outputs below its commands.

    Parameters
    ----------
    page
        Markdown.
    output
        What a command prints.
    """

    def printed(block: re.Match[str]) -> str:
        commands = (line.removeprefix(PROMPT) for line in block[0].splitlines() if line.startswith(PROMPT))
        return "".join(f"{PROMPT}{command}\n{output(command)}" for command in commands)

    return _BLOCK.sub(printed, page)


def run(command: str, folder: Path) -> str:
    """What a command prints in a folder, whose path is left out. The program ends if the command fails."""
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env=os.environ | _SETTINGS,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(f"{command}\nended with exit status {done.returncode}:\n{done.stdout}")
    return "".join(f"{line.rstrip()}\n" for line in done.stdout.replace(f"{folder.resolve()}/", "").splitlines())


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the commands, and write the page and its figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder: Path = parser.parse_args(arguments).folder
    folder.mkdir(parents=True, exist_ok=True)
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(remade(page, lambda command: run(command, folder)), encoding="utf-8")
    run(DRAW, folder)
    for name in figures(page):
        shutil.copy(folder / FIGURES / name, PAGE.parent / "figures" / name)


if __name__ == "__main__":
    main()
