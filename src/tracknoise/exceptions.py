"""Everything tracknoise raises or warns about on purpose: one root each, so that a caller can catch it all."""

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path


class TracknoiseError(Exception):
    """Root of every error that is about the user's input rather than a defect of the program."""


class DataError(TracknoiseError):
    """Input data is missing, damaged or contradicts itself.

    Parameters
    ----------
    place
        Where: a file, or ``file:line``.
    found
        What was there.
    expected
        What should have been there.
    """

    def __init__(self, place: str | Path, found: str, expected: str) -> None:
        super().__init__(place, found, expected)
        self.place, self.found, self.expected = str(place), found, expected

    def __str__(self) -> str:
        return f"{self.place}: {self.found}, expected {self.expected}"


class SettingsError(TracknoiseError):
    """A setting that the user wrote has an unknown name, a wrong type or an impossible value."""


class UnknownNameError(TracknoiseError):
    """A name (tracker, reader, scene, preset, ...) that is not among the known ones."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind, self.name, self.known = kind, name, sorted(known)
        super().__init__(kind, name, self.known)

    def __str__(self) -> str:
        close = get_close_matches(self.name, self.known, n=1)
        hint = f" (did you mean {close[0]!r}?)" if close else ""
        return f"unknown {self.kind} {self.name!r}{hint}; known: {', '.join(self.known) or 'none'}"


class TrackerError(TracknoiseError):
    """A tracker broke its protocol, so that what it reported cannot be used."""


class SchemaError(TracknoiseError):
    """A table does not have the columns or types that its schema states."""


class StoreError(TracknoiseError):
    """A run folder cannot be used: it is missing, damaged, or belongs to another experiment."""


class FigureError(TracknoiseError):
    """A figure cannot be drawn from what a run holds."""


class DataWarning(UserWarning):
    """The input was usable only after a correction, which the message names with its size."""
