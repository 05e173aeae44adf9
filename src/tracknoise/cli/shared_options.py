"""Options that several commands share, so that they have the same name and help everywhere."""

import os
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tracknoise.cli.terminal import Terminal
from tracknoise.exceptions import SettingsError
from tracknoise.sequences.frame_range import frames_of

if TYPE_CHECKING:
    from tracknoise.tables.trust import TruthVerdict

UNUSABLE = 4
"""Exit status of `check` and `audit` where the truth is not trusted, or this is unknown."""
_JSON, _JSON_FILE = "--json", "--json-file"


def _remember_debug(context: typer.Context, value: bool) -> bool:
    context.obj.debug = value
    return value


AcceptTruthOption = Annotated[
    bool, typer.Option("--accept-truth", help="Use numbers although the truth is not trusted, or this is unknown.")
]


def require_truth(truth: "TruthVerdict", whose: str, *, accepted: bool) -> None:
    """Refuse numbers for estimators from a truth that is not trusted, unless that is accepted; always of wrong tracks.

    Raises
    ------
    SettingsError
        If it is not.
    """
    if truth.are_tracks_wrong:
        raise SettingsError(f"{whose}: {truth.sentence} Expected tracks that follow the images")
    if not (truth.is_usable or accepted):
        expected = "Expected a trusted or limited truth, or --accept-truth to use the numbers"
        raise SettingsError(f"{whose}: {truth.sentence} {expected}")


def processes(workers: int | None) -> int:
    """Number of worker processes: as requested, otherwise one per core."""
    return workers or os.cpu_count() or 1


def parse_frames(text: str | None) -> int | list[int] | None:
    """Number of frames, or first, last and step; None where the option is not given."""
    return None if text is None else frames_of("--frames", text)


def parse_names(text: str) -> list[str]:
    """Names separated by commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def _remember_quiet(context: typer.Context, value: bool) -> bool:
    context.obj.quiet = value
    return value


DebugOption = Annotated[
    bool, typer.Option("--debug", help="Show a traceback on errors.", callback=_remember_debug, is_eager=True)
]
QuietOption = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print results and errors only.", callback=_remember_quiet, is_eager=True)
]
WorkersOption = Annotated[
    int | None, typer.Option("--workers", "-w", min=1, help="Worker processes (default: one per core).")
]
ScenesOption = Annotated[int | None, typer.Option("--scenes", min=1, help="Maximum number of scenes, sorted by name.")]
FramesOption = Annotated[
    str | None,
    typer.Option(
        "--frames",
        metavar="N|FIRST:LAST[:STEP]",
        help="Maximum number of frames per scene, or which frames, counted from 0, the last included.",
    ),
]
SpeedsOption = Annotated[str | None, typer.Option("--speeds", help="Speeds, separated by commas: 1,2,4.")]
TrackersOption = Annotated[
    str | None,
    typer.Option("--trackers", help="Trackers by name or kind, separated by commas: lucas-kanade,correspondence."),
]
ModelsOption = Annotated[
    Path | None, typer.Option("--models", help="Folder of Gazebo models, for simulated worlds that use them.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        help="Use the workers of the Dask scheduler at this address: tls://HOST:8786, or tcp:// in a trusted network "
        "(extra: cluster).",
    ),
]
TableOption = Annotated[
    bool, typer.Option("--table", help="Print the numbers of every tracker and speed in place of the answer.")
]
FreshOption = Annotated[bool, typer.Option("--fresh", help="Delete the run in this folder and start a new one.")]
JsonOption = Annotated[bool, typer.Option(_JSON, help="Print the result as one JSON document, and nothing else.")]
JsonFileOption = Annotated[
    Path | None, typer.Option(_JSON_FILE, metavar="PATH", help="Write the same JSON document to this file.")
]


class JsonCommand(typer.core.TyperCommand):
    """A command whose ``--json`` is a flag: a file after it is refused, with the option that takes one."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse arguments."""
        for option, following in pairwise([*args, "-"]):
            if option.startswith(f"{_JSON}="):
                _refuse_file(option.partition("=")[2])
            if option == _JSON and _is_new_file(following):
                _refuse_file(following)
        return super().parse_args(ctx, args)


def require_values(arguments: Iterable[str]) -> None:
    """Refuse empty arguments: an empty path would be the current folder.

    Raises
    ------
    SettingsError
        If there is one; the message shows what is before it.
    """
    before = "tracknoise"
    for argument in arguments:
        option, equals, value = argument.partition("=")
        if not argument or (option.startswith("--") and equals and not value):
            place = option or before
            raise SettingsError(f"{place}: found an empty value, expected a path, a name or a number after {place}")
        before = argument


def _is_new_file(word: str) -> bool:
    """Whether a word can only be meant as a file to write: no option, no name of a format, and nothing to read."""
    path = Path(word)
    is_name = len(path.parts) == 1 and not path.suffix
    return path.suffix == ".json" or not (word.startswith("-") or is_name or path.exists())


def _refuse_file(word: str) -> None:
    raise SettingsError(f"{_JSON} {word}: {_JSON} prints to standard output, expected {_JSON_FILE} {word}")


def write_json(terminal: Terminal, document: str, *, as_json: bool, file: Path | None) -> None:
    """Print a JSON document if it is asked for, and write it to a file if one is given."""
    from tracknoise.tables.files import write_atomically

    if as_json:
        terminal.result(document.rstrip())
    if file is not None:
        write_atomically(file, f"{document.rstrip()}\n".encode())
        terminal.say(f"written: {file.resolve()}")
