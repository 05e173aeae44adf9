"""Headlines about the noise to set in an estimator, depths of points, and tables of noise.

- Headline about the noise to set in an estimator: what makes depths as certain as they are, and what residuals say.
- Headline about depths of points: how many claimed intervals hold the true one, in scenes that were left out.
- Headline about tables of noise: which of them predicts scenes that were left out, and what motion adds.
"""

from collections.abc import Mapping
from math import sqrt
from typing import Any

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.phrases.headline import Headline, Part, ReportedConditions, RunTables, by_tracker, in_brackets
from tracknoise.tables.enumerations import Axis, FloorSource, Lookup, Product
from tracknoise.words import SPACE, format_as, format_estimate, listing, px, ratio, thousandths

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
    enough = shares.filter(pl.col("window") <= LONGEST_WINDOW, pl.col("n") >= LEAST_WINDOWS, covariance=_RESIDUAL)
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


_BY = {Lookup.tracker: "tracker", Lookup.speed: "speed", Lookup.motion: "motion"}
_ADDED = {Lookup.tracker: "The tracker", Lookup.speed: "The speed", Lookup.motion: "The motion of the scene"}
_WHAT = {
    Product.error: "errors about the first position",
    Product.change: "changes of errors between observations",
}


def noise_by_condition(tables: RunTables, _conditions: ReportedConditions) -> Headline | None:
    """Whether noise should be looked up by tracker, speed and motion, or be the same for all."""
    sentences = lookup_sentences(tables["noise_lookup"], Product.error)
    if not sentences:
        return None
    first = next(row for row in _finest_first(tables["noise_lookup"], Product.error) if row["against"] == Lookup.one)
    text, gain = " ".join(sentences), _gain(first)
    return Headline("noise by condition", text, "estimator", "noise_lookup", gain, brief=brief(tables["noise_lookup"]))


def lookup_sentences(lookups: pl.DataFrame, product: Product) -> list[str]:
    """What tables of second moments gain on scenes that were left out, the answer first; empty without any gain.

    Parameters
    ----------
    lookups
        Schema `NOISE_LOOKUP`, of one dataset.
    product
        What the second moments are of.
    """
    rows = _finest_first(lookups, product)
    over_one = [row for row in rows if row["against"] == Lookup.one]
    if all(row["gain_nats"] is None for row in over_one):
        return []
    best = _best(rows)
    return [_answer(best, product, over_one), *(_added(row) for row in _steps(rows, best))]


def brief(lookups: pl.DataFrame) -> str:
    """The answer about errors in one sentence of at most 25 words and three numbers."""
    rows = _finest_first(lookups, Product.error)
    over_one = [row for row in rows if row["against"] == Lookup.one]
    best = _best(rows)
    if best is None:
        return "No gain is established of noise by condition over one number for all."
    return f"Noise by {_by(best, over_one)} predicts scenes that were left out better than one number for all."


def _best(rows: list[dict[str, Any]]) -> dict[str, Any] | None:
    """The table that is worth most; None where none is better than one for all."""
    better = [row for row in rows if row["against"] == Lookup.one and row["established"]]
    return next((row for row in better if _is_worth_it(row, rows)), better[-1] if better else None)


def _finest_first(lookups: pl.DataFrame, product: Product) -> list[dict[str, Any]]:
    return lookups.filter(pl.col("product") == product).to_dicts()[::-1]


def _is_worth_it(row: Mapping[str, Any], rows: list[dict[str, Any]]) -> bool:
    """Whether a table is better than one covariance for all, and than the next coarser one."""
    return all(one["established"] is True for one in rows if one["lookup"] == row["lookup"])


def _answer(best: Mapping[str, Any] | None, product: Product, over_one: list[dict[str, Any]]) -> str:
    if best is None:
        known = next(row for row in over_one if row["gain_nats"] is not None)
        return (
            f"No gain is established of second moments of {_WHAT[product]} by {_by(known, over_one)} over one for all: "
            f"{_nats(known)} on scenes that were left out."
        )
    return (
        f"Second moments of {_WHAT[product]} by {_by(best, over_one)} predict scenes that were left out better than "
        f"one for all. The gain is {_nats(best)} per error. The second moment of a scene typically differs from the "
        f"table by a factor of {ratio(best['factor'])}, and from one for all by {ratio(best['factor_against'])}."
    )


def _by(row: Mapping[str, Any], over_one: list[dict[str, Any]]) -> str:
    """Names of what a table is looked up by, of what the run varies."""
    names = list(Lookup)
    varied = {one["lookup"] for one in over_one}
    return listing(_BY[name] for name in names[1 : names.index(row["lookup"]) + 1] if name in varied)


def _steps(rows: list[dict[str, Any]], best: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """What each finer table adds to the one before, the coarsest first."""
    finer = [row for row in rows[::-1] if row["against"] != Lookup.one]
    if best is None:
        return finer
    names = list(Lookup)
    return [row for row in finer if names.index(row["lookup"]) > names.index(best["lookup"])]


def _added(row: Mapping[str, Any]) -> str:
    name = _ADDED[row["lookup"]]
    if row["gain_nats"] is None:
        return f"What {name[0].lower()}{name[1:]} adds is unknown: {row['why']}."
    if row["established"] is None:
        return f"{name} adds {_nats(row)}, without an interval: {row['why']}."
    return f"{name} adds {_nats(row)}: {'a gain' if row['established'] else 'no gain'} is established."


def _nats(row: Mapping[str, Any]) -> str:
    return format_as(_gain(row), thousandths, unit=f"{SPACE}nat")


def _gain(row: Mapping[str, Any]) -> Estimate:
    return Estimate.of_row(row, "gain_nats", "low", "high", "nat")
