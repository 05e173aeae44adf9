"""The result of a comparison as plain data."""

from collections.abc import Mapping
from dataclasses import dataclass

from tracknoise.findings.comparison.estimands import OfStatistic
from tracknoise.findings.wording import place
from tracknoise.tables.enumerations import ChangeVerdict, ComparedAges


@dataclass(frozen=True, slots=True)
class Compared:
    """What is compared: a condition and its trackers in two runs.

    Attributes
    ----------
    run
        Name of the second run. The first is that of the comparison.
    tracker, other_tracker
        Name of the tracker in the first and in the second run.
    dataset, lighting, rotation, direction, camera, speed
        The condition.
    """

    run: str
    tracker: str
    other_tracker: str
    dataset: str
    lighting: str
    rotation: int
    direction: str
    camera: str
    speed: int


@dataclass(frozen=True, slots=True)
class Row(OfStatistic):
    """One statistic of one condition.

    Attributes
    ----------
    of
        What is compared.
    statistic
        A key of `ESTIMANDS`.
    verdict, why
        The answer, and why it is undecided, or what else is to be known of it.
    effect, low, high
        Second run over, or minus, the first in the unit of the estimand, and its interval. None without data.
    margin
        Largest change that counts as no difference, in the same unit.
    at, coordinate
        Age (or distance from the key frame, or length of windows) and coordinate of the effect; None for the mean over
        all.
    at_low, at_high
        Least and largest age, frame or length of windows that was compared; None for single numbers.
    axis
        What these are: ``age``, ``frame`` or ``window``; None for single numbers.
    horizon
        Horizon of lifetimes, frames.
    p_change, p_adjusted
        P-value of the hypothesis that nothing changes by more than the margin, and that by Holm over all rows.
    p_none
        P-value of the hypothesis that something changes by at least the margin.
    n_scenes
        Scenes that were measured in both runs.
    resampled
        What intervals are about: ``scenes``, ``groups`` of scenes, or scenes ``within`` their groups.
    scenes
        The effect in every scene that has one.
    """

    of: Compared
    statistic: str
    verdict: ChangeVerdict
    why: str | None
    effect: float | None
    low: float | None
    high: float | None
    margin: float | None
    at: int | None
    coordinate: str | None
    at_low: int | None
    at_high: int | None
    axis: str | None
    horizon: float | None
    p_change: float | None
    p_adjusted: float | None
    p_none: float | None
    n_scenes: int
    resampled: str | None
    scenes: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class RunSide:
    """One of the runs.

    Attributes
    ----------
    name
        Name by which rows refer to it.
    path
        Its folder.
    differs
        Settings and versions of packages that differ from those of the first run: name, there, here.
    notes
        What the comparison leaves out, one sentence each.
    """

    name: str
    path: str
    differs: tuple[tuple[str, str, str], ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class GateRow(OfStatistic):
    """Outcome of one tolerance in one condition.

    Attributes
    ----------
    of, statistic
        As in `Row`.
    tolerance
        Largest change for the worse that passes: relative for ratios, otherwise in the unit.
    outcome
        ``pass``, ``worse`` or ``undecided``.
    why
        Reason of an undecided outcome.
    effect, low, high
        As in `Row`.
    """

    of: Compared
    statistic: str
    tolerance: float
    outcome: str
    why: str | None
    effect: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class GateResult:
    """Outcome of a gate.

    Attributes
    ----------
    outcome
        ``pass`` if all rows pass, ``worse`` if one is worse, otherwise ``undecided``.
    rows
        One per tolerance and condition.
    missing
        What a gate needs and the runs lack, one sentence each; with any of them, the outcome is never ``pass``.
    """

    outcome: str
    rows: tuple[GateRow, ...]
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Runs compared with the first of them.

    Attributes
    ----------
    first
        The run that the others are compared with.
    others
        The others.
    rows
        One per statistic, condition and run.
    margin, level, ages
        How verdicts were made.
    gate
        Outcome of the gate, if there was one.
    """

    first: RunSide
    others: tuple[RunSide, ...]
    rows: tuple[Row, ...]
    margin: float
    level: float
    ages: ComparedAges
    gate: GateResult | None = None


def place_words(axis: str, at: int) -> str:
    """Write an age, a distance from the key frame or a length of windows: ``at age 10``, ``in windows of 5``.

    Parameters
    ----------
    axis, at
        As in `Row`.
    """
    return f"in windows of {at}" if axis == "window" else place(axis, at)
