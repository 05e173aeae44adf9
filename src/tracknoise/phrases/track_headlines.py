"""Headlines about outliers and lifetimes, and about factors.

- The headline about factors: which have an effect, which have none, and which are undecided.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.analysis.factors import ROLES
from tracknoise.inference.estimates import Estimate
from tracknoise.phrases.headline import (
    Headline,
    Part,
    ReportedConditions,
    RunTables,
    TrackerPart,
    by_tracker,
    ids_of,
    leading,
    scalar_bounds,
    scalar_scenes,
)
from tracknoise.statistics.yardstick import FACTORS
from tracknoise.tables.enumerations import Verdict
from tracknoise.words import (
    STATISTICS,
    bounded_text,
    count,
    difference_sentence,
    factor_name,
    format_estimate,
    listing,
    percent,
    ratio,
    sentence_case,
)

_ONE_SEED = "One random seed was used, so that the chance of the seed was not measured (seeds = 1)."
_LIFETIMES = {
    "median_lifetime": "",
    "restricted_mean_lifetime": "The restricted mean is {}.",
    "restricted_mean_until_failure": "Until failure it is {}.",
}
"""Lifetimes that are reported, and their sentences after that of the median."""
_FAILURE = (
    "A failure is a lost track or an outlier. Masked and displaced tracks then count as censored, which assumes that "
    "they would have failed like the others."
)


def outliers(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """What share of its features each tracker rejects."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _outliers_of(tables, conditions, tracker),
        opening=f"Outlier ratio {conditions.where(tables['summary'])}.",
        closing=_ONE_SEED if tables["seed_spread"].is_empty() else "",
        topic="outliers",
        figure="outlier-ratio",
        table="intervals",
    )


def _outliers_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    summary = conditions.of(tables["summary"], tracker)
    ratio = _value(summary, "outlier_ratio")
    if ratio is None:
        return None if _reports_causes(summary) else (f"The outliers of {tracker} are not recorded.", [])
    intervals = conditions.of(tables["intervals"], tracker)
    estimate = Estimate.of(ratio, scalar_bounds(intervals, "outlier_ratio"), "share")
    text = f"{tracker} rejects {format_estimate(estimate)} of the features carried into a frame."
    text += "".join(f" {scenes}" for scenes in [scalar_scenes(intervals, "outlier_ratio")] if scenes)
    return text + _between_seeds(conditions.of(tables["seed_spread"], tracker)), [estimate]


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
    where = conditions.where(tables["summary"])
    return by_tracker(
        conditions.trackers,
        lambda tracker: _lifetime_of(tables, conditions, tracker),
        opening=f"Median lifetime {where} (Kaplan-Meier, tracks pooled over scenes){means}.",
        closing=_FAILURE if has_causes and horizon is not None else "",
        topic="lifetimes",
        figure="lifetimes",
        table="intervals",
    )


