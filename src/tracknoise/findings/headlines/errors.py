"""Headlines about errors: how large, biased or not, of what shape, how they grow, and what survivors hide."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.findings.headlines.headline import Headline, Said, Tables, by_tracker, capitalised, resampled, told
from tracknoise.findings.headlines.scope import Estimate, Scope, curve_bounds
from tracknoise.findings.wording import SPACE, chance, listing, number, percent

SHAPES: Mapping[str, str] = {
    "Gaussian": "as good as Gaussian",
    "heavy-tailed": "heavy-tailed",
    "contaminated": "contaminated (as if some came from a wider Gaussian)",
    "light-tailed": "light-tailed",
    "skewed": "skewed",
    "undecided": "of undecided shape",
}
_GROWTH: Mapping[str, tuple[str, str, str]] = {
    "white": ("are as large at first as later,", "white_px", "px"),
    "random walk": ("grow like a random walk,", "walk_px_per_sqrt_frame", "px per sqrt(frame)"),
    "drift": ("grow in proportion to time, a drift of", "drift_px_per_frame", "px per frame"),
}
"""What is said of a behaviour, with which number."""


def noise(tables: Tables, scope: Scope) -> Headline | None:
    """Root mean square errors at the reference age: the noise that an estimator should assume."""

    def write(parts: list[str]) -> str:
        text = f"The noise to assume {scope.where(tables['summary'])}, as root mean square: {'; '.join(parts)}."
        return f"{text}{_of_which(scope)} {resampled(tables, scope, 'second')}".rstrip()

    return by_tracker(tables, scope, _noise_of, write, topic="noise", figure="error-by-tracker", table="intervals")


def _of_which(scope: Scope) -> str:
    """Which errors the noise is of."""
    text = ""
    if scope.percentile is not None:
        text += (
            f" Trimmed: without the tracks whose largest error is above the {scope.percentile:g}th percentile; an "
            "estimator that does not drop them meets the untrimmed errors."
        )
    if scope.population == "projected":
        text += " Features that something hides count too."
    return text


def _noise_of(tables: Tables, scope: Scope, tracker: str) -> Said | None:
    row = _first(scope.of(tables["summary"], tracker))
    if row is None or row["at"] is None:
        return None
    intervals, parts, estimates = scope.of(tables["intervals"], tracker), [], []
    for trimming in scope.trimmings:
        pair = [_rms(intervals, scope, row, coordinate, trimming) for coordinate in "uv"]
        estimates += pair
        parts.append(f"{told(pair[0])} in u and {told(pair[1])} in v")
    labelled = ", ".join(f"{trimming} {part}" for part, trimming in zip(parts, scope.trimmings, strict=True))
    return f"{tracker} {scope.place(row['at'])} {labelled if len(parts) > 1 else parts[0]}", estimates


def _rms(intervals: pl.DataFrame, scope: Scope, row: Mapping[str, Any], coordinate: str, trimming: str) -> Estimate:
    bounds = curve_bounds(intervals, scope, "second", row["at"], coordinate, trimming=trimming)
    return Estimate.of(row[f"{trimming}_rms_{coordinate}_px"], bounds)


def bias(tables: Tables, scope: Scope) -> Headline | None:
    """Is the mean error zero."""
    how = f"all {scope.axis}s together, {_dropped(scope)}scenes weighted alike"

    def write(parts: list[str]) -> str:
        return f"Is the mean error zero {scope.where(tables['summary'])} ({how})? {capitalised(parts)}."

    return by_tracker(tables, scope, _bias_of, write, topic="bias", figure="error-by-tracker", table="zero_mean")


def _bias_of(tables: Tables, scope: Scope, tracker: str) -> Said | None:
    rows = scope.of(tables["zero_mean"], tracker).filter(trimming=scope.trimmings[0], axis=scope.axis)
    overall, summary = _first(rows.filter(pl.col("at").is_null())), _first(scope.of(tables["summary"], tracker))
    if overall is None:
        return None
    at = None if summary is None else summary["at"]
    there = None if at is None else _first(rows.filter(at=at))
    estimates = [] if there is None else _means(scope.of(tables["intervals"], tracker), scope, there)
    size = ""
    if there is not None and len(estimates) == 2:
        size = f"; {scope.place(there['at'])} it is {told(estimates[0])} in u and {told(estimates[1])} in v"
        if there["share_of_second"] is not None:
            size += f", and its square {percent(there['share_of_second'])} of the second moment"
    return f"{_zero_or_not(tracker, overall)}{size}", estimates


def _zero_or_not(tracker: str, overall: Mapping[str, Any]) -> str:
    p = overall["sign_flip_p"] if overall["sign_flip_p_adjusted"] is None else overall["sign_flip_p_adjusted"]
    test = "" if p is None else f" ({chance(p)}, {overall['n_scenes']} scenes)"
    if overall["verdict"] == "yes":
        return f"that of {tracker} is not{test}"
    why = f": {overall['why']}" if overall["why"] and p is None else ""
    return f"for {tracker} that is undecided{test}{why}"


def _means(intervals: pl.DataFrame, scope: Scope, row: Mapping[str, Any]) -> list[Estimate]:
    found = []
    for coordinate in "uv":
        value = row[f"mean_{coordinate}_px"]
        bounds = curve_bounds(
            intervals, scope, "mean", row["at"], coordinate, trimming=scope.trimmings[0], weighting="scenes"
        )
        found += [] if value is None else [Estimate.of(value, bounds)]
    return found


def shape(tables: Tables, scope: Scope) -> Headline | None:
    """Are errors Gaussian, in the band of ages that holds the reference age."""

    def write(parts: list[str]) -> str:
        return f"Are errors Gaussian {scope.where(tables['summary'])}? {capitalised(parts)}."

    return by_tracker(tables, scope, _shape_of, write, topic="shape", figure="gaussianity", table="gaussianity")


def _shape_of(tables: Tables, scope: Scope, tracker: str) -> Said | None:
    rows = scope.of(tables["gaussianity"], tracker)
    bands = rows.select("age_low", "age_high").unique().sort("age_low").rows()
    if not bands:
        return None
    summary = _first(scope.of(tables["summary"], tracker))
    since = abs(scope.since(summary["at"])) if summary and summary["at"] is not None else bands[0][0]
    low, high = next((band for band in bands if band[0] <= since <= (band[1] or since)), bands[0])
    parts, estimates = [], []
    for trimming in reversed(scope.trimmings):
        row = _first(rows.filter(trimming=trimming, age_low=low))
        if row is not None:
            gain = [] if row["gain_student_nats"] is None else [_gain(row)]
            estimates += gain
            also = f" {trimming}" if len(scope.trimmings) > 1 else ""
            parts.append(f"{SHAPES[row['verdict']]}{also}{_tails(row, gain)}")
    return f"those of {tracker} at {_band(scope, low, high)} are {listing(parts)}", estimates


def _gain(row: Mapping[str, Any]) -> Estimate:
    return Estimate(row["gain_student_nats"], row["gain_student_low"], row["gain_student_high"], "nat")


def _tails(row: Mapping[str, Any], gain: list[Estimate]) -> str:
    share = f"times a Gaussian's share beyond its 99{SPACE}% ellipse"
    told_ = [] if row["tail_99"] is None else [f"{number(row['tail_99'])} {share}"]
    told_ += [f"a Student-t gains {told(one)} an observation" for one in gain]
    return f" ({', '.join(told_)})" if told_ else ""


def _band(scope: Scope, low: int, high: int | None) -> str:
    ages = f"{low} or more" if high is None else f"{low} to {high}"
    return f"ages {ages}" if scope.axis == "age" else f"{ages} frames from the key frame"


def growth(tables: Tables, scope: Scope) -> Headline | None:
    """How errors grow with age."""

    def write(parts: list[str]) -> str:
        return f"How do errors grow, {_dropped(scope)}{scope.where(tables['summary'])}? {capitalised(parts)}."

    return by_tracker(tables, scope, _growth_of, write, topic="growth", figure="time-structure", table="time_structure")


def _growth_of(tables: Tables, scope: Scope, tracker: str) -> Said | None:
    rows = scope.of(tables["time_structure"], tracker).filter(trimming=scope.trimmings[0]).sort("coordinate")
    said: dict[str, list[str]] = {}
    estimates = []
    for row in rows.to_dicts():
        start, name, unit = _rising(row) if row["verdict"] == "white" else _GROWTH.get(row["verdict"], _ungrown(row))
        value = row.get(name)
        size = [] if value is None else [Estimate(value, row[f"{name}_low"], row[f"{name}_high"], unit)]
        estimates += size
        said.setdefault(start, []).append(" ".join([*map(told, size), f"in {row['coordinate']}"]))
    if not said:
        return None
    return f"those of {tracker} {listing(f'{start} {listing(places)}' for start, places in said.items())}", estimates


def _rising(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """What is said of errors that stay: not all, where some part of them certainly grows."""
    start, name, unit = _GROWTH["white"]
    grows = any((row[f"{part}_low"] or 0.0) > 0 for part in ("walk_px_per_sqrt_frame", "drift_px_per_frame"))
    return start.replace("are as", "are mostly as") if grows else start, name, unit


def _ungrown(row: Mapping[str, Any]) -> tuple[str, str, str]:
    if row["verdict"] == "none":
        return "neither stay nor grow as a random walk or a drift does", "", ""
    return f"are undecided ({row['why']})" if row["why"] else "are undecided", "", ""


def survivors(tables: Tables, scope: Scope) -> Headline | None:
    """Whether tracks that live on are the ones with small errors."""

    def write(parts: list[str]) -> str:
        return f"Root mean square errors in u of tracks that live on, {_dropped(scope)}beside all: {'; '.join(parts)}."

    return by_tracker(
        tables, scope, _survivors_of, write, topic="survivors", figure="survivorship-bias", table="intervals"
    )


def _survivors_of(tables: Tables, scope: Scope, tracker: str) -> Said | None:
    row, intervals = _first(scope.of(tables["summary"], tracker)), scope.of(tables["intervals"], tracker)
    if row is None or row["at"] is None:
        return None
    since, trimming = abs(scope.since(row["at"])), scope.trimmings[0]
    lives = intervals.filter(pl.col("aspect").str.starts_with("lives "))["aspect"].unique().to_list()
    for age in sorted(int(name.removeprefix("lives ")) for name in lives):
        bounds = curve_bounds(intervals, scope, "second", row["at"], "u", trimming=trimming, aspect=f"lives {age}")
        if age > since and bounds:
            those, all_ = Estimate(*bounds), _rms(intervals, scope, row, "u", trimming)
            sizes = f"{told(those)} where a track lives to age {age}, {told(all_)} of all"
            return f"{tracker} {scope.place(row['at'])} {sizes}", [those, all_]
    return None


def _dropped(scope: Scope) -> str:
    return "" if scope.percentile is None else "trimmed, "


def _first(rows: pl.DataFrame) -> dict[str, Any] | None:
    return rows.row(0, named=True) if rows.height else None
