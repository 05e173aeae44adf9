"""Headline about depths of points: how many claimed intervals hold the true one, in scenes that were left out."""

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_as
from tracknoise.findings.headlines.headline import Headline, Part, RunTables, by_tracker, in_brackets
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.findings.wording import SPACE, px

_LONGEST = 15
"""Longest window that is reported, in observations."""
_LEAST_WINDOWS = 100
"""With fewer windows than this, a share is not reported."""
_RESIDUAL, _CONSISTENT, _WHOLE = "residual sigma", "consistent sigma", "whole tracks"


def depths(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How many 95 % intervals of depths hold the true depth, with the noise that residuals suggest, and with others."""
    shares = tables["depth_intervals"].filter(quantity="coverage_95", trimming=conditions.trimming)
    errors = "" if conditions.percentile is None else f", from {conditions.trimming} errors"
    brackets = in_brackets(conditions.reported(shares))
    return by_tracker(
        conditions.trackers,
        lambda tracker: _depths_of(conditions.of(shares, tracker), tracker),
        opening=f"Depth intervals {conditions.where(tables['summary'])}{errors}.",
        closing=f"The noise was learned from other scenes than it was tried on.{brackets}",
        topic="depth",
        figure="estimator",
        table="depth_intervals",
    )


def _depths_of(shares: pl.DataFrame, tracker: str) -> Part | None:
    enough = shares.filter(pl.col("window") <= _LONGEST, pl.col("n") >= _LEAST_WINDOWS, covariance=_RESIDUAL)
    if enough.is_empty():
        return None
    own = shares.filter(pl.col("window") == enough["window"].max())
    rows = {row["covariance"]: row for row in own.to_dicts()}
    found = {name: Estimate.of_row(row, "value", "low", "high", "share") for name, row in rows.items()}
    length = own["window"][0]
    sentences = [
        f"{tracker}: with the sigma that residuals suggest, the 95{SPACE}% depth intervals of windows of {length} "
        f"frames hold {_share(found[_RESIDUAL])} of the true depths."
    ]
    if _CONSISTENT in found:
        sentences.append(f"With {px(rows[_CONSISTENT]['sigma_px'])} they hold {_share(found[_CONSISTENT])}.")
    if _WHOLE in found:
        sentences.append(f"With the covariance of whole tracks they hold {_share(found[_WHOLE])}.")
    stated = [found[name] for name in (_RESIDUAL, _CONSISTENT, _WHOLE) if name in found]
    return " ".join(sentences), stated


def _share(estimate: Estimate) -> str:
    return format_as(estimate, lambda value: f"{100.0 * (value or 0.0):.0f}", unit=f"{SPACE}%")
