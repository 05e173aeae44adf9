"""Which files a command may write: none of its inputs, none in a run folder, none that holds something else."""

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from tracknoise.exceptions import SettingsError
from tracknoise.foreign_files import absolute, is_folder, is_regular_file

_BEGINNINGS = {
    ".html": ("an earlier page", re.compile(rb"\s*<!doctype html>")),
    ".json": ("an earlier JSON document", re.compile(rb'\s*\{\s*"format": ?\d')),
    ".md": ("earlier Markdown", re.compile(rb"\s*## ")),
    ".txt": ("an earlier trajectory of it", re.compile(rb"# refined poses of ")),
}
"""What a file of a report may replace, by the ending of its name, and how it begins."""
_MOST_BYTES = 1 << 10


def require_outputs(
    outputs: Iterable[tuple[str, Path | None]], *, inputs: Sequence[Path | None] = (), are_reports: bool = False
) -> None:
    """Refuse files to write that would replace what is needed.

    Parameters
    ----------
    outputs
        Options, each with a file that it names. Those that are None are not written.
    inputs
        Files and folders that the command reads. A folder may be written into, unless it is a run.
    are_reports
        Whether they may replace nothing but an earlier output of the same kind, by the ending of their names. Others
        may replace any file but an input.

    Raises
    ------
    SettingsError
        If a file is an input, lies in a run folder, is named twice, is no regular file, or holds something that is not
        written to such files.
    """
    reads = {absolute(Path(), path) for path in inputs if path is not None}
    named = dict[Path, str]()
    for option, path in outputs:
        if path is None:
            continue
        target = absolute(Path(), path)
        if fault := _fault(target, reads, named, _BEGINNINGS.get(path.suffix.lower()) if are_reports else None):
            raise SettingsError(f"{option} {path}: {fault}")
        named[target] = option


def _fault(
    target: Path, reads: set[Path], named: dict[Path, str], earlier: tuple[str, re.Pattern[bytes]] | None
) -> str | None:
    """What speaks against a file, and what is expected instead."""
    if target in named:
        return f"found the file of {named[target]} too, expected another file"
    if run := next(filter(is_run, target.parents), None):
        return f"found a place in the run {run}, expected one outside of it"
    if is_folder(target):
        return "found a folder, expected a file to write"
    if not is_regular_file(target):
        return "found no regular file, expected a file to write" if target.exists() else None
    if any(is_regular_file(path) and target.samefile(path) for path in reads):
        return "found an input of this command, expected another file"
    if earlier is not None and (head := _head(target)) and not earlier[1].match(head):
        return f"found a file of another kind, expected a new file or {earlier[0]}"
    return None


def is_experiment(path: Path) -> bool:
    """Whether a path names an experiment file."""
    return path.suffix == ".toml" and is_regular_file(path)


def is_run(folder: Path) -> bool:
    """Whether a folder is that of a run, which may be damaged."""
    return all(os.path.lexists(folder / name) for name in ("manifest.json", "experiment.toml"))


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_MOST_BYTES)
    except OSError as error:
        raise SettingsError(f"{path}: unreadable ({error.strerror}), expected a file to write") from error
