"""Options that several commands share, so that they have the same name and help everywhere, and how help shows them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tracknoise.cli.terminal import Terminal
from tracknoise.exceptions import SettingsError
from tracknoise.processes import usable_cores
from tracknoise.sequences.frame_range import frames_of

if TYPE_CHECKING:
    from tracknoise.tables.trust import TruthVerdict

UNUSABLE = 4
"""Exit status of `check` where the truth is not trusted, or this is unknown."""
_JSON = "--json"
UNTRUSTED = "untrusted"
"""What `export --allow` is given for numbers from a truth that is not trusted, or of which this is unknown."""


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
        expected = f"Expected a trusted or limited truth, or --allow {UNTRUSTED} to use the numbers"
        raise SettingsError(f"{whose}: {truth.sentence} {expected}")


def processes(workers: int | None) -> int:
    """Number of worker processes: as requested, otherwise one per core that may be used."""
    return workers or usable_cores()


def parse_frames(text: str | None) -> int | list[int] | None:
    """Number of frames, or first, last and step; None where the option is not given."""
    return None if text is None else frames_of("--frames", text)


def parse_names(text: str) -> list[str]:
    """Names separated by commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def parse_whole(option: str, given: str, least: int = 1) -> int:
    """A whole number that an option was given.

    Raises
    ------
    SettingsError
        If it is another text, or a smaller number.
    """
    if not given.isdecimal() or int(given) < least:
        raise SettingsError(f"{option} {given}: expected a whole number from {least}")
    return int(given)


def _parse_number(option: str, given: str) -> float:
    try:
        return float(given)
    except ValueError as error:
        raise SettingsError(f"{option} {given}: expected a number") from error


def flag(*names: str, help: str) -> Any:
    """An option without a value."""
    return typer.Option(*names, help=help)


def whole(*names: str, help: str, least: int = 1) -> Any:
    """An option whose value is a whole number."""
    return typer.Option(*names, help=help, metavar="N", parser=partial(parse_whole, names[0], least=least))


def number(*names: str, help: str) -> Any:
    """An option whose value is a number."""
    return typer.Option(*names, help=help, metavar="NUMBER", parser=partial(_parse_number, names[0]))


def text(*names: str, metavar: str, help: str) -> Any:
    """An option whose value is a name, a path or another text."""
    return typer.Option(*names, help=help, metavar=metavar)


def _remember_debug(context: typer.Context, value: bool) -> bool:
    context.obj.debug = value
    return value


def _remember_quiet(context: typer.Context, value: bool) -> bool:
    context.obj.quiet = value
    return value


DebugOption = Annotated[
    bool, typer.Option("--debug", help="Show a traceback on errors.", callback=_remember_debug, is_eager=True)
]
QuietOption = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print results and errors only.", callback=_remember_quiet, is_eager=True)
]
WorkersOption = Annotated[int | None, whole("--workers", "-w", help="Worker processes (default: one per core).")]
DataOption = Annotated[Path | None, text("--data", "-d", metavar="FOLDER", help="Folder of the data.")]
RunFolderOption = Annotated[Path | None, text("--out", "-o", metavar="FOLDER", help="Run folder (default: runs/NAME).")]
ScenesOption = Annotated[int | None, whole("--scenes", help="Maximum number of scenes, sorted by name.")]
FramesOption = Annotated[
    str | None,
    text(
        "--frames",
        metavar="N|FIRST:LAST[:STEP]",
        help="First frames of each scene, or a range from 0 on.",
    ),
]
TrackersOption = Annotated[
    str | None, text("--trackers", metavar="NAMES", help="Trackers by name or kind, separated by commas.")
]
FreshOption = Annotated[bool, flag("--fresh", help="Delete the run in this folder and start a new one.")]
JsonOption = Annotated[bool, flag(_JSON, help="Print the result as one JSON document, and nothing else.")]


class _PlainHelp:
    """Help shows the values of options as they are named here, and no types."""

    def get_params(self, ctx: Any) -> list[Any]:
        """All parameters, with the option for help."""
        parameters: list[Any] = super().get_params(ctx)  # type: ignore[misc]
        for parameter in parameters:
            shown = None if parameter.param_type_name == "argument" else parameter.metavar
            parameter.display_type_rich = partial(_shown, shown or "")
        return parameters


def _shown(value: str, ctx: Any) -> str:
    return value


class Command(_PlainHelp, typer.core.TyperCommand):
    """A command. Its ``--json``, if it has one, is a flag: a file after it is refused."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse arguments."""
        if any(_JSON in parameter.opts for parameter in self.params):
            for option, following in pairwise([*args, "-"]):
                if option.startswith(f"{_JSON}="):
                    _refuse_file(option.partition("=")[2])
                if option == _JSON and _is_new_file(following):
                    _refuse_file(following)
        return super().parse_args(ctx, args)


class Commands(_PlainHelp, typer.core.TyperGroup):
    """All commands."""


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
    raise SettingsError(f"{_JSON} {word}: {_JSON} prints to standard output, expected {_JSON} > {word}")


def files_by_ending(paths: Sequence[Path] | None, makers: Iterable[str]) -> dict[str, Path]:
    """The files of ``--out``, each by the ending of its name, which decides what is written.

    Raises
    ------
    SettingsError
        If a name has another ending, or two have the same.
    """
    endings, by_ending = tuple(makers), dict[str, Path]()
    for path in paths or ():
        ending = path.suffix.lower()
        if ending not in endings:
            kinds = f"{', '.join(endings[:-1])} or {endings[-1]}" if len(endings) > 1 else endings[0]
            raise SettingsError(f"--out {path}: found a name that ends in {ending!r}, expected {kinds}")
        if ending in by_ending:
            raise SettingsError(f"--out {path}: found a second {ending} file, expected one of each kind")
        by_ending[ending] = path
    return by_ending


def write_files(files: Mapping[Path, Callable[[], str]], say: Callable[[str], None]) -> None:
    """Write texts to files, and say where they are."""
    from tracknoise.tables.files import write_atomically

    for path, make in files.items():
        write_atomically(path, f"{make().rstrip()}\n".encode())
        say(f"written: {path.resolve()}")


def print_json(terminal: Terminal, document: str) -> None:
    """Print a JSON document."""
    terminal.result(document.rstrip())
