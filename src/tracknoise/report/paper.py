"""What the paper finds, as data. It is compared with what was measured, and never decides it."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import polars as pl

from tracknoise.findings import wording
from tracknoise.findings.roles import ROLES
from tracknoise.findings.wording import DASH, SPACE, effect_text
from tracknoise.statistics.factors import FACTORS
from tracknoise.tables.schema import CONDITION, EFFECTS, VERDICT, Schema

STATISTICS: Mapping[str, str] = wording.STATISTICS
"""Rows of the paper's summary tables: name of each statistic by its role."""
COMPARISON: Schema = {
    **EFFECTS,
    "role": pl.String,
    "point_verdict": VERDICT,
    "point_why": pl.String,
    "interval_effect": pl.Float64,
    "low": pl.Float64,
    "high": pl.Float64,
    "n_scenes": pl.Int32,
    "paper": VERDICT,
    "agreement": pl.String,
    "point_agreement": pl.String,
}
AGREEMENTS = ("agree", "disagree", "undecided")
_KEYS = ["dataset", "factor", *CONDITION, "statistic"]


@cache
def findings() -> Mapping[str, Mapping[str, Any]]:
    """The paper's findings: by experiment, factor and statistic, and by tracker where it distinguishes them."""
    text = (resources.files("tracknoise.report") / "paper_findings.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def title(experiment: str) -> str:
    """What the paper calls one of its experiments; its own name where the paper has no such experiment."""
    return str(findings().get(experiment, {}).get("title", experiment))


def finding(experiment: str | None, factor: str, role: str, kind: str | None) -> str | None:
    """What the paper says: ``yes``, ``no``, or None where it says nothing.

    Parameters
    ----------
    experiment
        Of the paper. None where a run repeats none.
    factor
        Name in `tracknoise.statistics.effects.FACTORS`.
    role
        Name in `STATISTICS`.
    kind
        Of the tracker in question. None where the factor is the tracker.
    """
    cell = findings().get(experiment or "", {}).get(factor, {}).get(role)
    return cell.get(kind) if isinstance(cell, dict) else cell


@dataclass(frozen=True, slots=True)
class Asked:
    """What the verdicts of a run are compared with.

    Attributes
    ----------
    experiment
        Of the paper. None where the run repeats none.
    trackers
        Kind of each tracker by its name, in their order.
    speed
        The speed at which factors other than the speed are compared.
    """

    experiment: str | None
    trackers: Mapping[str, str]
    speed: int


def compare(effects: pl.DataFrame, dependence: pl.DataFrame, asked: Asked) -> pl.DataFrame:
    """The effects that the paper's tables ask for, and those of other factors that the run varies.

    Parameters
    ----------
    effects, dependence
        Tables of the run.
    asked
        The paper's experiment, and the trackers.

    Returns
    -------
    polars.DataFrame
        Schema `COMPARISON`, sorted by factor, tracker and statistic. `paper` and `agreement` are null where the paper
        says nothing. Otherwise `agreement` is one of `AGREEMENTS`. Where verdicts have intervals, `verdict` and `why`
        are theirs, and `interval_effect` lies between `low` and `high`. Otherwise they are those of the effect alone,
        and the interval is null. `point_verdict`, `point_why` and `point_agreement` are always of the effect alone.
    """
    rows = []
    nominal = pl.col("speed").is_null() | (pl.col("speed") == asked.speed)
    for row in _judged(effects, dependence).filter(nominal, pl.col("statistic").is_in(list(ROLES))).to_dicts():
        role = ROLES[row["statistic"]]
        said = finding(asked.experiment, row["factor"], role, asked.trackers.get(row["tracker"]))
        if row["n_levels"] > 1 or said:
            agreements = {"agreement": row["verdict"], "point_agreement": row["point_verdict"]}
            agreed = {name: _agreement(verdict, said) for name, verdict in agreements.items()}
            rows.append({**row, "role": role, "paper": said, **agreed})
    rows.sort(key=lambda row: _order(list(asked.trackers), row))
    return pl.DataFrame(rows, schema=dict(COMPARISON))


def _judged(effects: pl.DataFrame, dependence: pl.DataFrame) -> pl.DataFrame:
    """Effects with the verdicts that come with an interval, where there are any."""
    decided = dependence.select(
        *_KEYS, "low", "high", "n_scenes", interval_effect="effect", decided="verdict", decided_why="why"
    )
    table = effects.join(decided, on=_KEYS, how="left", nulls_equal=True, maintain_order="left")
    known = pl.col("decided").is_not_null()
    return table.with_columns(
        point_verdict="verdict",
        point_why="why",
        verdict=pl.when(known).then("decided").otherwise("verdict"),
        why=pl.when(known).then("decided_why").otherwise("why"),
    )


def side_by_side(table: pl.DataFrame) -> pl.DataFrame:
    """A comparison as the paper prints it: one row per statistic, columns ``FACTOR, TRACKER: HEADING``."""
    columns: dict[str, list[str]] = {"statistic": list(STATISTICS.values())}
    for asked, group in table.group_by("factor", "tracker", maintain_order=True):
        cells = {row["role"]: row for row in group.to_dicts()}
        heading = ", ".join(str(name) for name in asked if name)
        columns[f"{heading}: here"] = [_here(cells.get(role)) for role in STATISTICS]
        if group["paper"].count():
            columns[f"{heading}: paper"] = [_text(cells.get(role), "paper") for role in STATISTICS]
            columns[f"{heading}: verdicts"] = [_text(cells.get(role), "agreement") for role in STATISTICS]
            columns[f"{heading}: effects"] = [_text(cells.get(role), "point_agreement") for role in STATISTICS]
    return pl.DataFrame(columns)


def tally(table: pl.DataFrame, *, of: str = "agreement") -> dict[str, int]:
    """How many cells of a comparison fall to each of `AGREEMENTS`, by their verdicts, or `point_agreement`."""
    return {name: table.filter(pl.col(of) == name).height for name in AGREEMENTS}


def interval_text(row: Mapping[str, Any]) -> str:
    """Write the effect of a comparison's row, with its interval if it has one: ``45 %, 30 % to 60 %``."""
    if row["low"] is None or row["high"] is None:
        return effect_text(row["effect"])
    ends = f"{effect_text(row['low'])} to {effect_text(row['high'])}".replace(" ", SPACE)
    return f"{effect_text(row['interval_effect'])}, {ends}"


def _agreement(ours: str, said: str | None) -> str | None:
    if said is None:
        return None
    return "undecided" if ours == "undecided" else "agree" if ours == said else "disagree"


def _order(trackers: Sequence[str], row: Mapping[str, Any]) -> tuple[int, int, int]:
    tracker = trackers.index(row["tracker"]) if row["tracker"] else 0
    return list(FACTORS).index(row["factor"]), tracker, list(STATISTICS).index(row["role"])


def _here(row: Mapping[str, Any] | None) -> str:
    if row is None:
        return DASH
    effect = interval_text(row)
    return f"{_verdict(row)}{SPACE}({effect})" if effect else str(row["verdict"])


def _verdict(row: Mapping[str, Any]) -> str:
    """The verdict; where its interval does not decide, that of the effect alone, with a question mark."""
    if row["verdict"] == "undecided" and row["point_verdict"] != "undecided":
        return f"{row['point_verdict']}?"
    return str(row["verdict"])


def _text(row: Mapping[str, Any] | None, column: str) -> str:
    return str((row or {}).get(column) or DASH)
