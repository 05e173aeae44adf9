"""Headline about the noise to set in an estimator: what makes depths as certain as they are, and what residuals say."""

from collections.abc import Mapping
from math import sqrt

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_as, format_estimate
from tracknoise.findings.headlines.headline import Headline, Part, RunTables, by_tracker, in_brackets
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.findings.wording import SPACE, px, ratio
from tracknoise.tables.enumerations import Axis, FloorSource

LONGEST_WINDOW = 15
"""Longest window that is reported, in observations."""
LEAST_WINDOWS = 100
"""With fewer windows than this, or fewer that show the depth of their point, a number is not reported."""
_ALIKE = 1.1
"""An uncertainty that is at most this many times another one counts as the same."""
_UNITS = {"consistent_sigma": "px", "residual_core": "px"}
Quantities = Mapping[str, Estimate]


def estimator_noise(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """The noise to set for windows of tracks, and how wrong depths are if residuals are believed."""
    windows = tables["window_sigmas"].filter(trimming=conditions.trimming)
    brackets = in_brackets(conditions.reported(windows.filter(quantity="residual_core")))
    errors = "" if conditions.percentile is None else f", from {conditions.trimming} errors"
    meant = "" if conditions.fitted else " The noise to set makes the depths of fitted points as uncertain as they are."
    return by_tracker(
        conditions.trackers,
        lambda tracker: _noise_of(windows, tables["floor"], conditions, tracker),
        opening=f"Noise to set in an estimator {conditions.where(tables['summary'])}{errors}.",
        closing=f"Windows begin at birth; numbers are medians over them, with true poses.{meant}{brackets}",
        topic="estimator",
        figure="findings" if conditions.fitted else "estimator",
        table="window_sigmas",
    )


def _noise_of(windows: pl.DataFrame, floor: pl.DataFrame, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = conditions.of(windows, tracker).filter(pl.col("window") <= LONGEST_WINDOW, pl.col("n") >= LEAST_WINDOWS)
    lengths: list[int] = rows["window"].unique().sort(descending=True).to_list()
    by_length = {length: _quantities(rows.filter(window=length)) for length in lengths}
    known = {length: found for length, found in by_length.items() if "residual_core" in found}
    shown = [length for length, found in known.items() if "consistent_sigma" in found]
    if shown:
        floor_px = window_floor_px(floor, conditions, tracker, shown[0])
        return _with_depth(shown[0], known[shown[0]], tracker, floor_px)
    return _without_depth(*next(iter(known.items())), tracker, conditions) if known else None


def _quantities(rows: pl.DataFrame) -> Quantities:
    """Quantities of one length of window; those about depth only where enough windows show it."""
    of = {row["quantity"]: row for row in rows.to_dicts()}
    n_depth = of["depth_share"]["value"] * of["depth_share"]["n"] if "depth_share" in of else 0
    about_depth = ("consistent_sigma", "core_overconfidence")
    return {
        name: Estimate.of_row(row, "value", "low", "high", _UNITS.get(name, ""))
        for name, row in of.items()
        if name not in about_depth or n_depth >= LEAST_WINDOWS
    }


def _with_depth(length: int, found: Quantities, tracker: str, floor_px: float | None) -> Part:
    consistent, residual, factor = (
        found[name] for name in ("consistent_sigma", "residual_core", "core_overconfidence")
    )
    sentences = [
        f"{tracker}: set {format_estimate(consistent)} for windows of {length} frames.",
        f"Residuals will look like {px(residual.value)}: tuned to them, {_certainty(factor)}.",
    ]
    if floor_px is not None and consistent.value is not None and floor_px >= consistent.value:
        sentences.append(
            f"The truth floor is {px(floor_px)} there: errors of the truth alone can cause this noise, and that of the "
            "tracker may be smaller."
        )
    return " ".join(sentences), [consistent, residual, factor]


def _certainty(factor: Estimate) -> str:
    """How uncertain depths are beside what an estimator claims."""
    text = format_as(factor, lambda value: "unknown" if value is None else ratio(value), unit=f"{SPACE}times")
    if factor.above(1 / _ALIKE) and factor.below(_ALIKE):
        return f"depths are as certain as claimed: the uncertainty is {text} the claimed one"
    if factor.above(1.0) or (factor.low is None and (factor.value or 0.0) > 1.0):
        return f"depths are {text} less certain than claimed"
    return f"the uncertainty of depths is {text} the claimed one"


def _without_depth(length: int, found: Quantities, tracker: str, conditions: ReportedConditions) -> Part:
    residual = found["residual_core"]
    why = "true positions are fitted to the tracks" if conditions.fitted else "few windows show the depth of a point"
    text = (
        f"{tracker}: residuals in windows of {length} frames look like {format_estimate(residual)}. Whether this makes "
        f"depths as certain as claimed is unknown, because {why}."
    )
    return text, [residual]


def window_floor_px(floor: pl.DataFrame, conditions: ReportedConditions, tracker: str, length: int) -> float | None:
    """Size of the errors of the truth in the last frame of a window, per coordinate; None where it is unknown.

    Parameters
    ----------
    floor
        Table of the run.
    conditions
        Which condition of the tracker.
    tracker
        Its name.
    length
        Of the window, in observations.
    """
    since = (length - 1) * conditions.reference.speed
    rows = conditions.of(floor, tracker).filter(pl.col("at") <= since, source=FloorSource.all, axis=Axis.age)
    known = rows.drop_nulls(["floor_uu", "floor_vv"]).sort("at").tail(1).to_dicts()
    return sqrt((known[0]["floor_uu"] + known[0]["floor_vv"]) / 2) if known else None
