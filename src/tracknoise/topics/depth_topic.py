"""How many claimed intervals of depth hold the true one, in scenes that were left out."""

import polars as pl

from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.estimators.depth_intervals import DEPTH_INTERVALS, depth_intervals
from tracknoise.inference.estimates import Estimate
from tracknoise.statistics.yardstick import shared_places
from tracknoise.topics.headline import Headline, Part, ReportedConditions, RunTables, in_brackets
from tracknoise.topics.run_data import RunData
from tracknoise.topics.topic import Analysis, Topic
from tracknoise.topics.window_topic import LEAST_WINDOWS, LONGEST_WINDOW
from tracknoise.words import SPACE, format_as

_CLAIMED = 0.95
"""Share of the true depths that the intervals claim to hold."""
_RESIDUAL, _CONSISTENT, _WHOLE = "residual sigma", "consistent sigma", "whole tracks"


def depths(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """How many 95 % intervals of depths hold the true depth, with the noise that residuals suggest, and with others."""
    shares = tables["depth_intervals"].filter(quantity="coverage_95", trimming=conditions.trimming)
    errors = "" if conditions.percentile is None else f", from {conditions.trimming} errors"
    brackets = in_brackets(conditions.reported(shares))
    enough = conditions.reported(shares).filter(pl.col("n") >= LEAST_WINDOWS, covariance=_RESIDUAL)
    shown = _at_shared_window(enough, shares)
    return conditions.headline(
        lambda tracker: _depths_of(conditions.of(shown, tracker), tracker),
        opening=f"Coverage of 95{SPACE}% depth intervals {conditions.where(tables)}{errors}.{_length(shown)}",
        closing=f"The noise of each interval was learned from other scenes.{brackets}",
        figure="estimator",
        table="depth_intervals",
    )


def _at_shared_window(enough: pl.DataFrame, shares: pl.DataFrame) -> pl.DataFrame:
    """Rows of `shares` at the longest window of those at which most trackers have a row in `enough`, as these have."""
    near = enough.filter(pl.col("window") <= LONGEST_WINDOW)
    shared = near.join(shared_places(near, [], "window"), on="window", how="semi").select("tracker", "window").unique()
    return shares.join(shared, on=["tracker", "window"], how="semi", maintain_order="left")


def _length(shown: pl.DataFrame) -> str:
    """The length of the windows; begins with a space."""
    return f" Windows have {shown['window'][0]} frames." if shown.height else ""


def _depths_of(table: pl.DataFrame, tracker: str) -> Part | None:
    if table.is_empty():
        return None
    rows = {row["covariance"]: row for row in table.to_dicts()}
    shares = {name: Estimate.of_row(row, "value", "low", "high", "share") for name, row in rows.items()}
    residual = _share(shares[_RESIDUAL])
    sentences = [f"{tracker}: intervals from the residual core contain {residual} of the true depths."]
    if _CONSISTENT in shares:
        share = shares[_CONSISTENT]
        sentences.append(f"Intervals from the sigma for depths contain {_share(share)}.")
        sentences += ["These are still too narrow."] if share.below(_CLAIMED) else []
    if _WHOLE in shares:
        sentences.append(f"Intervals from the covariance of whole tracks contain {_share(shares[_WHOLE])}.")
    stated = [shares[name] for name in (_RESIDUAL, _CONSISTENT, _WHOLE) if name in shares]
    return Part(" ".join(sentences), stated)


def _share(estimate: Estimate) -> str:
    return format_as(estimate, lambda value: f"{100.0 * (value or 0.0):.0f}", unit=f"{SPACE}%")


LEVELS = {f"coverage_{level}": level for level in (50, 90, 95, 99)}
"""Levels of the claimed intervals, %, by the names of their quantities."""


def depth_shares(data: RunData) -> pl.DataFrame:
    """Shares at the lowest speed, of the longest window at which most trackers have enough tracks.

    Returns: columns of `tracknoise.estimators.depth_intervals.DEPTH_INTERVALS`, with value, low and high in %, and at
    (the level of the claimed interval, %).
    """
    wanted = pl.col("quantity").is_in([*LEVELS]) & (pl.col("window") <= LONGEST_WINDOW)
    rows = data.nominal(data["depth_intervals"]).filter(wanted, trimming=data.trimming)
    enough = rows.filter(pl.col("n").min().over("tracker", "window") >= LEAST_WINDOWS)
    longest = _at_shared_window(enough, enough)
    levels = pl.col("quantity").replace_strict(LEVELS, return_dtype=pl.Int64)
    return longest.with_columns(pl.col("value", "low", "high") * 100.0, at=levels)


def depth_sentence(data: RunData, tracker: str) -> str:
    """What 95 % intervals of depths contain by the residual core and by the consistent sigma; empty if unknown."""
    rows = depth_shares(data).filter(tracker=tracker, at=95)
    shares = {name: f"{share:.0f}{SPACE}%" for name, share in rows.select("covariance", "value").iter_rows()}
    if not {_RESIDUAL, _CONSISTENT} <= set(shares):
        return ""
    residual, consistent = shares[_RESIDUAL], shares[_CONSISTENT]
    return (
        f"{tracker}: 95{SPACE}% depth intervals contain {residual} of the true depths with the residual core, and "
        f"{consistent} with the sigma for depths."
    )


def _depth_intervals(inputs: RunInputs) -> list[pl.DataFrame]:
    tracks, noise, observed = (
        inputs.run.stored_tables(name) for name in ("noise_tracks", "noise_sums", "window_noise")
    )
    return [depth_intervals(tracks, noise, observed, inputs.sampling)]


DEPTHS = Topic("depth", (Analysis((DEPTH_INTERVALS,), _depth_intervals),), headline=depths, sentence=depth_sentence)
