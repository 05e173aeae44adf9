"""What is compared between two runs, and the rows of the result.

All statistics are differences within scenes, averaged over scenes of equal weight. Scales, shares of events, lifetimes
and counts are compared as ratios: geometric means over scenes. Two runs are the levels of a factor, whose changes have
a direction (`tracknoise.analysis.paired_tests`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tracknoise.analysis.paired_tests import (
    AT_LEAST,
    DISAGREE,
    FALLS,
    GROWS,
    Change,
    Unit,
    ask,
    change,
    why_not_asked,
)
from tracknoise.inference.paired_differences import Differences
from tracknoise.inference.units import MIN_SCENES, Resampled
from tracknoise.tables.enumerations import ChangeVerdict, ComparedAges
from tracknoise.tables.quantities import QUANTITIES, RATIOS, Better, ComparedBy
from tracknoise.tables.trust import TruthVerdict
from tracknoise.words import only, place


@dataclass(frozen=True, slots=True)
class Estimand:
    """One statistic.

    Attributes
    ----------
    title
        For readers.
    meaning
        What is estimated.
    unit
        Unit of the effect.
    larger_is_better
        Whether a larger value is better.
    """

    title: str
    meaning: str
    unit: Unit = Unit.ratio
    larger_is_better: bool = False


_MEAN = "geometric mean over scenes, ages (or frames) and both coordinates"
_TAP = "as TAP-Vid defines it for images of 256 x 256 pixels, mean over scenes"

ESTIMANDS: Mapping[str, Estimand] = {
    "core": Estimand("core of the errors", f"Robust standard deviation of the errors of a scene: {_MEAN}."),
    "second_moment": Estimand("second moment", f"Second moment of all errors about zero, untrimmed: {_MEAN}."),
    "bias": Estimand(
        "bias",
        "Size of the mean error in u or v, mean over scenes, at the age (or frame) that changed most clearly.",
        Unit.px,
    ),
    "tails": Estimand(
        "tails",
        "Share of the errors of a scene that are larger than three cores of their age, all ages together: geometric "
        "mean over scenes and both coordinates.",
    ),
    "growth": Estimand(
        "growth",
        "Factor by which the second moment grows from the youngest to the oldest age, by a straight line through "
        "logarithms: geometric mean over scenes and both coordinates.",
    ),
    "outlier_ratio": Estimand(
        "outlier ratio", "Features rejected as outliers, divided by features offered: geometric mean over scenes."
    ),
    "lifetime": Estimand(
        "lifetime",
        "Restricted mean lifetime to a horizon that all scenes reach in both runs: geometric mean over scenes.",
        larger_is_better=True,
    ),
    "feature_count": Estimand(
        "feature count", "Mean number of features per frame: geometric mean over scenes.", larger_is_better=True
    ),
    "consistent_sigma": Estimand(
        "sigma for depths",
        "Consistent sigma, which makes depths of points right, of the longest windows up to 15 observations that "
        "enough scenes of both runs have: geometric mean over scenes.",
    ),
    "residual_sigma": Estimand(
        "residual core",
        "Residual core of windows of observations: geometric mean over scenes and lengths of windows.",
    ),
    "overconfidence": Estimand(
        "overconfidence",
        "Consistent sigma of windows, divided by their residual core: geometric mean over scenes and lengths.",
    ),
    "tap_delta_avg": Estimand("position accuracy (TAP)", f"Delta average, {_TAP}.", Unit.share, larger_is_better=True),
    "tap_delta_avg_reported": Estimand(
        "accuracy of reported positions",
        f"Delta average of the positions that are reported as visible, {_TAP}.",
        Unit.share,
        larger_is_better=True,
    ),
    "tap_average_jaccard": Estimand(
        "average Jaccard (TAP)", f"Average Jaccard, {_TAP}.", Unit.share, larger_is_better=True
    ),
    "tap_occlusion_accuracy": Estimand(
        "occlusion accuracy (TAP)", f"Occlusion accuracy, {_TAP}.", Unit.share, larger_is_better=True
    ),
    "expected_feature_age": Estimand(
        "expected feature age",
        "Share of its visible time for which a point is tracked, in images of 256 x 256 pixels, mean over scenes.",
        Unit.share,
        larger_is_better=True,
    ),
    **{
        name: Estimand(
            QUANTITIES[name].title.lower(),
            f"{QUANTITIES[name].estimand} Untrimmed, mean over scenes and ages.",
            Unit.ratio if QUANTITIES[name].compared == ComparedBy.ratio else Unit.share,
            larger_is_better=QUANTITIES[name].better == Better.larger,
        )
        for name in RATIOS
        if QUANTITIES[name].compared != ComparedBy.none
    },
}
"""By name, in the order in which they are reported."""
OF_ERRORS = ("core", "second_moment", "bias", "tails", "growth", *RATIOS)
"""Statistics of errors. Without meaning where true positions are fitted to the tracks."""


class OfStatistic:
    """Anything about one of the `ESTIMANDS`.

    Attributes
    ----------
    statistic
        Its name.
    """

    __slots__ = ()
    statistic: str

    @property
    def estimand(self) -> Estimand:
        """What is estimated."""
        return ESTIMANDS[self.statistic]


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
        P-value of the hypothesis that nothing changes by more than the margin, and that by Holm over all rows of its
        family (`tracknoise.analysis.factors.family`).
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
    truth
        The verdict on the truth of the run.
    """

    name: str
    path: str
    differs: tuple[tuple[str, str, str], ...] = ()
    notes: tuple[str, ...] = ()
    truth: TruthVerdict = field(default_factory=TruthVerdict)


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

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is said of the truth of each run whose truth is not trusted, or of which this is unknown."""
        sides = (self.first, *self.others)
        return tuple(f"{side.name}: {side.truth.sentence}" for side in sides if not side.truth.is_usable)


def place_words(axis: str, at: int) -> str:
    """Write an age, a distance from the key frame or a length of windows: ``at age 10``, ``in windows of 5``.

    Parameters
    ----------
    axis, at
        As in `Row`.
    """
    return f"in windows of {at}" if axis == "window" else place(axis, at)


@dataclass(frozen=True, slots=True)
class Asked(OfStatistic):
    """A statistic of a condition in two runs.

    Attributes
    ----------
    of
        What is compared.
    statistic
        A key of `ESTIMANDS`.
    values
        Second run minus first run, paired by scene.
    scenes
        Names of the scenes.
    group : (scenes,)
        Number of the group of each scene.
    axis
        What the places of the values are.
    by_kind
        The values by each kind of reference tracks alone; none where poses were not refined.
    """

    of: Compared
    statistic: str
    values: Differences
    scenes: Sequence[str]
    group: NDArray[np.intp]
    axis: str | None = None
    by_kind: Sequence[Differences] = ()

    @property
    def worse(self) -> int:
        """Direction of a change for the worse."""
        return FALLS if self.estimand.larger_is_better else GROWS

    @property
    def n_scenes(self) -> int:
        """Number of scenes that were measured in both runs."""
        return int(self.values.both.sum())

    def tested(self, margin: float, *, level: float, ages: ComparedAges) -> "Tested":
        """Test both directions against a margin, of logarithms for ratios and otherwise in the unit."""
        question = ask(self.values.both, self.group, margin=margin, level=level)
        if question is None:
            return Tested(None, None, self._too_few())
        found, *alone = (change(values, question, ages) for values in (self.values, *self.by_kind))
        gap = self._gap(found)
        if found is None or not alone:
            return Tested(found, question.resampled, gap)
        held, is_apart = found.held_by(alone, level)
        trackers = dict.fromkeys((self.of.tracker, self.of.other_tracker))
        return Tested(held, question.resampled, f"{DISAGREE} {' and '.join(trackers)}" if is_apart else gap)

    def _too_few(self) -> str:
        if self.n_scenes < MIN_SCENES:
            return f"{only(self.n_scenes, 'scene')} with data in both runs; {AT_LEAST}"
        return why_not_asked(self.values.both, self.group)

    def _gap(self, found: Change | None) -> str | None:
        if found is None:
            with_data = int((~np.isnan(self.values.values)).any(axis=(1, 2)).sum())
            return f"{only(with_data, 'scene')} with enough data in both runs; {AT_LEAST}"
        if (self.values.unlike[0] & found.compared).any():
            return "a value of 0 in one of the runs, which has no ratio"
        return None


@dataclass(frozen=True, slots=True)
class Tested:
    """Outcome of the tests.

    Attributes
    ----------
    found
        Tests and effect; None without enough data.
    resampled
        What intervals are about.
    gap
        Why nothing can be shown to be within the margin, if so, or that references of the two kinds disagree.
    """

    found: Change | None
    resampled: Resampled | None
    gap: str | None
