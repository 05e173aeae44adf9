"""Headlines about errors: their bias, shape and growth, and survivorship bias."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_estimate
from tracknoise.findings.headlines.error_size import first, in_u_and_v, rms
from tracknoise.findings.headlines.headline import Headline, Part, RunTables, by_tracker
from tracknoise.findings.headlines.reported_conditions import ReportedConditions, curve_bounds, curve_scenes
from tracknoise.findings.headlines.withheld import (
    audited_bias,
    audited_rise,
    bias_covers,
    covered_coordinates,
    growth_cover,
    withheld_bias,
    withheld_growth,
)
from tracknoise.findings.wording import SHAPES, SPACE, chance, count, listing, number, percent, sentence_case
from tracknoise.tables.enumerations import Aspect, Axis, Behaviour, Resampled, Trimming, Verdict, Weighting

_GROWTH: Mapping[str, tuple[str, str, str]] = {
    Behaviour.white: ("constant", "white_px", "px"),
    Behaviour.random_walk: ("random walk", "walk_px_per_sqrt_frame", "px per sqrt(frame)"),
    Behaviour.drift: ("drift", "drift_px_per_frame", "px per frame"),
    Behaviour.saturating: ("saturating", "saturating_px", "px"),
}
"""Name of a behaviour, and the column and the unit of its size."""
_GROWING = (Behaviour.random_walk, Behaviour.drift, Behaviour.saturating)
"""Behaviours that the errors of poses have too."""
_POOLED = "features pooled over scenes"
_RISING = ("walk_px_per_sqrt_frame", "drift_px_per_frame")


def bias(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether the mean error is zero."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _bias_of(tables, conditions, tracker),
        opening=f"Bias {conditions.where(tables['summary'])}.",
        closing=f"The test takes all {conditions.axis}s together and weights scenes equally.",
        topic="bias",
        figure="error-by-tracker",
        table="zero_mean",
    )


def _bias_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(tables["zero_mean"], tracker).filter(trimming=conditions.trimmings[0], axis=conditions.axis)
    overall, summary = first(rows.filter(pl.col("at").is_null())), first(conditions.of(tables["summary"], tracker))
    if overall is None:
        return None
    at = None if summary is None else summary["at"]
    there = None if at is None else first(rows.filter(at=at))
    covers = {} if summary is None or there is None else bias_covers(summary, there)
    withheld = None if there is None else withheld_bias(tracker, conditions.opening_place(there["at"]), covers)
    if withheld is None and there is not None:
        withheld = audited_bias(tables, conditions, tracker, there["at"])
    if withheld is not None and overall["verdict"] == Verdict.yes:
        return withheld, [Estimate.verdict(overall, "effect_px")]
    trimming = conditions.trimmings[0]
    estimates = [] if there is None else _means(tables, conditions, tracker, there, trimming)
    text = _zero_or_not(f"the mean {_trimmed(conditions)}error of {tracker}", overall)
    if there is not None and len(estimates) == 2:
        u, v = map(format_estimate, estimates)
        text += f" {conditions.opening_place(there['at'])}, the mean in u is {u}. In v it is {v}."
        intervals = conditions.of(tables["intervals"], tracker)
        scenes = curve_scenes(intervals, conditions, "mean", there["at"], "u", weighting=Weighting.scenes, of="In u")
        text += f" {scenes}" if scenes else ""
        if there["share_of_second"] is not None:
            share = percent(there["share_of_second"])
            text += f" The square of the mean is {share} of the second moment, u and v together."
        text += covered_coordinates(covers)
        untrimmed = _untrimmed_means(tables, conditions, tracker, there["at"])
        text += f" Without trimming, the mean is {in_u_and_v(untrimmed)}." if len(untrimmed) == 2 else ""
        estimates += untrimmed
    return text, [*estimates, Estimate.verdict(overall, "effect_px")]


def _untrimmed_means(tables: RunTables, conditions: ReportedConditions, tracker: str, at: int) -> list[Estimate]:
    """Mean errors of all tracks, where the verdict is about those that trimming kept."""
    if conditions.percentile is None or conditions.trimming == Trimming.untrimmed:
        return []
    rows = conditions.of(tables["zero_mean"], tracker)
    there = first(rows.filter(trimming=Trimming.untrimmed, axis=conditions.axis, at=at))
    return [] if there is None else _means(tables, conditions, tracker, there, Trimming.untrimmed)


def _zero_or_not(mean: str, overall: Mapping[str, Any]) -> str:
    p = overall["sign_flip_p_family"]
    test = "" if p is None else f" ({chance(p)}, {count(overall['n_scenes'], 'scene')})"
    if overall["verdict"] == Verdict.yes:
        return f"{sentence_case(mean)} is not zero{test}."
    why = f": {overall['why']}" if overall["why"] and p is None else ""
    return f"It is undecided whether {mean} is zero{test}{why}."


def _means(
    tables: RunTables, conditions: ReportedConditions, tracker: str, row: Mapping[str, Any], trimming: Trimming
) -> list[Estimate]:
    found = []
    intervals, scenes = conditions.of(tables["intervals"], tracker), Weighting.scenes
    for coordinate in "uv":
        value = row[f"mean_{coordinate}_px"]
        bounds = curve_bounds(intervals, conditions, "mean", row["at"], coordinate, trimming=trimming, weighting=scenes)
        found += [] if value is None else [Estimate.of(value, bounds, "px")]
    return found


def shape(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether errors are Gaussian, in the band of ages that contains the reference age."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _shape_of(tables, conditions, tracker),
        opening=f"Shape of the error distribution {conditions.where(tables['summary'])}.",
        topic="shape",
        figure="gaussianity",
        table="gaussianity",
    )


def _shape_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(tables["gaussianity"], tracker)
    bands = rows.select_seq("age_low", "age_high").unique().sort("age_low").rows()
    if not bands:
        return None
    summary = first(conditions.of(tables["summary"], tracker))
    since = abs(conditions.since(summary["at"])) if summary and summary["at"] is not None else bands[0][0]
    low, high = next((band for band in bands if band[0] <= since <= (band[1] or since)), bands[0])
    sentences, estimates = [], []
    for trimming in conditions.trimmings:
        row = first(rows.filter(trimming=trimming, age_low=low))
        if row is not None:
            within = _gain(row, "student_within")
            scales = [] if row["resampled"] == Resampled.blocks else _gain(row, "scales")
            estimates += [*within, *scales, Estimate.verdict(row, "shape")]
            which = f"{trimming} errors" if len(conditions.trimmings) > 1 else "errors"
            whose = f"{sentence_case(which)} of {tracker} at {band_text(conditions.axis, low, high)}"
            why = f": {row['why']}" if row["why"] and not within else ""
            sentences += [f"{whose} are {SHAPES[row['verdict']]}{why}.", *_tails(row, within, scales)]
    return " ".join(sentences), estimates


def _gain(row: Mapping[str, Any], name: str) -> list[Estimate]:
    """A gain in nats per error; empty where it is unknown."""
    if row[f"gain_{name}_nats"] is None:
        return []
    return [Estimate.of_row(row, f"gain_{name}_nats", f"gain_{name}_low", f"gain_{name}_high", "nat")]


def _tails(row: Mapping[str, Any], within: list[Estimate], scales: list[Estimate]) -> list[str]:
    tail = row["tail_99_within"]
    texts = [f"Within scenes, {number(tail)} times as many lie beyond the 99{SPACE}% ellipse as of a Gaussian."]
    gains = [f"There Student's t gains {format_estimate(one)} per error over a Gaussian." for one in within]
    added = [f"Different scales of scenes add {format_estimate(one)}." for one in scales]
    return [*([] if tail is None else texts), *gains, *added]


def band_text(axis: Axis, low: int, high: int | None) -> str:
    """Write a band of ages, or of distances from the key frame: ``ages 5 to 9``.

    Parameters
    ----------
    axis
        What curves run along.
    low, high
        First and last age, or distance; None where there is no last one.
    """
    ages = f"{low} or more" if high is None else f"{low} to {high}"
    return f"ages {ages}" if axis == Axis.age else f"{ages} frames from the key frame"


def growth(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How errors grow with age."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _growth_of(tables, conditions, tracker),
        opening=f"Growth of {_trimmed(conditions)}errors {conditions.where(tables['summary'])}, {_POOLED}.",
        topic="growth",
        figure="time-structure",
        table="time_structure",
    )


def _growth_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(tables["time_structure"], tracker).filter(trimming=conditions.trimmings[0])
    withheld, covered = _growth_withheld(tables, conditions, tracker, rows)
    texts: dict[str, list[str]] = {}
    estimates = []
    for row in rows.filter(~pl.col("coordinate").is_in(covered)).sort("coordinate").to_dicts():
        name, size = _behaviour(row)
        estimates += size
        texts.setdefault(", ".join([name, *map(format_estimate, size)]), []).append(row["coordinate"])
    sentences = [f"{tracker} in {listing(coordinates)}: {text}." for text, coordinates in texts.items()]
    sentences += withheld
    estimates += [Estimate.verdict(row, "growth") for row in rows.sort("coordinate").to_dicts()]
    return (" ".join(sentences), estimates) if sentences else None


def _growth_withheld(
    tables: RunTables, conditions: ReportedConditions, tracker: str, rows: pl.DataFrame
) -> tuple[list[str], list[str]]:
    """Sentences about coordinates that grow as the truth floor or faults of the truth do, and these coordinates."""
    summary = first(conditions.of(tables["summary"], tracker))
    if summary is None or summary["at"] is None:
        return [], []
    growing = rows.filter(pl.col("verdict").is_in(_GROWING))["coordinate"].sort().to_list()
    covers = {axis: growth_cover(tables, conditions, tracker, axis, summary["at"]) for axis in growing}
    covered = [axis for axis, cover in covers.items() if cover is not None and cover.is_covered]
    by_floor = withheld_growth(tracker, conditions.place(summary["at"]), covers)
    rest = [axis for axis in growing if axis not in covered]
    audited = {axis: audited_rise(tables, conditions, tracker, axis, summary["at"]) for axis in rest}
    by_audit = {axis: sentence for axis, sentence in audited.items() if sentence is not None}
    return [*([] if by_floor is None else [by_floor]), *by_audit.values()], [*covered, *by_audit]


def _behaviour(row: Mapping[str, Any]) -> tuple[str, list[Estimate]]:
    """Name of the behaviour of one coordinate, and its size if it has one."""
    if row["verdict"] not in _GROWTH:
        undecided = f"undecided; {row['why']}" if row["why"] else "undecided"
        none = row["why"] or "none of the models fits"
        return (none if row["verdict"] == Behaviour.none else undecided), []
    name, column, unit = _GROWTH[row["verdict"]]
    size = Estimate.of_row(row, column, f"{column}_low", f"{column}_high", unit)
    return f"mostly {name}" if rises(row) else name, [] if size.value is None else [size]


def rises(row: Mapping[str, Any]) -> bool:
    """Whether errors of a coordinate are mostly constant, but have a part that grows, by its interval.

    Parameters
    ----------
    row
        Of `TIME_STRUCTURE`.
    """
    return row["verdict"] == Behaviour.white and any((row[f"{part}_low"] or 0.0) > 0 for part in _RISING)


def survivorship(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether long-lived tracks have smaller errors than all tracks."""
    errors = f"{_trimmed(conditions)}root mean square errors, {_POOLED}"
    return by_tracker(
        conditions.trackers,
        lambda tracker: _survivorship_of(tables, conditions, tracker),
        opening=f"Survivorship bias {conditions.where(tables['summary'])}, in {errors}.",
        topic="survivorship",
        figure="survivorship-bias",
        table="intervals",
    )


def _survivorship_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    row, intervals = first(conditions.of(tables["summary"], tracker)), conditions.of(tables["intervals"], tracker)
    if row is None or row["at"] is None:
        return None
    since, trimming = abs(conditions.since(row["at"])), conditions.trimmings[0]
    aspect = Aspect.long_lived
    for age in sorted(intervals.filter(aspect=aspect)["at_least"].unique()):
        long = curve_bounds(
            intervals, conditions, "second", row["at"], "u", trimming=trimming, aspect=aspect, at_least=age
        )
        if age > since and long:
            every = rms(intervals, conditions, row, "u", trimming)
            text = (
                f"{conditions.opening_place(row['at'])}, the error of {tracker} in u is {format_estimate(long)} "
                f"for tracks that live to age {age}. For all tracks it is {format_estimate(every)}."
            )
            return text, [long, every]
    return None


def _trimmed(conditions: ReportedConditions) -> str:
    return "" if conditions.percentile is None else f"{conditions.trimming} "
