"""A range of frames, as settings and the command line state it: first, last and step, the last included."""

from collections.abc import Sequence as Items
from numbers import Integral

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.text import counted

EXPECTED = "first, last and step: whole numbers with 0 <= first < last and step >= 1"
_FEWEST, _PARTS = 2, (2, 3)
_MOST_DIGITS = 15


def frames_of(name: str, text: str) -> int | list[int]:
    """Number of frames, or first, last and step, from a text: ``60``, ``0:59`` or ``0:59:2``.

    Parameters
    ----------
    name
        What is set, for messages: an option of the command line, or a key of a file.
    text
        What it is set to.

    Raises
    ------
    SettingsError
        If it is neither. That the numbers are a range is left to `require_range`.
    """
    parts = parse_numbers(name, text, ":", "a number from 2, or FIRST:LAST or FIRST:LAST:STEP")
    if len(parts) > 1:
        return parts
    if parts[0] < _FEWEST:
        raise SettingsError(f"{name} {text}: expected at least {_FEWEST}")
    return parts[0]


def parse_numbers(name: str, text: str, between: str, expected: str) -> list[int]:
    """Whole numbers of a text.

    Parameters
    ----------
    name
        What is set, for messages: an option of the command line, or a key of a file.
    text
        Numbers of at most 15 digits; spaces around them do not count.
    between
        What separates them.
    expected
        What was expected, for messages.

    Raises
    ------
    SettingsError
        If a part is not a whole number.
    """
    parts = [part.strip() for part in text.split(between)]
    if not all(part.isascii() and part.isdigit() and len(part) <= _MOST_DIGITS for part in parts):
        raise SettingsError(f"{name} {text}: expected {expected}")
    return [int(part) for part in parts]


def require_range(frames: Items[int]) -> None:
    """Check that numbers are first, last and, if given, step.

    Raises
    ------
    SettingsError
        If they are not.
    """
    numbers = _whole_numbers(frames)
    first, last, step = [*numbers, 1][:3] if len(numbers) in _PARTS else (0, 0, 0)
    if not (0 <= first < last and step >= 1):
        raise SettingsError(f"frames = {numbers or frames}, expected {EXPECTED}")


def _whole_numbers(frames: object) -> list[int]:
    """The numbers of a range; none where they are not whole, or where it is no list."""
    given = list(frames) if isinstance(frames, Items) else []
    return given if all(isinstance(number, Integral) for number in given) else []


def frame_range(frames: Items[int], count: int, place: str) -> range:
    """Frames of a sequence that are chosen. `frames`: the step is 1 if it is missing."""
    require_range(frames)
    first, last, step = [*frames, 1][:3]
    chosen = range(first, min(last + 1, count), step)
    if len(chosen) < _FEWEST:
        found = f"{counted(count, 'frame')}, of which frames {first} to {last} in steps of {step} have {len(chosen)}"
        raise DataError(place, found, f"at least {_FEWEST}, so that features can be tracked")
    return chosen


def range_note(frames: range, count: int) -> str:
    """A sentence about the frames that were chosen of a sequence of `count` frames."""
    steps = "" if frames.step == 1 else f" in steps of {frames.step}"
    return f"frames {frames[0]} to {frames[-1]}{steps} of {count} are used; here they are numbered from 0"
