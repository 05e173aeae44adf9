"""What the paper claims, judged by what a run measured under three readings of its trimming.

- The paper's claims as data: every cell of its summary tables, and the claims of its abstract, text and captions.
- What several claims need of a run: its trackers by kind, and points of its curves.
- Judges claims that a factor changes a statistic: the cells of the paper's summary tables.
- Judges claims on drift and on where curves end.
- Judges claims on outlier ratios and on the distribution of errors.
- Judges claims that compare error sizes: between speeds, and between two experiments.
- Judges any claim by the tables of the runs that repeat the paper's experiments.
- Verdicts on the paper's claims under every reading of its trimming: as tables, as text and as CSV.
"""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cache
from math import inf, log
from typing import Any

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.inference.multiple_tests import chosen_among
from tracknoise.inference.units import MIN_WITHIN, Resampled
from tracknoise.report import paper
from tracknoise.report.cells import Cells
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.tables.defaults import MARGIN
from tracknoise.tables.enumerations import Aspect, Reading, Shape, Verdict, Weighting
from tracknoise.topics.bias_topic import has_bias
from tracknoise.topics.shape_topic import shapes_of
from tracknoise.words import DASH, STATISTICS, effect_text, format_estimate, listing, number, percent, size_text


class Agreement(StrEnum):
    """Verdict on a claim.

    agrees: in direction and size, as far as the claim states them. opposite: the effect is there with the opposite
    sign. disagrees: the effect is not there, or has another size. open: the run cannot tell.
    """

    agrees = "agrees"
    opposite = "opposite sign"
    disagrees = "disagrees"
    open = "cannot be judged"


@dataclass(frozen=True, slots=True)
class Judgement:
    """Verdict on a claim under one reading."""

    agreement: Agreement  # the verdict
    value: str = ""  # what was measured, with its interval where there is one; empty where nothing was
    reason: str = ""  # why; empty where the value says it all


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim."""

    id: str  # unique within an experiment
    experiment: str  # of the paper
    kind: str  # how it is judged: a name in `tracknoise.paper.claim_verdicts`
    text: str  # what is claimed
    source: str  # where it stands in the paper
    note: str = ""  # what is not on record about it; empty where nothing is missing
    stated: Mapping[str, Any] = field(default_factory=dict)  # what is compared, by kind


@cache
def claims() -> tuple[Claim, ...]:
    """Claims of abstract, text, figures and captions, in the order of the experiments."""
    order = list(paper.findings())
    all_claims = [stated_claim for entry in paper.stated_claims() for stated_claim in _of_entry(entry)]
    return tuple(sorted(all_claims, key=lambda claim: order.index(claim.experiment)))


@cache
def cells() -> tuple[Claim, ...]:
    """Cells of the summary tables: one for each experiment, factor, statistic and, where it matters, tracker."""
    return tuple(
        _cell(experiment, factor, role, kind, verdict)
        for experiment, tables in paper.findings().items()
        for factor, table in tables.items()
        if factor != "title"
        for role, value in table.items()
        for kind, verdict in _by_tracker(factor, value)
    )


def _of_entry(entry: Mapping[str, Any]) -> Iterator[Claim]:
    """One claim for each of the experiments that an entry names."""
    named = entry["experiment"]
    fields = {name: entry[name] for name in ("id", "kind", "text", "source", "note") if name in entry}
    stated = {name: value for name, value in entry.items() if name not in (*fields, "experiment")}
    for experiment in [named] if isinstance(named, str) else named:
        yield Claim(experiment=experiment, stated=stated, **fields)


def _by_tracker(factor: str, value: str | Mapping[str, str]) -> Iterator[tuple[str | None, str]]:
    """The paper's word for each kind of tracker; for None where the trackers are compared."""
    for kind in (None,) if factor == "tracker" else paper.TRACKERS:
        yield kind, value if isinstance(value, str) else value[kind or ""]


