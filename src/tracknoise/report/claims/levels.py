"""Judges claims on outlier ratios and on the distribution of errors."""

from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.findings.wording import listing, percent
from tracknoise.report.bands import of_scalar
from tracknoise.report.claims.claim import Agreement, Claim, Judgement
from tracknoise.report.claims.points import curve, estimate, is_within, tracker_named
from tracknoise.report.report_data import ReportData
from tracknoise.tables.defaults import MARGIN
from tracknoise.tables.enumerations import Shape, Verdict

_ROUNDING = 0.05
"""The paper gives outlier ratios in steps of 10 %."""


def judge_outlier_level(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the pooled ratio at every speed, and its interval. Ratios do not depend on trimming."""
    data, stated = runs[claim.experiment], claim.stated
    table = data.reference(data.outliers).filter(tracker=tracker_named(data, stated["tracker"])).sort("speed")
    rows = of_scalar(table, data.intervals, "outlier_ratio").drop_nulls("pooled_ratio").to_dicts()
    if not rows:
        return Judgement(Agreement.open, reason="no outlier ratio is known")
    low, high = stated["low"] - _ROUNDING, stated["high"] + _ROUNDING
    value = ", ".join(f"{percent(row['pooled_ratio'])}{_bounds(row)} at speed {row['speed']}" for row in _ends(rows))
    if all(low <= row["pooled_ratio"] <= high for row in rows):
        return Judgement(Agreement.agrees, value)
    outside = [str(row["speed"]) for row in rows if row["low"] is not None and (row["low"] > high or row["high"] < low)]
    if outside:
        speeds = f"{'speed' if len(outside) == 1 else 'speeds'} {listing(outside)}"
        return Judgement(Agreement.disagrees, value, f"outside {percent(low)} to {percent(high)} at {speeds}")
    return Judgement(Agreement.open, value, "the interval contains the paper's level, or there is none")


def judge_zero_mean_gaussian(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """By the test of the mean and the shape of the distribution, at the nominal speed."""
    data = runs[claim.experiment]
    answers = _answers(data, tracker_named(data, claim.stated["tracker"]) or "")
    return Judgement(_all_of(answers), _described(answers))


def judge_not_zero_mean_gaussian(claim: Claim, runs: Mapping[str, ReportData]) -> Judgement:
    """As `judge_zero_mean_gaussian` for every tracker. One tracker with such errors is enough."""
    data = runs[claim.experiment]
    found = {tracker: _answers(data, tracker) for tracker in data.trackers}
    value = "; ".join(f"{tracker}: {_described(answers)}" for tracker, answers in found.items())
    contrary = {Agreement.agrees: Agreement.disagrees, Agreement.disagrees: Agreement.agrees}
    each = {contrary.get(verdict, verdict) for verdict in map(_all_of, found.values())}
    for verdict in (Agreement.agrees, Agreement.open):
        if verdict in each:
            return Judgement(verdict, value)
    return Judgement(Agreement.disagrees if each else Agreement.open, value)


def _ends(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The smallest and the largest ratio."""
    ordered = sorted(rows, key=lambda row: row["pooled_ratio"])
    return [ordered[0], *ordered[1:][-1:]]


def _bounds(row: Mapping[str, Any]) -> str:
    return "" if row["low"] is None else f" ({percent(row['low'])} to {percent(row['high'])})"


def _answers(data: ReportData, tracker: str) -> dict[str, bool | None]:
    """Whether errors of a tracker have zero mean, and are Gaussian; None where that is undecided."""
    tests = data.nominal(data.zero_mean).filter(pl.col("at").is_null(), tracker=tracker, trimming=data.trimming)
    shapes = data.nominal(data.gaussianity).filter(tracker=tracker, trimming=data.trimming)["verdict"].to_list()
    return {"mean": _is_zero(tests, data, tracker), "shape": _is_gaussian([Shape(shape) for shape in shapes])}


def _is_gaussian(shapes: Sequence[Shape]) -> bool | None:
    """False where errors of any age are not Gaussian; True where those of all ages are."""
    if any(shape not in (Shape.gaussian, Shape.undecided) for shape in shapes):
        return False
    return True if shapes and Shape.undecided not in shapes else None


def _is_zero(tests: pl.DataFrame, data: ReportData, tracker: str) -> bool | None:
    """False where the mean differs from zero; True where its intervals are within the margin of the root mean square.

    The intervals are those at all ages (or frames), in u and in v.
    """
    if Verdict.yes in tests["verdict"]:
        return False
    means, sizes = (curve(data, tracker, role) for role in ("mean", "second"))
    points = means.join(sizes.select("since", size_u="u", size_v="v"), on="since").to_dicts()
    slight = (is_within(estimate(row, axis), MARGIN * row[f"size_{axis}"]) for row in points for axis in "uv")
    return True if points and all(slight) else None


def _all_of(answers: Mapping[str, bool | None]) -> Agreement:
    if False in answers.values():
        return Agreement.disagrees
    return Agreement.open if None in answers.values() else Agreement.agrees


_NAMES = {
    "mean": {True: "zero mean", False: "nonzero mean", None: "mean undecided"},
    "shape": {True: "Gaussian", False: "not Gaussian", None: "shape undecided"},
}


def _described(answers: Mapping[str, bool | None]) -> str:
    return listing(_NAMES[name][answer] for name, answer in answers.items())