def _lifetime_of(tables: RunTables, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(tables["summary"], tracker)
    if not _value(rows, "n_tracks"):
        return None
    found = {name: _estimate(tables, conditions, tracker, name) for name in _LIFETIMES}
    known = {name: format_estimate(estimate) for name, estimate in found.items() if estimate is not None}
    median = known.get(
        "median_lifetime", "unknown, because more than half of the tracks are alive at the end of the data"
    )
    scenes = scalar_scenes(
        conditions.of(tables["intervals"], tracker), "restricted_mean_lifetime", of="Of the restricted mean"
    )
    texts = [f"{tracker}: {median}.", *(text.format(known[name]) for name, text in _LIFETIMES.items() if name in known)]
    return " ".join(filter(None, [*texts, scenes])), [estimate for estimate in found.values() if estimate is not None]


def _estimate(tables: RunTables, conditions: ReportedConditions, tracker: str, statistic: str) -> Estimate | None:
    """A lifetime of the summary, with its interval."""
    value = _value(conditions.of(tables["summary"], tracker), statistic)
    bounds = scalar_bounds(conditions.of(tables["intervals"], tracker), statistic)
    return None if value is None else Estimate.of(value, bounds, "frames")


def _value(rows: pl.DataFrame, column: str) -> float | None:
    value: float | None = rows[column][0] if rows.height else None
    return value


_MOST_NAMED = 3


def asked(dependence: pl.DataFrame, conditions: ReportedConditions) -> pl.DataFrame:
    """The questions that the headline is about: of each factor that was varied, at the lowest speed.

    Returns rows of `dependence` with a column `role`, in the order of the factors, trackers and statistics. Options of
    trackers follow the other factors. Trackers that differ in one option alone are compared by that option only.
    """
    nominal = pl.col("speed").is_null() | (pl.col("speed") == conditions.reference.speed)
    known = pl.col("statistic").is_in(list(ROLES))
    rows = dependence.filter(nominal, known, pl.col("n_levels") > 1)
    rows = _without_repeated(rows)
    options = [name for name in rows["factor"].unique(maintain_order=True) if name not in FACTORS]
    orders = {"factor": [*FACTORS, *options], "tracker": [*conditions.trackers], "role": list(STATISTICS)}
    rows = rows.with_columns_seq(role=pl.col("statistic").replace_strict(ROLES, return_dtype=pl.String))
    places = [
        pl.col(name).replace_strict(order, range(len(order)), default=-1, return_dtype=pl.Int64)
        for name, order in orders.items()
    ]
    return rows.sort(*places, maintain_order=True)


def _without_repeated(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows without those about trackers that are all compared by one option, or whose largest effect is an option's."""
    of_options = rows.filter(~pl.col("factor").is_in([*FACTORS]))
    of_trackers = rows.filter(pl.col("factor") == "tracker")
    known = of_trackers.join(of_options, on="n_levels", how="anti", maintain_order="left")
    new = known.join(of_options, on=["dataset", "statistic", "effect"], how="anti", maintain_order="left")
    return pl.concat([new, rows.filter(pl.col("factor") != "tracker")])


def factors(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How many effects of factors exceed the margin, the clearest of these, and the smallest of the others."""
    rows = asked(tables["dependence"], conditions)
    if rows.is_empty():
        return None
    counts = [f"{n} {verdict}" for verdict in Verdict if (n := rows.filter(verdict=verdict).height)]
    yes, no = _clearest(rows, Verdict.yes, "low")[::-1][:_MOST_NAMED], _clearest(rows, Verdict.no, "most")[:_MOST_NAMED]
    opening = [
        f"Verdicts on whether {listing(_names(rows), joint='or')} changes a statistic: {listing(counts)}.",
        *_margins(rows),
        f"Factors other than speed are compared at speed {conditions.reference.speed}.",
    ]
    parts = [
        TrackerPart(row["tracker"], f"{sentence_case(difference_sentence(row, row['role']))}.", ids_of(_effects([row])))
        for row in yes
    ]
    if no:
        smallest = f"Smallest effects: {'; '.join(bounded_text(row, row['role']) for row in no)}."
        parts.append(TrackerPart(None, smallest, ids_of(_effects(no))))
    closing = [] if yes or no else _undecided(rows)
    text = " ".join([*opening, *(part.text for part in parts), *closing])
    return Headline(
        "factors",
        text,
        "factor-effects",
        "dependence",
        leading(_effects(yes or no)),
        opening=" ".join(opening),
        closing=" ".join(closing),
        parts=tuple(parts),
    )


def _effects(rows: Sequence[Mapping[str, Any]]) -> list[Estimate]:
    return [Estimate.of_row(row, "effect", "low", "high", row["unit"]) for row in rows]


def _names(rows: pl.DataFrame) -> Sequence[str]:
    names: list[str] = rows["factor"].unique(maintain_order=True).to_list()
    return [f"the {factor_name(name)}" for name in names]


def _margins(rows: pl.DataFrame) -> list[str]:
    """The margins, in words."""
    ratios = rows.filter(unit="ratio")["margin"].drop_nulls().to_list()
    return [f"The margin is a ratio of {ratio(ratios[0])}."] if ratios else []


def _clearest(rows: pl.DataFrame, verdict: Verdict, bound: str) -> list[dict[str, Any]]:
    """Rows with a verdict, from the one whose bound is the smallest relative to its margin."""
    return sorted(rows.filter(verdict=verdict).to_dicts(), key=lambda row: _excess(row, bound))


def _excess(row: Mapping[str, Any], column: str) -> float:
    """A size relative to the margin, on the scale of its interval."""
    scale = float if row["unit"] == "px" else math.log
    return scale(row[column]) / scale(row["margin"])


def _undecided(rows: pl.DataFrame) -> list[str]:
    """Why all answers are undecided, in the words of the table, and the largest effect that was measured."""
    reasons = rows["why"].drop_nulls().unique(maintain_order=True).to_list()
    known = sorted(rows.drop_nulls("effect").to_dicts(), key=lambda row: -_excess(row, "effect"))[:1]
    sentences = [f"Reason: {reasons[0]}."] if len(reasons) == 1 else []
    largest = [
        f"Largest measured effect, which may be chance: {difference_sentence(row, row['role'])}." for row in known
    ]
    return [*sentences, *largest]