def _cell(experiment: str, factor: str, role: str, kind: str | None, verdict: str) -> Claim:
    whose = f" of {kind}" if kind else ""
    text = f"The {factor} {'changes' if verdict == 'yes' else 'does not change'} the {STATISTICS[role]}{whose}."
    name = "-".join([factor, role, *([kind] if kind else [])])
    stated = {"factor": factor, "role": role, "said": verdict, "rises": _claim_rises(experiment, factor, role, kind)}
    return Claim(name, experiment, "cell", text, "summary table", stated={**stated, "tracker": kind})


def _claim_rises(experiment: str, factor: str, role: str, kind: str | None) -> bool | None:
    """Whether text or captions say that a statistic rises with speed. None where they say nothing."""
    if factor != "speed":
        return None
    criteria = {"kind": "trend", "experiment": experiment, "role": role, "tracker": kind}
    trends = (entry for entry in paper.stated_claims() if all(entry.get(key) == criteria[key] for key in criteria))
    return next((entry["rises"] for entry in trends), None)


Point = Mapping[str, Any]
"""A row of `ReportData.points`."""


def tracker_named(data: ReportData, kind: str) -> str | None:
    """The tracker of a kind that the run names first. None if there is none."""
    entries = data.settings["trackers"]
    names = [entry.get("name") or entry["kind"] for entry in entries if entry["kind"] == kind]
    return next((name for name in names if name in data.trackers), None)


def curve(
    data: ReportData, tracker: str, role: str, *, speed: int | None = None, direction: str | None = None
) -> pl.DataFrame:
    """Points of one curve beyond the place where errors are zero, as the reading trims it, sorted by `since`."""
    points = data.across(data.points, "direction")
    return points.filter(
        pl.col("since") > 0,
        pl.col("speed") == (speed or data.slowest),
        direction=direction or data.view["direction"],
        tracker=tracker,
        role=role,
        trimming=data.trimming,
        population=data.population,
    ).sort("since")


def last(points: pl.DataFrame) -> Point | None:
    """The point farthest from where errors are zero. None where there is no point."""
    return points.row(-1, named=True) if points.height else None


def estimate(point: Point, coordinate: str) -> Estimate:
    """A coordinate of a point with its interval, px."""
    return Estimate(point[coordinate], point[f"{coordinate}_low"], point[f"{coordinate}_high"], unit="px")


def mean_chosen_among(data: ReportData, point: Point, coordinate: str, choices: int) -> Estimate:
    """Mean error of a point in one of its coordinates, px, with an interval that allows for the choice of it."""
    mean = estimate(point, coordinate)
    if choices == 1 or mean.low is None:
        return mean
    condition = {name: point[name] for name in (*POOLED, "population", "trimming", "at")}
    rows = data.intervals.filter(
        aspect=Aspect.all,
        weighting=Weighting.features,
        statistic=NAMES[data.axis.name]["mean"],
        axis=data.axis.name,
        coordinate=coordinate,
        **condition,
    )
    row = rows.row(0, named=True)
    return chosen_among(replace(mean, level=row["level"]), choices, degrees=_degrees(row))


def _degrees(row: Mapping[str, Any]) -> int:
    """Degrees of freedom of an interval of units that hold the same: the least possible ones within groups."""
    if row["resampled"] == Resampled.within:
        return MIN_WITHIN
    strata = row["n_scenes"] if row["resampled"] == Resampled.blocks else 1
    return int(row["n_units"] - strata)


def excludes_zero(one: Estimate) -> bool:
    """Whether an interval is known and does not contain zero."""
    return one.low is not None and one.high is not None and one.low * one.high > 0


def is_within(one: Estimate, most: float) -> bool:
    """Whether an interval is known and all of it is at most so far from zero."""
    return one.low is not None and one.high is not None and max(-one.low, one.high) <= most


def overlap(one: Estimate, other: Estimate) -> bool | None:
    """Whether two intervals overlap. None where one is unknown."""
    if one.low is None or one.high is None or other.low is None or other.high is None:
        return None
    return one.low <= other.high and other.low <= one.high


def at_place(data: ReportData, one: Estimate, since: int) -> str:
    """An estimate with the place that it is of."""
    return f"{format_estimate(one)} {data.axis.place(since)}"


_UNKNOWN_DIRECTION = "the paper's direction is not on record"


