"""What the paper finds, as data. It is compared with what was measured, and never decides it."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import polars as pl

from tracknoise import words
from tracknoise.analysis.factors import DEPENDENCE, ROLES
from tracknoise.statistics.yardstick import FACTORS
from tracknoise.tables.findings_schema import EFFECTS
from tracknoise.tables.schema import CONDITION, VERDICT, Schema

STATISTICS: Mapping[str, str] = {role: name for role, name in words.STATISTICS.items() if role != "core"}
"""Rows of the paper's summary tables: name of each statistic by its role."""
TRACKERS = ("lucas-kanade", "correspondence")
"""Kinds of the trackers that the paper compares."""
_CLAIMS = "claims"
_KEYS = ["dataset", "factor", *CONDITION, "statistic"]
_YARDSTICK: Schema = {f"yardstick_{name}": kind for name, kind in EFFECTS.items() if name not in _KEYS}
COMPARISON: Schema = {
    **DEPENDENCE,
    **_YARDSTICK,
    "role": pl.String,
    "paper": VERDICT,
    "agreement": pl.String,
    "yardstick_agreement": pl.String,
}
AGREEMENTS = ("agree", "disagree", "undecided")


@cache
def findings() -> Mapping[str, Mapping[str, Any]]:
    """The paper's findings: by experiment, factor and statistic, and by tracker where it distinguishes them."""
    return {name: section for name, section in _document().items() if name != _CLAIMS}


def stated_claims() -> Sequence[Mapping[str, Any]]:
    """The claims of its abstract, text, figures and captions (`tracknoise.paper.claim_verdicts`)."""
    entries: Sequence[Mapping[str, Any]] = _document()[_CLAIMS]
    return entries


@cache
def _document() -> Mapping[str, Any]:
    text = (resources.files("tracknoise.report") / "paper_findings.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def title(experiment: str) -> str:
    """What the paper calls one of its experiments; its own name where the paper has no such experiment."""
    return str(findings().get(experiment, {}).get("title", experiment))


def finding(experiment: str | None, factor: str, role: str, kind: str | None) -> str | None:
    """What the paper says: ``yes``, ``no``, or None where it says nothing.

    `experiment`: None where a run repeats none. `kind`: None where the factor is the tracker.
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
    """The questions that the paper's tables ask, and those of other factors that the run varies.

    Returns schema `COMPARISON`, sorted by factor, tracker and statistic. The columns of `DEPENDENCE` are of the
    comparison paired by scene; those of the paper's yardstick begin with `yardstick_` and are null for the core.
    `paper` and the agreements are null where the paper says nothing.
    """
    rows = []
    nominal = pl.col("speed").is_null() | (pl.col("speed") == asked.speed)
    for row in _joined(effects, dependence).filter(nominal, pl.col("statistic").is_in(list(ROLES))).to_dicts():
        role = ROLES[row["statistic"]]
        theirs = finding(asked.experiment, row["factor"], role, asked.trackers.get(row["tracker"]))
        if (row["n_levels"] or row["yardstick_n_levels"]) > 1 or theirs:
            judged = {"agreement": row["verdict"], "yardstick_agreement": row["yardstick_verdict"]}
            agreed = {name: _agreement(verdict, theirs) for name, verdict in judged.items()}
            rows.append({**row, "role": role, "paper": theirs, **agreed})
    rows.sort(key=lambda row: _order(list(asked.trackers), row))
    return pl.DataFrame(rows, schema=dict(COMPARISON))


def _joined(effects: pl.DataFrame, dependence: pl.DataFrame) -> pl.DataFrame:
    """Both answers to each question; null where there is only one."""
    yardstick = effects.select(*_KEYS, pl.exclude(_KEYS).name.prefix("yardstick_"))
    return dependence.join(
        yardstick, on=_KEYS, how="full", coalesce=True, nulls_equal=True, maintain_order="left_right"
    )


def tally(table: pl.DataFrame, *, of: str = "agreement") -> dict[str, int]:
    """How many cells of a comparison fall to each of `AGREEMENTS`, by paired verdicts, or `yardstick_agreement`."""
    return {name: table.filter(pl.col(of) == name).height for name in AGREEMENTS}


def _agreement(ours: str | None, theirs: str | None) -> str | None:
    if theirs is None:
        return None
    return "undecided" if ours in (None, "undecided") else "agree" if ours == theirs else "disagree"


def _order(trackers: Sequence[str], row: Mapping[str, Any]) -> tuple[int, int, int]:
    tracker = trackers.index(row["tracker"]) if row["tracker"] in trackers else 0
    factor = list(FACTORS).index(row["factor"]) if row["factor"] in FACTORS else len(FACTORS)
    return factor, tracker, list(words.STATISTICS).index(row["role"])
