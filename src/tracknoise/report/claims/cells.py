"""Judges claims that a factor changes a statistic: the cells of the paper's summary tables."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.findings.factor_text import size_text
from tracknoise.findings.wording import effect_text
from tracknoise.report.claims.claim import Agreement, Claim, Judgement
from tracknoise.report.claims.points import tracker_named
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Verdict

_UNKNOWN_DIRECTION = "the paper's direction is not on record"


def judge_cell(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the verdict that is paired by scene, and the direction of the difference where the paper's is on record."""
    row = _row(claim, runs[claim.experiment])
    if row is None:
        return Judgement(Agreement.open, reason=f"the run does not vary the {claim.stated['factor']}")
    ours, said = row["verdict"], claim.stated["said"]
    if ours in (None, Verdict.undecided):
        return Judgement(Agreement.open, _value(row), row["why"] or row["yardstick_why"] or "undecided")
    if ours != said:
        return Judgement(Agreement.disagrees, _value(row))
    return _directed(claim, row) if said == Verdict.yes else Judgement(Agreement.agrees, _value(row))


def judge_effect_bound(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the paper's yardstick: the largest difference between two levels, relative to the variation common to them."""
    data, stated = runs[claim.experiment], claim.stated
    rows = data.comparison.filter(factor=stated["factor"], role=stated["role"]).drop_nulls("yardstick_effect")
    if rows.is_empty():
        return Judgement(Agreement.open, reason=f"the run does not vary the {stated['factor']}")
    values = ", ".join(f"{row['tracker']}: {effect_text(row['yardstick_effect'])}" for row in rows.to_dicts())
    within = (rows["yardstick_effect"] <= stated["most"]).all()
    return Judgement(Agreement.agrees if within else Agreement.disagrees, values, "largest differences, no interval")


def _row(claim: Claim, data: ReportData) -> Mapping[str, Any] | None:
    stated, kind = claim.stated, claim.stated["tracker"]
    name = tracker_named(data, kind) if kind else None
    whose = pl.col("tracker") == name if name else pl.col("tracker").is_null()
    rows = data.comparison.filter(whose, factor=stated["factor"], role=stated["role"])
    varied = rows.filter(pl.max_horizontal("n_levels", "yardstick_n_levels") > 1)
    return varied.row(0, named=True) if varied.height and (name or not kind) else None


def _directed(claim: Claim, row: Mapping[str, Any]) -> Judgement:
    """The verdict where both find a change."""
    said, ours = claim.stated.get("rises"), _rises(row)
    if ours is None:
        return Judgement(Agreement.agrees, _value(row))
    direction = f"{'rises' if ours else 'falls'} with speed"
    if said is None:
        return Judgement(Agreement.agrees, _value(row), f"{direction}; {_UNKNOWN_DIRECTION}")
    return Judgement(Agreement.agrees if ours == said else Agreement.opposite, _value(row), direction)


def _rises(row: Mapping[str, Any]) -> bool | None:
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