def judge_cell(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the verdict that is paired by scene, and the direction of the difference where the paper's is on record."""
    row = _cell_row(claim, runs[claim.experiment])
    if row is None:
        return Judgement(Agreement.open, reason=f"the run does not vary the {claim.stated['factor']}")
    ours, theirs = row["verdict"], claim.stated["said"]
    if ours in (None, Verdict.undecided):
        return Judgement(Agreement.open, _value(row), row["why"] or row["yardstick_why"] or "undecided")
    if ours != theirs:
        return Judgement(Agreement.disagrees, _value(row))
    return _directed(claim, row) if theirs == Verdict.yes else Judgement(Agreement.agrees, _value(row))


def judge_effect_bound(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the paper's yardstick: the largest difference between two levels, relative to the variation common to them."""
    data, stated = runs[claim.experiment], claim.stated
    rows = data.comparison.filter(factor=stated["factor"], role=stated["role"]).drop_nulls("yardstick_effect")
    if rows.is_empty():
        return Judgement(Agreement.open, reason=f"the run does not vary the {stated['factor']}")
    values = ", ".join(f"{row['tracker']}: {effect_text(row['yardstick_effect'])}" for row in rows.to_dicts())
    within = (rows["yardstick_effect"] <= stated["most"]).all()
    return Judgement(Agreement.agrees if within else Agreement.disagrees, values, "largest differences, no interval")


def _cell_row(claim: Claim, data: ReportData) -> Mapping[str, Any] | None:
    stated, kind = claim.stated, claim.stated["tracker"]
    name = tracker_named(data, kind) if kind else None
    whose = pl.col("tracker") == name if name else pl.col("tracker").is_null()
    rows = data.comparison.filter(whose, factor=stated["factor"], role=stated["role"])
    varied = rows.filter(pl.max_horizontal("n_levels", "yardstick_n_levels") > 1)
    return varied.row(0, named=True) if varied.height and (name or not kind) else None


def _directed(claim: Claim, row: Mapping[str, Any]) -> Judgement:
    """The verdict where both find a change."""
    theirs, ours = claim.stated.get("rises"), _cell_rises(row)
    if ours is None:
        return Judgement(Agreement.agrees, _value(row))
    direction = f"{'rises' if ours else 'falls'} with speed"
    if theirs is None:
        return Judgement(Agreement.agrees, _value(row), f"{direction}; {_UNKNOWN_DIRECTION}")
    return Judgement(Agreement.agrees if ours == theirs else Agreement.opposite, _value(row), direction)


def _cell_rises(row: Mapping[str, Any]) -> bool | None:
    """Whether the higher of two speeds has the larger value. None for other factors, and for signed differences."""
    if row["factor"] != "speed" or row["larger"] is None or row["unit"] != "ratio":
        return None
    return int(row["larger"]) == max(int(row["level_a"]), int(row["level_b"]))


def _value(row: Mapping[str, Any]) -> str:
    """The paired difference with its interval; the paper's yardstick where there is none."""
    if row["effect"] is None:
        share = row["yardstick_effect"]
        return "" if share is None else f"yardstick {effect_text(share)}"
    return f"{size_text(row)}, {row['level_a']} and {row['level_b']}"


_FACTOR = 1.5
"""Ages within this factor of each other count as the same size."""
_NO_CURVE = "too few features for a curve"


def judge_drift(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the mean error, and its interval, at the last age (or frame) that the curve has and the paper's has.

    Where the paper names no coordinate, a drift in either of them will do, and the intervals allow for this choice.
    There is none only where both are small.
    """
    data, stated = runs[claim.experiment], claim.stated
    if stated["direction"] not in data.directions:
        return Judgement(Agreement.open, reason=f"not played {stated['direction']}")
    tracker = tracker_named(data, stated["tracker"]) or ""
    curves = (curve(data, tracker, role, direction=stated["direction"]) for role in ("mean", "absolute"))
    mean, absolute = (last(points.filter(pl.col("since") <= stated.get("last_age", inf))) for points in curves)
    if mean is None or absolute is None:
        return Judgement(Agreement.open, reason=_NO_CURVE)
    axes = [stated["coordinate"]] if "coordinate" in stated else list("uv")
    drifts = {axis: mean_chosen_among(data, mean, axis, len(axes)) for axis in axes}
    value = ", ".join(f"{axis}: {at_place(data, drift, mean['since'])}" for axis, drift in drifts.items())
    large = {axis: drift for axis, drift in drifts.items() if not is_within(drift, MARGIN * absolute[axis])}
    if not large:
        return Judgement(Agreement.disagrees, value, f"less than {percent(MARGIN)} of the mean absolute error")
    drifting = [axis for axis, drift in large.items() if excludes_zero(drift)]
    if not drifting:
        return Judgement(Agreement.open, value, "the interval contains zero, or there is none")
    same = stated.get("sign") is None or all(stated["sign"] * mean[axis] > 0 for axis in drifting)
    return Judgement(Agreement.agrees if same else Agreement.opposite, value)


def judge_same_drift(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the mean errors of both trackers at the last age (or frame) that both curves have.

    They are compared in the coordinate in which the first drifts more. Their intervals allow for this choice.
    """
    data = runs[claim.experiment]
    left, right = (curve(data, tracker_named(data, kind) or "", "mean") for kind in claim.stated["trackers"])
    at = last(left.join(right, on="since", how="semi"))
    if at is None:
        return Judgement(Agreement.open, reason=_NO_CURVE)
    points = [table.filter(since=at["since"]).row(0, named=True) for table in (left, right)]
    axis = max("uv", key=lambda name: abs(at[name]))
    first, second = (mean_chosen_among(data, point, axis, len("uv")) for point in points)
    value = f"{axis}: {at_place(data, first, at['since'])} and {at_place(data, second, at['since'])}"
    if not excludes_zero(first) or not excludes_zero(second):
        return Judgement(Agreement.open, value, "not both drift")
    if len({point[axis] > 0 for point in points}) > 1:
        return Judgement(Agreement.opposite, value)
    return Judgement(Agreement.agrees if overlap(first, second) else Agreement.disagrees, value)


def judge_cut(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the last age that has enough features, which is comparable only with as many scenes."""
    data, wanted = runs[claim.experiment], claim.stated["ages"]
    scenes = len({entry.sequence.scene for entry in data.sequences.values()})
    ends = {kind: last(curve(data, tracker_named(data, kind) or "", "mean")) for kind in wanted}
    ages = {kind: int(end["since"]) for kind, end in ends.items() if end is not None}
    value = ", ".join(f"{kind}: {number(age)}" for kind, age in ages.items())
    if scenes < claim.stated["scenes"]:
        return Judgement(Agreement.open, value, f"{scenes} of the paper's {claim.stated['scenes']} scenes")
    longest = max((entry.n_frames for entry in data.sequences.values()), default=0)
    if longest <= max(wanted.values()):
        return Judgement(Agreement.open, value, f"sequences of {number(longest)} frames have no such ages")
    if len(ages) < len(wanted):
        return Judgement(Agreement.open, value, _NO_CURVE)
    if sorted(ages, key=ages.__getitem__) != sorted(wanted, key=wanted.__getitem__):
        return Judgement(Agreement.opposite, value, "the other tracker has the longer curve")
    alike = all(abs(log(ages[kind] / wanted[kind])) <= log(_FACTOR) for kind in wanted)
    return Judgement(Agreement.agrees if alike else Agreement.disagrees, value)


_ROUNDING = 0.05
"""The paper gives outlier ratios in steps of 10 %."""


def judge_outlier_level(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the pooled ratio at every speed, and its interval. Ratios do not depend on trimming."""
    data, stated = runs[claim.experiment], claim.stated
    table = data.reference(data["outliers"]).filter(tracker=tracker_named(data, stated["tracker"])).sort("speed")
    rows = data.with_bounds_of(table, "outlier_ratio").drop_nulls("pooled_ratio").to_dicts()
    if not rows:
        return Judgement(Agreement.open, reason="no outlier ratio is known")
    low, high = stated["low"] - _ROUNDING, stated["high"] + _ROUNDING
    value = ", ".join(f"{percent(row['pooled_ratio'])}{_bounds(row)} at speed {row['speed']}" for row in _ends(rows))
    if all(low <= row["pooled_ratio"] <= high for row in rows):
        return Judgement(Agreement.agrees, value)
    outside = [str(row["speed"]) for row in rows if row["low"] is not None and (row["low"] > high or row["high"] < low)]
    if outside:
        speeds = f"{'speed' if len(outside) == 1 else 'speeds'} {listing(outside)}"
        return Judgement(Agreement.disagrees, value, f"outside {percent(low)} to {percent(high)} at {speeds}")
    return Judgement(Agreement.open, value, "the interval contains the paper's level, or there is none")


def judge_zero_mean_gaussian(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the test of the mean and the shape of the distribution, at the nominal speed."""
    data = runs[claim.experiment]
    answers = _answers(data, tracker_named(data, claim.stated["tracker"]) or "")
    return Judgement(_all_of(answers), _described(answers))


def judge_not_zero_mean_gaussian(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """As `judge_zero_mean_gaussian` for every tracker. One tracker with such errors is enough."""
    data = runs[claim.experiment]
    by_tracker = {tracker: _answers(data, tracker) for tracker in data.trackers}
    value = "; ".join(f"{tracker}: {_described(answers)}" for tracker, answers in by_tracker.items())
    contrary = {Agreement.agrees: Agreement.disagrees, Agreement.disagrees: Agreement.agrees}
    agreements = {contrary.get(verdict, verdict) for verdict in map(_all_of, by_tracker.values())}
    for verdict in (Agreement.agrees, Agreement.open):
        if verdict in agreements:
            return Judgement(verdict, value)
    return Judgement(Agreement.disagrees if agreements else Agreement.open, value)


def _ends(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The smallest and the largest ratio."""
    ordered = sorted(rows, key=lambda row: row["pooled_ratio"])
    return [ordered[0], *ordered[1:][-1:]]


def _bounds(row: Mapping[str, Any]) -> str:
    return "" if row["low"] is None else f" ({percent(row['low'])} to {percent(row['high'])})"


def _answers(data: ReportData, tracker: str) -> dict[str, bool | None]:
    """Whether errors of a tracker have zero mean, and are Gaussian; None where that is undecided."""
    return {"mean": _is_zero(data, tracker), "shape": _is_gaussian(shapes_of(data, tracker))}


def _is_gaussian(shapes: Sequence[Shape]) -> bool | None:
    """False where errors of any age are not Gaussian; True where those of all ages are."""
    if any(shape not in (Shape.gaussian, Shape.undecided) for shape in shapes):
        return False
    return True if shapes and Shape.undecided not in shapes else None


def _is_zero(data: ReportData, tracker: str) -> bool | None:
    """False where the mean differs from zero; True where its intervals are within the margin of the root mean square.

    The intervals are those at all ages (or frames), in u and in v.
    """
    if has_bias(data, tracker):
        return False
    means, sizes = (curve(data, tracker, role) for role in ("mean", "second"))
    points = means.join(sizes.select("since", size_u="u", size_v="v"), on="since").to_dicts()
    slight = (is_within(estimate(row, axis), MARGIN * row[f"size_{axis}"]) for row in points for axis in "uv")
    return True if points and all(slight) else None


def _all_of(answers: Mapping[str, bool | None]) -> Agreement:
    if False in answers.values():
        return Agreement.disagrees
    return Agreement.open if None in answers.values() else Agreement.agrees


_NAMES = {
    "mean": {True: "zero mean", False: "nonzero mean", None: "mean undecided"},
    "shape": {True: "Gaussian", False: "not Gaussian", None: "shape undecided"},
}


def _described(answers: Mapping[str, bool | None]) -> str:
    return listing(_NAMES[name][answer] for name, answer in answers.items())


def judge_trend(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the curves of the lowest and the highest speed that can be compared, and their intervals.

    With ``place = "shared"`` they are compared at the last age (or frame) that both have. With ``step``, each is taken
    one step of the tracker from where errors are zero.
    """
    data, stated = runs[claim.experiment], claim.stated
    tracker = tracker_named(data, stated["tracker"]) or ""
    by_speed = (
        _steps(data, tracker, stated["role"]) if stated["place"] == "step" else _shared(data, tracker, stated["role"])
    )
    if len(by_speed) < 2:
        return Judgement(Agreement.open, reason="no two speeds have a point in common")
    (slow, *_, fast) = by_speed.values()
    shown = ", ".join(number(_size(point)) for point in by_speed.values())
    value = f"{shown} px at speeds {', '.join(map(str, by_speed))}"
    place = "one step from zero" if stated["place"] == "step" else data.axis.place(slow["since"])
    sizes = f"sizes are means of u and v {place}"
    apart = [axis for axis in "uv" if overlap(estimate(slow, axis), estimate(fast, axis)) is False]
    if not apart:
        why = "intervals of the lowest and highest speed overlap or are unknown"
        return Judgement(Agreement.open, value, f"{why}; {sizes}")
    rises = {fast[axis] > slow[axis] for axis in apart}
    if len(rises) > 1:
        return Judgement(Agreement.open, value, f"u and v change in opposite directions; {sizes}")
    return Judgement(Agreement.agrees if rises == {stated["rises"]} else Agreement.opposite, value, sizes)


def judge_motion(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By root second moments of two experiments at the last age that both have, for each tracker."""
    experiment = claim.stated["other"]
    if experiment not in runs:
        return Judgement(Agreement.open, reason=f"{experiment} was not measured")
    values, differ = [], []
    for tracker in runs[claim.experiment].trackers:
        pair = _pair(runs[claim.experiment], runs[experiment], tracker)
        if pair is not None:
            sizes = [at_place(runs[claim.experiment], estimate(point, "u"), point["since"]) for point in pair]
            values.append(f"{tracker}, u: {sizes[0]} and {sizes[1]}")
            differ.append(any(overlap(estimate(pair[0], axis), estimate(pair[1], axis)) is False for axis in "uv"))
    if any(differ):
        return Judgement(Agreement.agrees, "; ".join(values))
    return Judgement(Agreement.open, "; ".join(values), "intervals overlap or are unknown")


def _pair(first: ReportData, second: ReportData, tracker: str) -> tuple[Point, Point] | None:
    curves = [curve(data, tracker, "second") for data in (first, second)]
    at = last(curves[0].join(curves[1], on="since", how="semi"))
    if at is None:
        return None
    return at, curves[1].filter(since=at["since"]).row(0, named=True)


def _steps(data: ReportData, tracker: str, role: str) -> dict[int, Point]:
    """The point of each speed one step from where errors are zero."""
    points = {speed: curve(data, tracker, role, speed=speed).filter(since=speed) for speed in data.speeds}
    return {speed: table.row(0, named=True) for speed, table in points.items() if table.height}


def _shared(data: ReportData, tracker: str, role: str) -> dict[int, Point]:
    """Points of the lowest speed and the highest that shares a place with it, at the last place that both have."""
    slow = curve(data, tracker, role)
    for speed in reversed(data.speeds[1:]):
        fast = curve(data, tracker, role, speed=speed)
        at = last(fast.join(slow, on="since", how="semi"))
        if at is not None:
            return {data.slowest: slow.filter(since=at["since"]).row(0, named=True), speed: at}
    return {}


def _size(point: Point) -> float:
    """Mean of both coordinates."""
    return float(point["u"] + point["v"]) / 2.0


Judge = Callable[[Claim, Mapping[str, ReportData]], Judgement]

JUDGES: Mapping[str, Judge] = {
    "cell": judge_cell,
    "effect_bound": judge_effect_bound,
    "trend": judge_trend,
    "motion": judge_motion,
    "drift": judge_drift,
    "same_drift": judge_same_drift,
    "cut": judge_cut,
    "outlier_level": judge_outlier_level,
    "zero_mean_gaussian": judge_zero_mean_gaussian,
    "not_zero_mean_gaussian": judge_not_zero_mean_gaussian,
}
"""How claims of each kind are judged."""


def judge(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """Verdict on a claim."""
    if claim.experiment not in runs:
        return Judgement(Agreement.open, reason="the experiment was not repeated")
    for kind in _trackers(claim):
        if tracker_named(runs[claim.experiment], kind) is None:
            return Judgement(Agreement.open, reason=f"no tracker of the kind {kind} was run")
    return JUDGES[claim.kind](claim, runs)


def _trackers(claim: Claim) -> list[str]:
    """Kinds of the trackers that a claim is about, where it names any."""
    kinds = [claim.stated.get("tracker"), *claim.stated.get("trackers", ()), *claim.stated.get("ages", ())]
    return [kind for kind in kinds if kind]


READINGS: Mapping[Reading, str] = {
    Reading.none: "untrimmed",
    Reading.all: "trimmed among all tracks",
    Reading.followed: "trimmed among followed tracks",
}
"""Names of the readings."""
Runs = Mapping[Reading, Mapping[str, ReportData]]
"""Runs by experiment of the paper, for each reading."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A claim and its verdicts."""

    claim: Claim  # of the paper
    judgements: Mapping[Reading, Judgement]  # one for each reading

    @property
    def reasons(self) -> str:
        """Reasons of the verdicts, each once, with the readings that it is about unless it is about all."""
        by_reason: dict[str, list[str]] = {}
        for reading, judgement in self.judgements.items():
            if judgement.reason:
                by_reason.setdefault(judgement.reason, []).append(reading)
        n_readings = len(self.judgements)
        return "; ".join(
            reason if len(names) == n_readings else f"{listing(names)}: {reason}" for reason, names in by_reason.items()
        )


def judged(claims: Iterable[Claim], runs: Runs) -> list[Judged]:
    """Judge claims under every reading."""
    return [Judged(claim, {reading: judge(claim, runs.get(reading, {})) for reading in Reading}) for claim in claims]


def tally(items: Sequence[Judged], reading: Reading) -> dict[Agreement, int]:
    """How many claims have each verdict under a reading."""
    agreements = [item.judgements[reading].agreement for item in items]
    return {agreement: agreements.count(agreement) for agreement in Agreement}


def tallies(items: Sequence[Judged], caption: str) -> Cells:
    """Count of each verdict, one row per reading."""
    rows = [[name, *map(number, tally(items, reading).values())] for reading, name in READINGS.items()]
    return Cells(caption, ["reading", *Agreement], rows, [False, *[True] * len(Agreement)])


def best_reading(items: Sequence[Judged]) -> str:
    """One sentence: the reading under which most claims agree."""
    counts = {reading: tally(items, reading)[Agreement.agrees] for reading in Reading}
    most = max(counts.values(), default=0)
    best = [READINGS[reading] for reading, agreeing in counts.items() if agreeing == most]
    how_many = "The most" if len(best) == 1 else "Equally many"
    return f"{how_many} claims agree if errors are {listing(best, joint='or')}: {number(most)} of {number(len(items))}."


def verdicts(items: Sequence[Judged], caption: str) -> Cells:
    """Verdicts only, one row per claim."""
    rows = [[item.claim.text, *(item.judgements[reading].agreement for reading in Reading)] for item in items]
    return Cells(caption, ["claim of the paper", *Reading], rows, [False] * (1 + len(Reading)))


def table(items: Sequence[Judged], caption: str) -> Cells:
    """Verdicts with what was measured, and reasons: one row per claim."""
    headings = ["claim of the paper", "source", *["verdict", "measured"] * len(Reading), "reason"]
    groups = [("", 2), *((name, 2) for name in READINGS.values()), ("", 1)]
    return Cells(caption, headings, [_claim_row(item) for item in items], [False] * len(headings), groups)


def _claim_row(item: Judged) -> list[str]:
    pairs = [
        (judgement.agreement, judgement.value or DASH)
        for judgement in (item.judgements[reading] for reading in Reading)
    ]
    reasons = "; ".join(filter(None, [item.reasons, item.claim.note])) or DASH
    return [item.claim.text, item.claim.source, *(text for pair in pairs for text in pair), reasons]


def to_csv(items: Sequence[Judged]) -> str:
    """One line per claim and reading."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["experiment", "claim", "text", "source", "reading", "verdict", "measured", "reason", "note"])
    for item in items:
        claim = item.claim
        for reading, judgement in item.judgements.items():
            told = [reading, judgement.agreement, judgement.value, judgement.reason, claim.note]
            writer.writerow([claim.experiment, claim.id, claim.text, claim.source, *told])
    return buffer.getvalue()
