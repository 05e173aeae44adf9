"""Exceptions and warnings of tracknoise. All exceptions have one base class."""

import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path

_LONGEST = 1500


class TracknoiseError(Exception):
    """Base class of all errors in the user's input. Other exceptions are defects of the program.

    The message is one line of printable characters, whatever was found in a file: see `one_line`.
    """

    def __str__(self) -> str:
        return one_line(self._message())

    def _message(self) -> str:
        return super().__str__()


class DataError(TracknoiseError):
    """Input data are missing, damaged or inconsistent.

    Parameters
    ----------
    place
        A file, or ``file:line``.
    found
        What was found there.
    expected
        What was expected.
    """

    def __init__(self, place: str | Path, found: str, expected: str) -> None:
        super().__init__(place, found, expected)
        self.place, self.found, self.expected = str(place), found, expected

    def _message(self) -> str:
        return f"{self.place}: {self.found}, expected {self.expected}"


class NothingToMeasureError(DataError):
    """Input data are sound, but show nothing that could be measured: no pose, no feature or no depth."""


class SettingsError(TracknoiseError):
    """A setting has an unknown name, a wrong type or an invalid value."""


class InvalidValueError(SettingsError, ValueError):
    """A field of settings has a value that it cannot have. A ValueError too, which libraries of settings expect."""


def missing_extra(what: str, extra: str) -> SettingsError:
    """The error of what needs an extra that is not installed."""
    return SettingsError(f"{what}: needs the extra `{extra}`: pip install 'tracknoise[{extra}]'")


class UnknownNameError(TracknoiseError):
    """A name (tracker, reader, scene, preset, ...) is unknown.

    `aliases`: known names by others that people use, which may be none; then abbreviations are understood too.
    """

    def __init__(
        self, kind: str, name: object, known: Iterable[object], aliases: Mapping[str, str] | None = None
    ) -> None:
        self.kind, self.name, self.known = kind, name, sorted(map(str, known))  # members of enumerations too
        self.aliases = aliases
        super().__init__(kind, name, self.known, self.aliases)

    def _message(self) -> str:
        is_text = isinstance(self.name, str)
        name = str(self.name) if is_text else self.name  # a member of an enumeration as its text
        hint = did_you_mean(name, self.known, self.aliases) if isinstance(name, str) else ""
        return f"unknown {self.kind} {name!r}{hint}; known: {', '.join(self.known) or 'none'}"


_SHORTEST = 2
"""A shorter name is the beginning, or the initials, of too many."""


def did_you_mean(name: str, known: Iterable[str], aliases: Mapping[str, str] | None = None) -> str:
    """`` (did you mean 'lucas-kanade'?)`` for ``lucas``, ``lk`` or a misspelling; empty where no name is like it.

    Without `aliases`, only what is spelt much alike. Otherwise, in this order, whatever the case and the signs: an
    alias, what begins with the name, what is spelt much alike, what has these initials, what has a word that begins
    with it, what the name begins with.
    """
    names, spelt = list(known), _plain(name)
    alike = get_close_matches(name, names, n=1) or get_close_matches(name.lower(), names, n=1)
    if aliases is None:
        return f" (did you mean {alike[0]!r}?)" if alike else ""
    words = {choice: [part for part in re.split(r"[^a-z0-9]+", choice.lower()) if part] for choice in names}
    is_long = len(spelt) >= _SHORTEST
    suggestions = [
        *filter(None, [aliases.get(spelt)]),
        *sorted((choice for choice in names if is_long and _plain(choice).startswith(spelt)), key=len),
        *alike,
        *(choice for choice in names if is_long and spelt == "".join(part[0] for part in words[choice])),
        *(choice for choice in names if is_long and any(part.startswith(spelt) for part in words[choice])),
        *(choice for choice in names if len(_plain(choice)) > _SHORTEST and spelt.startswith(_plain(choice))),
    ]
    return f" (did you mean {suggestions[0]!r}?)" if suggestions else ""


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


class TrackerError(TracknoiseError):
    """A tracker violated its protocol, and its result cannot be used."""


class SchemaError(TracknoiseError):
    """A table does not have the columns or types of its schema."""


class StoreError(TracknoiseError):
    """A run folder cannot be used: it is missing or damaged, or belongs to another experiment."""


class FigureError(TracknoiseError):
    """A figure cannot be drawn from what a run holds."""


class DataWarning(UserWarning):
    """Input data had to be corrected. The message states the correction and its size."""


def one_line(text: str) -> str:
    """Text with its control characters escaped, and shortened in the middle if it is very long."""
    if not text.isprintable():
        text = "".join(part if part.isprintable() else part.encode("unicode_escape").decode() for part in text)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"


def with_type(error: BaseException) -> str:
    """Type of an error, and what it says if it says something."""
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def first_line(error: BaseException) -> str:
    """First line of what a library says about an error, without a full stop; its type if it says nothing."""
    lines = str(error).strip().splitlines()
    return lines[0].strip().removesuffix(".") if lines else type(error).__name__
