"""The headline about factors: which have an effect, which have none, and which are undecided."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.factor_text import bounded_text, difference_sentence, factor_name
from tracknoise.findings.headlines.headline import Headline, RunTables, TrackerPart, ids_of, leading
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.findings.roles import ROLES
from tracknoise.findings.wording import STATISTICS, listing, ratio, sentence_case
from tracknoise.statistics.factors.factors import FACTORS
from tracknoise.tables.enumerations import Verdict

_MOST_NAMED = 3


def asked(dependence: pl.DataFrame, conditions: ReportedConditions) -> pl.DataFrame:
    """The questions that the headline is about: of each factor that was varied, at the lowest speed.

    Parameters
    ----------
    dependence
        Table of the run.
    conditions
        Say which speed is the lowest.

    Returns
    -------
    polars.DataFrame
        Rows of `dependence` with a column `role`, in the order of the factors, trackers and statistics. Options of
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
