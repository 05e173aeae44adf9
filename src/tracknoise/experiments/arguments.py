"""Arguments of `tracknoise.measure`, checked: a wrong one ends in a line that says what to write."""

from collections.abc import Iterable, Mapping
from collections.abc import Sequence as Items
from typing import TypeAlias, cast

import numpy as np

from tracknoise.exceptions import SettingsError
from tracknoise.trackers.registry import make_tracker
from tracknoise.trackers.tracker import TrackerSettings

Tracker: TypeAlias = TrackerSettings | str
"""Settings of a tracker, or the name of one of `tracknoise trackers` with its default settings."""
Trackers: TypeAlias = Tracker | Items[Tracker] | Mapping[str, Tracker]


def named_trackers(trackers: Trackers) -> dict[str, TrackerSettings]:
    """Settings of trackers by their names; trackers without a name are named by their kind.

    Raises
    ------
    SettingsError
        If two have the same name, or one is no tracker.
    UnknownNameError
        If there is no tracker of a name.
    """
    if isinstance(trackers, Mapping):
        named = {name: _settings(tracker) for name, tracker in trackers.items()}
    else:
        listed = [_settings(tracker) for tracker in _several(trackers)]
        named = {settings.kind: settings for settings in listed}
        if len(named) < len(listed):
            raise SettingsError("two trackers of one kind, expected a mapping that names them")
    if not named:
        raise SettingsError("no trackers, expected at least one")
    return named


def checked_speeds(speeds: object) -> list[int]:
    """Speeds as a list.

    Raises
    ------
    SettingsError
        If there is none, or they are not different whole numbers from 1 on.
    """
    if not isinstance(speeds, Iterable) or isinstance(speeds, str):
        raise SettingsError(f"speeds = {speeds!r}, expected a list, such as [1] or [1, 2]")
    listed = list(speeds)
    known = [int(speed) for speed in listed if type(speed) is int or isinstance(speed, np.integer)]
    if not known or len(set(known)) < len(listed) or min(known) < 1:
        raise SettingsError(f"speeds = {listed}, expected different whole numbers of 1 or more, such as [1, 2]")
    return known


def require_sequences(sequences: Items[object]) -> None:
    """Check that what is measured are sequences.

    Raises
    ------
    SettingsError
        If one is not.
    """
    for sequence in sequences:
        if isinstance(sequence, str | type) or not hasattr(sequence, "image"):
            expected = "a sequence, from tracknoise.open_sequence or tracknoise.Sequence.from_arrays"
            raise SettingsError(f"found {sequence!r}, expected {expected}")


def _several(trackers: object) -> Iterable[object]:
    return trackers if isinstance(trackers, Iterable) and not isinstance(trackers, str | type) else [trackers]


def _settings(tracker: object) -> TrackerSettings:
    if isinstance(tracker, str):
        return make_tracker(tracker)
    if isinstance(tracker, type):
        raise SettingsError(f"found the class {tracker.__name__}, expected an instance: {tracker.__name__}()")
    if not hasattr(tracker, "start") or not hasattr(tracker, "kind"):
        raise SettingsError(f"found {tracker!r}, expected settings of a tracker, such as tracknoise.LucasKanade()")
    return cast(TrackerSettings, tracker)
