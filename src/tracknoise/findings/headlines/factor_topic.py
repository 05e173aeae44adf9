"""The headline about factors: which have an effect, which have none, and which are undecided."""

from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.headlines.headline import Headline, RunTables, leading
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.findings.roles import ROLES
from tracknoise.findings.wording import SPACE, STATISTICS, effect_text, listing
from tracknoise.statistics.factors import FACTORS
from tracknoise.tables.enumerations import Verdict
from tracknoise.tables.schema import CONDITION

_KEYS = ["dataset", "factor", *CONDITION, "statistic"]
_MOST_NAMED = 3
_CLEAREST = {
    Verdict.yes: "Effects with the highest lower bounds",
    Verdict.no: "Effects with the lowest upper bounds",
}
"""How the effects are introduced whose verdicts are the clearest."""


def asked(dependence: pl.DataFrame, effects: pl.DataFrame, conditions: ReportedConditions) -> pl.DataFrame:
    """The questions that the paper's tables ask: of each factor that was varied, at the lowest speed.

    Parameters
    ----------
    dependence, effects
        RunTables of the same rows.
    conditions
        Say which speed is the lowest.

    Returns
    -------
    polars.DataFrame
        Rows of `dependence` with a column `role`, in the order of the factors, trackers and statistics.
    """
    varied = effects.filter(pl.col("n_levels") > 1).select(_KEYS)
    nominal = pl.col("speed").is_null() | (pl.col("speed") == conditions.reference.speed)
    rows = dependence.join(varied, on=_KEYS, how="semi", nulls_equal=True).filter(
        nominal & pl.col("statistic").is_in(list(ROLES))
    )
    orders = {"factor": list(FACTORS), "tracker": [*conditions.trackers], "role": list(STATISTICS)}
    rows = rows.with_columns(role=pl.col("statistic").replace_strict(ROLES, return_dtype=pl.String))
    places = [
        pl.col(name).replace_strict(order, range(len(order)), default=-1, return_dtype=pl.Int64)
        for name, order in orders.items()
    ]
    return rows.sort(*places, maintain_order=True)


def factors(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How many effects of factors exceed the margin, the largest of these, and the smallest of the others."""
    rows = asked(tables["dependence"], tables["effects"], conditions)
    if rows.is_empty():
        return None
    counts = [f"{n} {verdict}" for verdict in Verdict if (n := rows.filter(verdict=verdict).height)]
    yes = rows.filter(verdict=Verdict.yes).sort("low", descending=True, nulls_last=True, maintain_order=True)
    no = rows.filter(verdict=Verdict.no).sort("high", maintain_order=True)
    clearest = {Verdict.yes: yes.head(_MOST_NAMED).to_dicts(), Verdict.no: no.head(_MOST_NAMED).to_dicts()}
    margin = f"{100 * rows['margin'].item(0):g}{SPACE}%"
    sentences = [
        f"Verdicts on whether {listing(_names(rows), joint='or')} changes a statistic: {listing(counts)}.",
        f"The margin is {margin}.",
        f"Factors other than speed are compared at speed {conditions.reference.speed}.",
        *(f"{_CLEAREST[answer]}: {_effects(found)}." for answer, found in clearest.items() if found),
    ]
    decided = clearest[Verdict.yes] or clearest[Verdict.no]
    sentences += [] if decided else _undecided(rows)
    estimate = leading([Estimate.of_row(row, "effect", "low", "high", "share") for row in decided])
    return Headline("factors", " ".join(sentences), "factor-effects", "dependence", estimate)


def _names(rows: pl.DataFrame) -> Sequence[str]:
    names: list[str] = rows["factor"].unique(maintain_order=True).to_list()
    return [f"the {name}" for name in names]


def _undecided(rows: pl.DataFrame) -> list[str]:
    """Why all answers are undecided, in the words of the table, and the largest effect that was measured."""
    reasons = rows["why"].drop_nulls().unique(maintain_order=True).to_list()
    known = rows.drop_nulls("effect").sort("effect", descending=True, maintain_order=True).head(1).to_dicts()
    sentences = [f"Reason: {reasons[0]}."] if len(reasons) == 1 else []
    return [*sentences, *(f"Largest measured effect, which may be chance: {_effects([row])}." for row in known)]


def _effects(rows: Sequence[Mapping[str, Any]]) -> str:
    return "; ".join(map(_effect, rows))


def _effect(row: Mapping[str, Any]) -> str:
    whose = f" of {row['tracker']}" if row["tracker"] else ""
    return f"{row['factor']} on {STATISTICS[row['role']]}{whose}, {effect_interval(row)}"


def effect_interval(row: Mapping[str, Any]) -> str:
    """Write an effect with its interval: ``45 % (30 % to 60 %)``; empty where it is unknown."""
    text = effect_text(row["effect"])
    if not text or row["low"] is None or row["high"] is None:
        return text
    return f"{text} ({effect_text(row['low'])} to {effect_text(row['high'])})"
