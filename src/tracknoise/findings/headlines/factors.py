"""The headline about factors: which matter, which do not, and which nobody can tell."""

from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.findings.headlines.headline import Headline, Tables, leading
from tracknoise.findings.headlines.scope import Estimate, Scope
from tracknoise.findings.wording import SPACE, STATISTICS, count, effect_text, listing
from tracknoise.statistics.curves import NAMES
from tracknoise.statistics.effects import FACTORS
from tracknoise.tables.schema import CONDITION

ROLES: Mapping[str, str] = {
    **{name: role for names in NAMES.values() for role, name in names.items() if role in STATISTICS},
    "lifetime": "lifetime",
    "outlier_ratio": "outlier_ratio",
}
"""Role of each statistic that is asked about, by its name in the tables."""
_KEYS = ["dataset", "factor", *CONDITION, "statistic"]
_MOST_NAMED = 3
_SAYS = (("yes", "{} yes"), ("no", "{} no"), ("undecided", "{} undecided"))


def asked(dependence: pl.DataFrame, effects: pl.DataFrame, scope: Scope) -> pl.DataFrame:
    """The questions that the paper's tables ask: of each factor that was varied, at the lowest speed.

    Parameters
    ----------
    dependence, effects
        Tables of the same rows.
    scope
        Says which speed is the lowest.

    Returns
    -------
    polars.DataFrame
        Rows of `dependence` with a column `role`, in the order of the factors, trackers and statistics.
    """
    varied = effects.filter(pl.col("n_levels") > 1).select(_KEYS)
    nominal = pl.col("speed").is_null() | (pl.col("speed") == scope.reference.speed)
    rows = dependence.join(varied, on=_KEYS, how="semi", nulls_equal=True).filter(
        nominal & pl.col("statistic").is_in(list(ROLES))
    )
    orders = {"factor": list(FACTORS), "tracker": [*scope.trackers], "role": list(STATISTICS)}
    rows = rows.with_columns(role=pl.col("statistic").replace_strict(ROLES, return_dtype=pl.String))
    places = [
        pl.col(name).replace_strict(order, range(len(order)), default=-1, return_dtype=pl.Int64)
        for name, order in orders.items()
    ]
    return rows.sort(*places, maintain_order=True)


def factors(tables: Tables, scope: Scope) -> Headline | None:
    """How many questions are answered which way, the largest effects that matter, and what does not."""
    rows = asked(tables["dependence"], tables["effects"], scope)
    if rows.is_empty():
        return None
    counts = [form.format(n) for verdict, form in _SAYS if (n := rows.filter(verdict=verdict).height)]
    matter = rows.filter(verdict="yes").sort("low", descending=True, nulls_last=True, maintain_order=True)
    largest = matter.head(_MOST_NAMED).to_dicts()
    margin = f"{100 * rows['margin'].item(0):g}{SPACE}%"
    text = (
        f"Does {listing(_names(rows), joint='or')} change a statistic by more than {margin}, at speed "
        f"{scope.reference.speed} unless speeds are compared? Of {count(rows.height, 'question')}, {listing(counts)}."
    )
    if largest:
        text += f" The clearest yes: {'; '.join(map(_told, largest))}."
    no = rows.filter(verdict="no").sort("high", maintain_order=True).head(_MOST_NAMED).to_dicts()
    if no:
        text += f" The clearest no: {'; '.join(map(_told, no))}."
    if not largest and not no:
        text += _undecided(rows)
    return Headline("factors", text, "factor-effects", "dependence", leading([_estimate(row) for row in largest or no]))


def _names(rows: pl.DataFrame) -> Sequence[str]:
    names: list[str] = rows["factor"].unique(maintain_order=True).to_list()
    return [f"the {name}" for name in names]


def _undecided(rows: pl.DataFrame) -> str:
    """Why nothing is decided, in the words of the table, and what was measured nevertheless."""
    reasons = rows["why"].drop_nulls().unique(maintain_order=True).to_list()
    known = rows.drop_nulls("effect").sort("effect", descending=True, maintain_order=True)
    why = f" Why: {reasons[0]}." if len(reasons) == 1 else ""
    if known.is_empty():
        return why
    return f"{why} The largest effect measured, which may be chance: {_told(known.row(0, named=True))}."


def _told(row: Mapping[str, Any]) -> str:
    whose = f" of {row['tracker']}" if row["tracker"] else ""
    return f"{row['factor']}, {STATISTICS[row['role']]}{whose}, {effect_interval(row)}"


def effect_interval(row: Mapping[str, Any]) -> str:
    """Write an effect with its interval: ``45 % (30 % to 60 %)``; empty where it is unknown."""
    text = effect_text(row["effect"])
    if not text or row["low"] is None or row["high"] is None:
        return text
    return f"{text} ({effect_text(row['low'])} to {effect_text(row['high'])})"


def _estimate(row: Mapping[str, Any]) -> Estimate:
    return Estimate(row["effect"], row["low"], row["high"], "share")
