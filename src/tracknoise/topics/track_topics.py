"""Outliers and lifetimes of tracks."""

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import polars as pl

from tracknoise.analysis.estimand import FREQUENCY, OVER_SCENES, Estimand, RoleValues, TableValues, Wording
from tracknoise.analysis.lifetime_intervals import INCIDENCE, incidence_table
from tracknoise.text import counted
from tracknoise.topics.answer_summary import Measure
from tracknoise.topics.factor_topic import best
from tracknoise.topics.headline import Headline, Part, ReportedConditions, RunTables, scalar_estimate, scalar_scenes
from tracknoise.topics.measures import Subject, card_number, estimate_cell, first, with_interval
from tracknoise.topics.sentences import joined
from tracknoise.topics.topic import ABOUT_TRACKS, Analysis, Basis, Column, Topic
from tracknoise.words import count, format_estimate, percent

_ONE_SEED = "The run has one random seed (seeds = 1), so that the spread between seeds is unknown."
_LIFETIMES = {
    "median_lifetime": "",
    "restricted_mean_lifetime": "The restricted mean is {}.",
    "restricted_mean_until_failure": "The restricted mean until failure is {}.",
}
"""Lifetimes that are reported, and their sentences after that of the median."""
_ALL_LIVE = {
    "restricted_mean_lifetime": "No track ends before the horizon of the mean.",
    "restricted_mean_until_failure": "No track fails before the horizon of the mean.",
}
"""Sentences where the mean is the number of frames to which it is restricted, which no bound can exceed."""
_FAILURE = (
    "A failure is a lost track or an outlier. Until failure, masked and displaced tracks count as censored: they are "
    "assumed to fail like the others."
)


