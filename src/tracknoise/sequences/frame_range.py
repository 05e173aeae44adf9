"""A range of frames, as settings and the command line state it: first, last and step, the last included."""

from collections.abc import Sequence as Items
from numbers import Integral

from tracknoise.exceptions import DataError, SettingsError

EXPECTED = "first, last and step: whole numbers with 0 <= first < last and step >= 1"
_FEWEST, _PARTS = 2, (2, 3)


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
    """Frames of a sequence that are chosen.

    Parameters
    ----------
    frames
        First, last and step; the step is 1 if it is missing. The last may lie beyond the end of the sequence.
    count
        Number of frames of the sequence.
    place
        Origin of the sequence, for messages.

    Raises
    ------
    SettingsError
        If `frames` is not a range.
    DataError
        If fewer than two frames of the sequence are in it.
    """
    require_range(frames)
    first, last, step = [*frames, 1][:3]
    chosen = range(first, min(last + 1, count), step)
    if len(chosen) < _FEWEST:
        found = f"{count} frames, of which frames {first} to {last} in steps of {step} have {len(chosen)}"
        raise DataError(place, found, f"at least {_FEWEST}, so that features can be tracked")
    return chosen


def range_note(frames: range, count: int) -> str:
    """A sentence about the frames that were chosen of a sequence of `count` frames."""
    steps = "" if frames.step == 1 else f" in steps of {frames.step}"
    return f"frames {frames[0]} to {frames[-1]}{steps} of {count} are used; here they are numbered from 0"
