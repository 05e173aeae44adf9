"""The report's first section: what was found, in sentences, and the verdicts of every tracker and speed."""

from typing import Any

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_estimate
from tracknoise.findings.headlines.reported_conditions import ReportedConditions, curve_bounds, scalar_bounds
from tracknoise.findings.intervals.scalar_bounds import INTERPOLATED
from tracknoise.findings.wording import DASH, SHAPES, SPACE, chance
from tracknoise.report.evidence import Evidence
from tracknoise.report.tables import Cells
from tracknoise.statistics.factors import ReferenceCondition

_GROWTH = {"white": "constant", "none": "none of these"}
"""Behaviours whose names need more words."""
NOTHING = "What follows from the tables was not worked out for this run: `tracknoise run` does so."
_ZERO = {"yes": "no", "no": "yes", "undecided": "undecided"}
"""Answers to whether the mean error is zero, by the verdict on whether it differs from zero."""


def sentences(evidence: Evidence) -> list[dict[str, Any]]:
    """Rows of the findings in the order of their rank, with the file of the report that holds their table, `file`."""
    return [{**row, "file": row["table"].replace("_", "-")} for row in evidence.findings.sort("rank").to_dicts()]


def verdicts(evidence: Evidence) -> Cells:
    """A row a tracker and speed in the view that figures are about: size of errors, and what is said of them."""
    axis, dropped = evidence.axis, evidence.percentile is not None
    headings = ["tracker", "speed", f"at {axis.name}", "u", "v", "is zero?", *(["untrimmed"] if dropped else [])]
    headings += ["trimmed" if dropped else "errors", "in u", "in v", "outliers", "median lifetime"]
    groups = [("", 3), ("rms (px)", 2), ("mean", 1), ("Gaussian?", 1 + dropped), ("grow like", 2), ("", 2)]
    rows = [_row(evidence, tracker, speed) for tracker in evidence.trackers for speed in evidence.speeds]
    trimmed = "errors trimmed unless the heading says otherwise, " if dropped else ""
    caption = f"Verdicts{evidence.where}, {trimmed}median lifetimes interpolated between whole frames"
    shown = [row for row in rows if row]
    return Cells(caption, headings, shown, [False, True, True, *[False] * (len(headings) - 3)], groups)


def _row(evidence: Evidence, tracker: str, speed: int) -> list[str]:
    """Cells of one condition; empty where it was not measured."""
    chosen = _scope(evidence, speed)
    summary = _first(chosen.of(evidence.summary, tracker))
    if summary is None:
        return []
    return [
        tracker,
        str(speed),
        DASH if summary["at"] is None else str(summary["at"]),
        *(_rms(evidence, chosen, tracker, coordinate) for coordinate in "uv"),
        _zero_mean(evidence, chosen, tracker),
        *_shapes(evidence, chosen, tracker, summary["at"]),
        *(_growth(evidence, chosen, tracker, coordinate) for coordinate in "uv"),
        _outliers(evidence, chosen, tracker),
        _median_lifetime(evidence, chosen, tracker),
    ]


def _scope(evidence: Evidence, speed: int) -> ReportedConditions:
    found = {name: evidence.key_frame(name) for name in evidence.directions}
    frames = {name: frame for name, frame in found.items() if frame is not None}
    reference = ReferenceCondition(**evidence.view, speed=speed, key_frames=frames)
    return ReportedConditions(reference, evidence.trackers, evidence.population, evidence.percentile)


def _rms(evidence: Evidence, scope: ReportedConditions, tracker: str, coordinate: str) -> str:
    row = scope.of(evidence.summary, tracker).row(0, named=True)
    value = row[f"trimmed_rms_{coordinate}_px"]
    if value is None:
        return DASH
    bounds = curve_bounds(scope.of(evidence.intervals, tracker), scope, "second", row["at"], coordinate)
    return format_estimate(Estimate.of(value, bounds, "px")).replace(f"{SPACE}px", "")


def _zero_mean(evidence: Evidence, scope: ReportedConditions, tracker: str) -> str:
    rows = scope.of(evidence.zero_mean, tracker).filter(pl.col("at").is_null(), trimming="trimmed")
    row = _first(rows.filter(axis=evidence.axis.name))
    if row is None:
        return DASH
    p = row["sign_flip_p"] if row["sign_flip_p_adjusted"] is None else row["sign_flip_p_adjusted"]
    return _ZERO[row["verdict"]] + ("" if p is None else f" ({chance(p)})")


def _shapes(evidence: Evidence, scope: ReportedConditions, tracker: str, at: int | None) -> list[str]:
    """Verdict on the shape in the band of ages that holds the reference, before trimming and after."""
    rows = scope.of(evidence.gaussianity, tracker).sort("age_low")
    since = 1 if at is None else abs(scope.since(at))
    holding = rows.filter(pl.col("age_low") <= since, pl.col("age_high").is_null() | (pl.col("age_high") >= since))
    found = [_first(holding.filter(trimming=trimming)) for trimming in reversed(scope.trimmings)]
    return [DASH if row is None else SHAPES[row["verdict"]].partition(" (")[0] for row in found]


def _growth(evidence: Evidence, scope: ReportedConditions, tracker: str, coordinate: str) -> str:
    rows = scope.of(evidence.time_structure, tracker).filter(trimming="trimmed", coordinate=coordinate)
    row = _first(rows)
    return DASH if row is None else _GROWTH.get(row["verdict"], row["verdict"])


def _outliers(evidence: Evidence, scope: ReportedConditions, tracker: str) -> str:
    value = scope.of(evidence.summary, tracker)["outlier_ratio"][0]
    if value is None:
        return DASH
    bounds = scalar_bounds(scope.of(evidence.intervals, tracker), "outlier_ratio")
    return format_estimate(Estimate.of(value, bounds, "share"))


def _median_lifetime(evidence: Evidence, scope: ReportedConditions, tracker: str) -> str:
    """Interpolated, so that conditions which differ by less than a frame can be told apart."""
    rows = scope.of(evidence.intervals, tracker).filter(statistic=f"{INTERPOLATED}median_lifetime")
    row = _first(rows.drop_nulls("value"))
    return DASH if row is None else format_estimate(Estimate.of_row(row, "value", "low", "high", "frames"))


def _first(rows: pl.DataFrame) -> dict[str, Any] | None:
    return rows.row(0, named=True) if rows.height else None
