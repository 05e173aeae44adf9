"""Arguments that name a recording: a format and a path, or a path alone whose format is recognised."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from tracknoise.sequences.sequence import Reader
    from tracknoise.sequences.sequence import Sequence as Images

RecordingArgument = Annotated[
    list[str], typer.Argument(metavar="[READER] PATH", help="Folder of the recording; its format may come first.")
]
OptionOption = Annotated[
    list[str] | None,
    typer.Option(
        "--option",
        metavar="NAME=VALUE",
        help="Option of the reader, or depth=stereo: depth from a second camera. Can be repeated.",
    ),
]
_DEPTH, _DEPTHS = "depth", ("recorded", "stereo")
"""The option that is none of the reader: the key of the section `truth` of an experiment."""


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording that was named on the command line.

    Attributes
    ----------
    reader, path
        Its reader, and the path of its data; None where the reader needs none.
    options
        Options of the reader that were given.
    stereo
        Whether depth is computed from a second camera, in place of recorded depth; None where nothing was said.
    """

    reader: "Reader"
    path: Path | None
    options: dict[str, object]
    stereo: bool | None

    def view(self, sequence: "Images") -> "Images":
        """A sequence of the reader, with the depth that was asked for."""
        from tracknoise.sequences.stereo import with_stereo_depth

        return with_stereo_depth(sequence) if self.stereo else sequence


def named_recording(words: Sequence[str]) -> tuple[str, Path | None]:
    """Name of the reader and path of the data, from one or two arguments."""
    from tracknoise.exceptions import SettingsError
    from tracknoise.sequences.reader_registry import READERS
    from tracknoise.sequences.recognise import recognise

    if len(words) > 2:
        raise SettingsError(f"found {len(words)} arguments, expected a format and a path, or a path alone")
    if len(words) == 2:
        return words[0], Path(words[1])
    (word,) = words
    if word in READERS and not READERS.load(word).needs_root:
        return word, None
    return recognise(Path(word)), Path(word)


def open_recording(words: Sequence[str], options: Sequence[str] | None) -> Recording:
    """The recording that arguments and options name."""
    from tracknoise.sequences.reader_registry import make_reader

    name, path = named_recording(words)
    given = options_of(options)
    asked = not _is_of_reader(name) and _DEPTH in given
    stereo = _is_stereo(given.pop(_DEPTH)) if asked else None
    return Recording(make_reader(name, path, given), path, given, stereo)


def _is_of_reader(name: str) -> bool:
    """Whether a reader of another package has an option of this name itself."""
    from tracknoise.sequences.reader_registry import READERS

    return _DEPTH in getattr(READERS.load(name), "__dataclass_fields__", {})


def _is_stereo(depth: object) -> bool:
    from tracknoise.exceptions import SettingsError

    if depth not in _DEPTHS:
        raise SettingsError(f"--option {_DEPTH}={depth}: expected {' or '.join(_DEPTHS)}")
    return depth == _DEPTHS[1]


def options_of(texts: Sequence[str] | None) -> dict[str, object]:
    """Options of the reader by name, from ``NAME=VALUE``."""
    return dict(map(_option, texts or ()))


def _option(text: str) -> tuple[str, object]:
    """Name and value of an option; what is not TOML is a string."""
    from tracknoise.exceptions import SettingsError
    from tracknoise.text import parse_toml

    name, equals, value = text.partition("=")
    if not equals:
        raise SettingsError(f"--option {text!r}: no '=', expected NAME=VALUE")
    try:
        return name, parse_toml(f"value = {value}")["value"]
    except ValueError as error:
        if isinstance(error.__cause__, tomllib.TOMLDecodeError):
            return name, value
        raise SettingsError(f"--option {name}: {error}") from error
