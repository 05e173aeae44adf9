"""The noise to give to an estimator, from windows of tracks: sentences of one tracker."""

from typing import Any

import polars as pl

from tracknoise.findings.headlines.window_topic import LEAST_WINDOWS, window_floor_px
from tracknoise.findings.wording import number, pixels, ratio
from tracknoise.report.report_data import ReportData
from tracknoise.report.reported import reported_conditions

WINDOW = 15
"""Length of the windows that sentences are about, in observations, or else the nearest shorter one.

At least `tracknoise.findings.headlines.window_topic.LEAST_WINDOWS` of them show the depth of their point.
"""


def sigma_sentence(data: ReportData, tracker: str) -> str:
    """What an estimator should set, and what residuals look like. Empty where windows were not measured.

    It says where errors of the truth alone can be as large as what to set.
    """
    found = _at_window(data, tracker)
    if "consistent_sigma" not in found or "residual_core" not in found:
        return ""
    sigma, residual = found["consistent_sigma"], found["residual_core"]
    floor_px = window_floor_px(data.floor, reported_conditions(data, data.slowest), tracker, sigma["window"])
    covered = floor_px is not None and floor_px >= sigma["value"]
    return (
        f"Set {pixels(sigma['value'])} px for windows of {sigma['window']} frames; residuals look like "
        f"{pixels(residual['value'])} px{'; errors of the truth alone can cause this' if covered else ''}."
    )


def estimator_sentence(data: ReportData, tracker: str) -> str:
    """The same with the interval, and what follows for an estimator. Empty where windows were not measured."""
    found = _at_window(data, tracker)
    if "consistent_sigma" not in found:
        return ""
    sigma = found["consistent_sigma"]
    bounds = "" if sigma["low"] is None else f" ({pixels(sigma['low'])} to {pixels(sigma['high'])})"
    size = f"{pixels(sigma['value'])} px{bounds}"
    return f"For {tracker}, set {size} for windows of {sigma['window']} frames. {_trust(found)}".strip()


def sigma_message(data: ReportData) -> str:
    """Sigma to set over that of residuals, for the tracker whose residuals mislead most; empty if none is shown to."""
    rows = [_at_window(data, tracker).get("core_overconfidence") for tracker in data.trackers]
    shown = [row for row in rows if row is not None and row["low"] is not None and row["low"] > 1.0]
    if not shown:
        return ""
    row = max(shown, key=lambda one: one["low"])
    times = f"{ratio(row['value'])} times what residuals of {row['tracker']} look like"
    return f"In windows of {row['window']} frames, set {times}"


def _trust(found: dict[str, dict[str, Any]]) -> str:
    """What an estimator that is tuned to its residuals gets wrong."""
    row = found.get("core_overconfidence")
    if row is None or row["low"] is None or row["high"] is None:
        return ""
    size = f"{number(row['value'])} times (interval {number(row['low'])} to {number(row['high'])})"
    if row["low"] > 1.0:
        return f"Tuned to its residuals, an estimator claims depths that are more certain than they are, by {size}."
    if row["high"] < 1.0:
        return f"Tuned to its residuals, an estimator claims depths that are less certain than they are, by {size}."
    return f"Tuned to its residuals, an estimator is not shown to claim too much or too little: {size}."


def _at_window(data: ReportData, tracker: str) -> dict[str, dict[str, Any]]:
    """Quantities of the chosen window, by name; none where points are fitted to whole tracks."""
    if data.truth_is_fitted:
        return {}
    rows = data.nominal(data.window_sigmas).filter(tracker=tracker, trimming=data.trimming)
    enough = rows.filter(pl.col("n") * pl.col("value") >= LEAST_WINDOWS, quantity="depth_share")["window"]
    lengths = rows.filter(pl.col("window").is_in(enough.to_list()), quantity="consistent_sigma")["window"]
    if lengths.is_empty():
        return {}
    shorter = lengths.filter(lengths <= WINDOW)
    window = shorter.max() if shorter.len() else lengths.min()
    return {row["quantity"]: row for row in rows.filter(pl.col("window") == window).to_dicts()}
