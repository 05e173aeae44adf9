"""Headlines about ratios: the sentence that the catalogue declares for each, at the reference age."""

from dataclasses import replace
from typing import Any

import polars as pl

from tracknoise.analysis.estimand import FREQUENCY, Estimand, TableValues, Wording
from tracknoise.analysis.paired_tests import Unit
from tracknoise.analysis.ratio_intervals import (
    POINT_TRACKING_METRICS,
    RATIO_VALUES,
    point_tracking_metrics,
    ratio_intervals,
)
from tracknoise.inference.estimates import Estimate
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.statistics.yardstick import shared_places
from tracknoise.tables.enumerations import Axis, Trimming
from tracknoise.tables.quantities import QUANTITIES, RATIOS, Better, ComparedBy
from tracknoise.topics.headline import Headline, Part, ReportedConditions, RunTables
from tracknoise.topics.measures import first
from tracknoise.topics.topic import NO_ROWS, Curve, Topic, pooled
from tracknoise.words import bounds_text, format_estimate

_LEAST = 100
"""With fewer features than this, a ratio is not reported."""
_NAMED = 2
"""The sentence in one line names this many trackers."""


def ratios(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Every ratio of every tracker, of the tracks that verdicts are about."""
    enough = tables["ratios"].filter(pl.col("n") >= _LEAST, trimming=conditions.trimming, axis=conditions.axis)
    near = conditions.reported(enough).filter((pl.col("at") - conditions.at_zero).abs() <= REFERENCE_AGE)
    rows = near.join(shared_places(near, ["quantity"], "at"), on=["quantity", "at"], how="semi", maintain_order="left")
    headline = conditions.headline(
        lambda tracker: _ratios_of(rows, conditions, tracker),
        opening=f"Shares of features {conditions.where(tables)}.",
        figure="error-by-tracker",
        table="ratios",
    )
    return None if headline is None else replace(headline, brief=_brief(rows, conditions))


def _ratios_of(rows: pl.DataFrame, conditions: ReportedConditions, tracker: str) -> Part | None:
    ratio_rows = [(name, row) for name in RATIOS if (row := _at_reference(rows, conditions, tracker, name)) is not None]
    estimates = [_estimate(name, row) for name, row in ratio_rows]
    sentences = [
        f"{conditions.opening_place(row['at'])}, {_within(name).format(value=_plain(estimate), tracker=tracker)}"
        f"{_bounds(estimate)}"
        for (name, row), estimate in zip(ratio_rows, estimates, strict=True)
    ]
    return Part(" ".join(sentences), estimates) if ratio_rows else None


def _plain(estimate: Estimate) -> str:
    """The value without its interval."""
    return format_estimate(replace(estimate, low=None, high=None))


def _bounds(estimate: Estimate) -> str:
    """The interval as a sentence after a space; empty where there is none."""
    bounds = bounds_text(estimate)
    return f" The interval is {bounds}." if bounds else ""


def _within(name: str) -> str:
    """The sentence of a ratio as it follows the age; the braces of a name at its start stay."""
    sentence = QUANTITIES[name].sentence
    return sentence[0].lower() + sentence[1:]


def _at_reference(rows: pl.DataFrame, conditions: ReportedConditions, tracker: str, name: str) -> dict[str, Any] | None:
    """The row of a tracker at the place that trackers share."""
    return first(conditions.of(rows, tracker).filter(quantity=name))


def _estimate(name: str, row: dict[str, Any]) -> Estimate:
    return Estimate.of_row(row, "value", "low", "high", QUANTITIES[name].unit or "")


def _brief(rows: pl.DataFrame, conditions: ReportedConditions) -> str:
    """The first ratio of the first trackers, without intervals."""
    name = RATIOS[0]
    at_reference = {tracker: _at_reference(rows, conditions, tracker, name) for tracker in conditions.trackers}
    values = [
        f"{_plain(_estimate(name, row))} of {tracker}" for tracker, row in at_reference.items() if row is not None
    ]
    return f"{QUANTITIES[name].title}: {' and '.join(values[:_NAMED])}."


_LEAST_OF_SCENE = 30
"""Fewest features that a ratio of a scene at an age rests on."""
_AS_DEFINED = "as TAP-Vid defines it for images of 256 x 256 pixels, mean over scenes."
_METRICS = {
    "tap_delta_avg": ("delta_avg", "position accuracy (TAP)", f"Delta average, {_AS_DEFINED}"),
    "tap_delta_avg_reported": (
        "delta_avg_reported",
        "accuracy of reported positions",
        f"Delta average of the positions that are reported as visible, {_AS_DEFINED}",
    ),
    "tap_average_jaccard": ("average_jaccard", "average Jaccard (TAP)", f"Average Jaccard, {_AS_DEFINED}"),
    "tap_occlusion_accuracy": ("occlusion_accuracy", "occlusion accuracy (TAP)", f"Occlusion accuracy, {_AS_DEFINED}"),
    "expected_feature_age": (
        "expected_feature_age",
        "expected feature age",
        "Share of its visible time for which a point is tracked, in images of 256 x 256 pixels, mean over scenes.",
    ),
}
"""Metrics of point trackers that runs are compared by: the column, what it is called, and what is estimated."""


def _of_ratio(name: str) -> Estimand:
    """Ratios of sums over features of each scene and age that has enough features."""
    quantity = QUANTITIES[name]
    title, larger_is_better = quantity.title.lower(), quantity.better == Better.larger

    def numbers(sums: pl.DataFrame) -> pl.DataFrame:
        added = sums.filter(quantity=name).group_by("scene", "at", maintain_order=True).agg(pl.col("n", "sum").sum())
        return added.filter(pl.col("n") >= _LEAST_OF_SCENE).with_columns(value=pl.col("sum") / pl.col("n"))

    return Estimand(
        name,
        f"{quantity.estimand} Untrimmed, mean over scenes and ages.",
        TableValues("ratio_sums", numbers, {"trimming": Trimming.untrimmed}, Axis.age),
        Wording(f"has {'more' if larger_is_better else 'fewer'} {title}", f"{title} are", *FREQUENCY),
        Unit.ratio if quantity.compared == ComparedBy.ratio else Unit.share,
        title,
        larger_is_better=larger_is_better,
        of_errors=True,
    )


def _of_metric(name: str) -> Estimand:
    column, title, meaning = _METRICS[name]

    def numbers(metrics: pl.DataFrame) -> pl.DataFrame | None:
        reported = metrics.drop_nulls(column)
        return None if reported.is_empty() else reported.select("scene", value=column)

    values = TableValues("point_tracking", numbers, {"raster": "256x256"})
    is_overall = column == "average_jaccard"
    better = "is better for point tracking" if is_overall else f"has higher {title}"
    wording = Wording(better, f"{title} is", "higher", "lower", "high", is_secondary=not is_overall)
    return Estimand(name, meaning, values, wording, Unit.share, title, larger_is_better=True)


RATIOS_OF_SUMS = Topic(
    "ratios",
    (
        pooled(RATIO_VALUES, "ratio_sums", ratio_intervals, if_fitted=NO_ROWS),
        pooled(POINT_TRACKING_METRICS, "point_tracking", point_tracking_metrics),
    ),
    headline=ratios,
    of_these_scenes=True,
    curves=[Curve(name, RATIO_VALUES, "error-by-tracker", {"quantity": name}) for name in RATIOS],
    compared=(
        *map(_of_metric, _METRICS),
        *(_of_ratio(name) for name in RATIOS if QUANTITIES[name].compared != ComparedBy.none),
    ),
)
