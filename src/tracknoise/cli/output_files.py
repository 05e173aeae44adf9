"""Which files a command may write: none of its inputs, none in a run folder, none that holds something else."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from tracknoise.exceptions import SettingsError
from tracknoise.foreign_files import absolute, is_folder, is_regular_file

_BEGINNINGS = {
    "--html": ("an earlier page", re.compile(rb"\s*<!doctype html>")),
    "--json-file": ("an earlier JSON document", re.compile(rb'\s*\{\s*"format": ?(\d|"tracknoise\.noise-table/)')),
    "--markdown": ("earlier Markdown", re.compile(rb"\s*## ")),
    "--write-trajectory": ("an earlier trajectory of it", re.compile(rb"# refined poses of ")),
}
"""What an option may replace, and how it begins. Other options may replace any file but an input."""
_MOST_BYTES = 1 << 10


def require_outputs(outputs: Iterable[tuple[str, Path | None]], *, inputs: Sequence[Path | None] = ()) -> None:
    """Refuse files to write that would replace what is needed.

    Parameters
    ----------
    outputs
        Options, each with a file that it names. Those that are None are not written.
    inputs
        Files and folders that the command reads. A folder may be written into, unless it is a run.

    Raises
    ------
    SettingsError
        If a file is an input, lies in a run folder, is named twice, is no regular file, or holds something that the
        option does not write.
    """
    reads = {absolute(Path(), path) for path in inputs if path is not None}
    named = dict[Path, str]()
    for option, path in outputs:
        if path is None:
            continue
        target = absolute(Path(), path)
        if fault := _fault(option, target, reads, named):
            raise SettingsError(f"{option} {path}: {fault}")
        named[target] = option


def _fault(option: str, target: Path, reads: set[Path], named: dict[Path, str]) -> str | None:
    """What speaks against a file, and what is expected instead."""
    if target in named:
        return f"found the file of {named[target]} too, expected another file"
    if run := next(filter(_is_run, target.parents), None):
        return f"found a place in the run {run}, expected one outside of it"
    if is_folder(target):
        return "found a folder, expected a file to write"
    if not is_regular_file(target):
        return "found no regular file, expected a file to write" if target.exists() else None
    if any(is_regular_file(path) and target.samefile(path) for path in reads):
        return "found an input of this command, expected another file"
    what, beginning = _BEGINNINGS.get(option, ("", None))
    if beginning and (head := _head(target)) and not beginning.match(head):
        return f"found a file of another kind, expected a new file or {what}"
    return None


def _is_run(folder: Path) -> bool:
    return all(is_regular_file(folder / name) for name in ("manifest.json", "experiment.toml"))


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_MOST_BYTES)
    except OSError as error:
        raise SettingsError(f"{path}: unreadable ({error.strerror}), expected a file to write") from error
