"""Arguments that name a recording: a format and a path, or a path alone whose format is recognised."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from tracknoise.sequences.sequence import Reader

RecordingArgument = Annotated[
    list[str], typer.Argument(metavar="[READER] PATH", help="Folder of the recording; its format may come first.")
]
OptionOption = Annotated[
    list[str] | None, typer.Option("--option", metavar="NAME=VALUE", help="Option of the reader. Can be repeated.")
]


def named_recording(words: Sequence[str]) -> tuple[str, Path | None]:
    """Name of the reader and path of the data, from one or two arguments.

    Raises
    ------
    SettingsError
        If there are more than two.
    DataError
        If there is nothing at the path, or its format is unknown.
    """
    from tracknoise.exceptions import SettingsError
    from tracknoise.sequences.recognise import recognise
    from tracknoise.sequences.registry import READERS

    if len(words) > 2:
        raise SettingsError(f"found {len(words)} arguments, expected a format and a path, or a path alone")
    if len(words) == 2:
        return words[0], Path(words[1])
    (word,) = words
    if word in READERS.names() and not READERS.load(word).needs_root:
        return word, None
    return recognise(Path(word)), Path(word)


def open_reader(words: Sequence[str], options: Sequence[str] | None) -> "tuple[Reader, Path | None]":
    """The reader that arguments and options name, and the path of its data.

    Raises
    ------
    TracknoiseError
        As `named_recording`, or if an option is unknown or has a wrong value.
    """
    from tracknoise.sequences.registry import make_reader

    name, path = named_recording(words)
    return make_reader(name, path, options_of(options)), path


def options_of(texts: Sequence[str] | None) -> dict[str, object]:
    """Options of the reader by name, from ``NAME=VALUE``.

    Raises
    ------
    SettingsError
        If one has no value.
    """
    return dict(map(_option, texts or ()))


def _option(text: str) -> tuple[str, object]:
    """Name and value of an option; what is not TOML is a string."""
    from tracknoise.exceptions import SettingsError

    name, equals, value = text.partition("=")
    if not equals:
        raise SettingsError(f"--option {text!r}: no '=', expected NAME=VALUE")
    try:
        return name, tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return name, value
