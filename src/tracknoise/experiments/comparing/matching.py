"""Which trackers and conditions of two runs are compared with each other."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.statistics.conditions import Condition
from tracknoise.statistics.definitions import POOLED

_TRACKER, _SPEED = POOLED.index("tracker"), POOLED.index("speed")
_EXPECTED = "trackers of the same name, or one of each run, named by --trackers"
Pair = tuple[Condition, Condition]
"""A condition of the first run, and the one of the second that it is compared with."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Conditions of a run.

    Attributes
    ----------
    name
        Name of the run.
    conditions
        Values of `POOLED`, of everything that was measured.
    """

    name: str
    conditions: frozenset[Condition]

    @property
    def trackers(self) -> set[str]:
        """Names of its trackers."""
        return {str(key[_TRACKER]) for key in self.conditions}

    @property
    def speeds(self) -> set[int]:
        """Its speeds."""
        return {int(key[_SPEED]) for key in self.conditions}


def matched_trackers(first: Measured, second: Measured, asked: tuple[str, str] | None) -> dict[str, str]:
    """Name of the tracker of the second run, by that of the first.

    Parameters
    ----------
    first, second
        The runs.
    asked
        One tracker of each; None for those of the same name.

    Raises
    ------
    UnknownNameError
        If one that is asked for is not in its run.
    SettingsError
        If no tracker is in both runs.
    """
    if asked is None:
        common = {name: name for name in sorted(first.trackers & second.trackers)}
        if not common:
            have = " and ".join(", ".join(sorted(run.trackers)) for run in (first, second))
            pair = f"{first.name} and {second.name} cannot be compared"
            raise SettingsError(f"{pair}: trackers {have}, expected {_EXPECTED}")
        return common
    for run, name in zip((first, second), asked, strict=True):
        if name not in run.trackers:
            raise UnknownNameError(f"tracker of {run.name}", name, run.trackers)
    return {asked[0]: asked[1]}


def matched_conditions(first: Measured, second: Measured, trackers: Mapping[str, str]) -> list[Pair]:
    """Conditions that both runs have, sorted."""
    pairs = [
        (key, _with_tracker(key, trackers[str(key[_TRACKER])]))
        for key in sorted(first.conditions)
        if str(key[_TRACKER]) in trackers
    ]
    return [(key, other) for key, other in pairs if other in second.conditions]


def unmatched(first: Measured, second: Measured, trackers: Mapping[str, str] | None) -> Iterator[str]:
    """Sentences about trackers that take no part, unless None is given, and about speeds that only one run has."""
    if trackers is not None:
        for run, matched in ((first, set(trackers)), (second, set(trackers.values()))):
            for name in sorted(run.trackers - matched):
                yield f"Tracker {name} of {run.name} takes no part."
    for run, only in ((first, first.speeds - second.speeds), (second, second.speeds - first.speeds)):
        for speed in sorted(only):
            yield f"Speed {speed} is in {run.name} only."


def _with_tracker(key: Condition, tracker: str) -> Condition:
    return (*key[:_TRACKER], tracker, *key[_TRACKER + 1 :])