def outliers(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """What share of its features each tracker rejects."""
    return conditions.headline(
        lambda tracker: _outliers_of(tables, conditions, tracker),
        opening=f"Outlier ratio {conditions.where(tables)}.",
        closing=_ONE_SEED if tables["seed_spread"].is_empty() else "",
        figure="outlier-ratio",
    )


def _outliers_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    summary = conditions.of(tables["summary"], tracker)
    if _value(summary, "outlier_ratio") is None:
        text = f"The outliers of {tracker} are not recorded."
        return None if _reports_causes(summary) else Part(text, [], text)
    intervals = conditions.intervals(tables, tracker)
    estimate = scalar_estimate(summary.row(0, named=True), intervals, "outlier_ratio", "share")
    rejects = f"{tracker} rejects {format_estimate(estimate)} of its features per frame."
    text = joined([rejects, scalar_scenes(intervals, "outlier_ratio")])
    return Part(text + _between_seeds(conditions.of(tables["seed_spread"], tracker)), [estimate])


def _reports_causes(summary: pl.DataFrame) -> bool:
    """Whether the tracker of a row reports why tracks end. If not, lifetimes until failure are unknown."""
    lived, failed = (_value(summary, f"restricted_mean_{name}") for name in ("lifetime", "until_failure"))
    return lived is None or failed is not None


def _between_seeds(spread: pl.DataFrame) -> str:
    """How much the outlier ratio differs between seeds, as a sentence. Empty if there is one seed."""
    for row in spread.filter(statistic="outlier_ratio").to_dicts():
        deviation = f"a standard deviation of {percent(row['standard_deviation'])}"
        return f" Between {row['n_seeds']} random seeds the ratio has {deviation}."
    return ""


def lifetimes(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Median and restricted mean lifetime of tracks, and the restricted mean until failure."""
    restricted = [_value(conditions.of(tables["summary"], name), "restricted_to") for name in conditions.trackers]
    horizon = next((frames for frames in restricted if frames is not None), None)
    has_causes = any(_reports_causes(conditions.of(tables["summary"], name)) for name in conditions.trackers)
    means = "" if horizon is None else f", and means restricted to {count(int(horizon), 'frame')}"
    where = conditions.where(tables)
    return conditions.headline(
        lambda tracker: _lifetime_of(tables, conditions, tracker),
        opening=f"Median lifetime {where} (Kaplan-Meier, tracks pooled over scenes){means}.",
        closing=_FAILURE if has_causes and horizon is not None else "",
        figure="lifetimes",
    )


def _lifetime_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    row, intervals = first(conditions.of(tables["summary"], tracker)), conditions.intervals(tables, tracker)
    if row is None or not row["n_tracks"]:
        return None
    estimates = {name: scalar_estimate(row, intervals, name, "frames") for name in _LIFETIMES if row[name] is not None}
    lifetime_texts = {name: format_estimate(estimate) for name, estimate in estimates.items()}
    median = lifetime_texts.get(
        "median_lifetime", "unknown, because more than half of the tracks are alive at the end of the data"
    )
    scenes = scalar_scenes(intervals, "restricted_mean_lifetime", of="The restricted mean")
    texts = [
        f"{tracker}: the median is {median}.",
        *(
            _ALL_LIVE[name] if _is_longest(row, name) else text.format(lifetime_texts[name])
            for name, text in _LIFETIMES.items()
            if name in lifetime_texts and text
        ),
    ]
    return Part(joined([*texts, scenes]), [*estimates.values()])


def _is_longest(row: Mapping[str, Any], name: str) -> bool:
    """Whether a mean is the number of frames to which it is restricted: no track ended, or failed, before."""
    return name in _ALL_LIVE and math.isclose(row[name], row["restricted_to"])


def _value(rows: pl.DataFrame, column: str) -> float | None:
    value: float | None = rows[column][0] if rows.height else None
    return value


def outliers_measure(subject: Subject) -> Measure | None:
    """Share of features that the tracker rejects."""
    if subject.row is None or subject.row["outlier_ratio"] is None:
        return None
    shown = card_number(scalar_estimate(subject.row, subject.intervals, "outlier_ratio", "share"))
    sentence = f"{subject.tracker} rejects {with_interval(shown)} of its features per frame."
    note = "share of its features that a tracker rejects per frame"
    fewest = best(subject.data, subject.tracker, "outlier_ratio", "fewest")
    return Measure("outliers", "share", shown, None, fewest, note, sentence, "outlier-ratio")


def lifetime_measure(subject: Subject) -> Measure | None:
    """Median lifetime, or the mean up to a horizon if more than half of some tracker's tracks are alive at the end."""
    if subject.row is None or not subject.row["n_tracks"]:
        return None
    rows = subject.conditions.reported(subject.data["summary"]).filter(pl.col("n_tracks") > 0)
    statistic = "restricted_mean_lifetime" if rows["median_lifetime"].null_count() else "median_lifetime"
    if subject.row[statistic] is None:
        return None
    shown = card_number(scalar_estimate(subject.row, subject.intervals, statistic, "frames"))
    tracks = f"tracks of {subject.tracker} is {with_interval(shown)}"
    note, sentence = "Kaplan-Meier median", f"The median lifetime of {tracks}."
    if statistic != "median_lifetime":
        horizon = f"up to {counted(subject.row['restricted_to'], 'frame')}"
        alive = subject.row["median_lifetime"] is None
        note = f"mean {horizon}{'; over half are alive at the end' if alive else ''}"
        sentence = f"The mean lifetime {horizon} of tracks of {subject.tracker} is {shown.text}."
    longest = best(subject.data, subject.tracker, "lifetime", "longest")
    return Measure("lifetime", "frames", shown, None, longest, note, sentence, "lifetimes")


def _number_cell(subject: Subject, statistic: str, unit: str) -> str:
    return estimate_cell(scalar_estimate(subject.row or {}, subject.intervals, statistic, unit))


OUTLIERS_OF_TRACKERS = Topic(
    "outliers",
    headline=outliers,
    holds=ABOUT_TRACKS,
    measure=outliers_measure,
    columns=lambda _: [Column("outliers", partial(_number_cell, statistic="outlier_ratio", unit="share"))],
    in_cards=tuple(Basis),
    rows_of_card=("outliers",),
    compared=(
        Estimand(
            "outlier_ratio",
            f"Features rejected as outliers, divided by features offered: {OVER_SCENES}.",
            RoleValues("outlier_ratio", axes=(None,)),
            Wording("has fewer outliers", "outliers are", *FREQUENCY),
        ),
    ),
)
LIFETIMES_OF_TRACKS = Topic(
    "lifetimes",
    (Analysis((INCIDENCE,), lambda inputs: [incidence_table(inputs.ends, inputs.sampling)]),),
    headline=lifetimes,
    holds=ABOUT_TRACKS,
    measure=lifetime_measure,
    columns=lambda _: [
        Column(
            "median lifetime",
            partial(_number_cell, statistic="median_lifetime", unit="frames"),
            note="Median lifetimes are Kaplan-Meier estimates in whole frames.",
        )
    ],
    in_cards=tuple(Basis),
    rows_of_card=("lifetime",),
    compared=(
        Estimand(
            "lifetime",
            f"Restricted mean lifetime to a horizon that all scenes reach in both runs: {OVER_SCENES}.",
            RoleValues("lifetime", axes=(None,)),
            Wording("has longer tracks", "tracks live", "longer", "shorter", "long"),
            larger_is_better=True,
        ),
        Estimand(
            "feature_count",
            f"Mean number of features per frame: {OVER_SCENES}.",
            TableValues("frames", lambda frames: frames.group_by("scene").agg(value=pl.col("alive").mean())),
            Wording("has more features", "the number of features is"),
            larger_is_better=True,
        ),
    ),
)
