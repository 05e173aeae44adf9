"""Headlines about the truth, fitted truth, and depth edges.

- Headlines about the truth: what errors of the stated poses explain, and how trackers differ whatever the truth is.
- Headlines of runs whose true positions are fitted to the tracks: what that hides, and the noise corrected for it.
- Headline about depth edges: which features are drawn along by the surface in front of them or behind them.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.inference.estimates import Estimate
from tracknoise.phrases.headline import (
    MOST_TRACKERS,
    Headline,
    Part,
    ReportedConditions,
    RunTables,
    TrackerPart,
    by_tracker,
    ids_of,
    in_brackets,
    leading,
)
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.enumerations import Axis, EdgeSide, FittedMeasure, FittedTo, Surrounding
from tracknoise.words import SELF_REFERENTIAL, count, format_estimate, opening_place, percent, px

_LEAST_SHARE = 0.1
"""Share of the second moment from which on pose errors are reported."""


def pose_errors(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether the errors of features are a motion of the camera that the stated poses do not have."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _share_of(tables["rigid_share"], conditions, tracker),
        opening=f"Errors that all features of a frame share {conditions.where(tables['summary'])}.",
        topic="pose errors",
        figure="pose-errors",
        table="rigid_share",
    )


def _share_of(table: pl.DataFrame, conditions: ReportedConditions, tracker: str) -> Part | None:
    rows = _at_reference(conditions.of(table, tracker).filter(coordinate="both"))
    found = {row["fitted_to"]: Estimate.of_row(row, "share", "low", "high", "share") for row in rows.to_dicts()}
    own, others = found.get(FittedTo.own), found.get(FittedTo.others)
    if own is None or not own.above(_LEAST_SHARE):
        return None
    text = (
        f"{conditions.opening_distance(rows['age'][0])}, {format_estimate(own)} of the second moment of {tracker} is a "
        "motion of the camera that the stated poses do not have."
    )
    if others is None:
        return f"{text} No other tracker can confirm it, so that a motion common to all features may be its own.", [own]
    seen = f"Pose errors that are fitted to the other trackers explain {format_estimate(others)}."
    return f"{text} {seen} {_cause(others)}", [own, others]


def _cause(others: Estimate) -> str:
    """What it means that other trackers see a motion too, or that they do not."""
    if others.above(_LEAST_SHARE):
        return (
            "As the trackers agree, this part is probably an error of the truth: of the poses, the clock, the "
            "calibration, or a rolling shutter."
        )
    if others.below(_LEAST_SHARE):
        return "They do not have this motion, so that it is probably the tracker's own."
    return "It is undecided whether they have this motion too."


def between_trackers(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Which trackers have a bias relative to each other, which no error of the truth can cause."""
    table = tables["tracker_differences"].filter(statistic="mean").sort("other")
    means = pl.concat([table.clear(), *(conditions.of(table, tracker) for tracker in conditions.trackers)])
    parts = [_difference(pair, conditions) for _, pair in means.group_by("tracker", "other", maintain_order=True)]
    known = [part for part in parts if part]
    if not known:
        return None
    more = len(known) - MOST_TRACKERS
    opening = (
        f"Mean differences of positions between trackers at the same corners {conditions.where(tables['summary'])}."
    )
    others = [f"The table has {count(more, 'other pair')}."] if more > 0 else []
    closing = " ".join([*others, "No error of the truth can cause such a difference."])
    named = known[:MOST_TRACKERS]
    return Headline(
        "differences",
        " ".join([opening, *(text for text, _ in named), closing]),
        "between-trackers",
        "tracker_differences",
        leading([estimate for _, found in named for estimate in found]),
        opening=opening,
        closing=closing,
        parts=tuple(TrackerPart(None, text, ids_of(found)) for text, found in named),
    )


def _difference(pair: pl.DataFrame, conditions: ReportedConditions) -> Part | None:
    """The means of a pair, if one of them is established; of the estimates an established one comes first."""
    rows = _at_reference(pair).sort("coordinate").to_dicts()
    if not any(row["established"] for row in rows):
        return None
    estimates = [Estimate.of_row(row, "value", "low", "high", "px") for row in rows]
    u, v = map(format_estimate, estimates)
    place = opening_place(Axis.age, rows[0]["age"])
    stated = estimates if rows[0]["established"] else estimates[::-1]
    return f"{place}, {rows[0]['tracker']} less {rows[0]['other']} is {u} in u and {v} in v.", stated


def _at_reference(table: pl.DataFrame) -> pl.DataFrame:
    """Rows of the last age up to the reference age."""
    return table.filter(pl.col("age") <= REFERENCE_AGE).filter(pl.col("age") == pl.col("age").max())


_WITHHELD = (
    "Bias, shape and growth of the errors, survivorship bias, and effects of factors on errors are therefore not "
    "reported. True positions also contain the errors of poses and calibration."
)
_MEASURES = {
    FittedMeasure.triangulated: "From errors about the fitted points",
    FittedMeasure.epipolar: "From distances to epipolar lines",
}


def self_referential(_tables: RunTables, _conditions: ReportedConditions) -> Headline:
    """Say what errors about fitted points cannot contain."""
    return Headline("truth", f"{SELF_REFERENTIAL} {_WITHHELD}", "limits", "triangulated_noise")


def noise(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Noise of one coordinate of a position, corrected for what the fit absorbs."""
    known = tables["triangulated_noise"].filter(
        pl.col("length_low").is_null(), trimming=conditions.trimming, coordinate="both"
    )
    brackets = in_brackets(conditions.reported(known))
    return by_tracker(
        conditions.trackers,
        lambda tracker: _noise_of(conditions.of(known, tracker), tracker),
        opening=f"Noise of one coordinate {conditions.where(tables['summary'])}, as standard deviation.",
        closing=f"A track of N observations has 2 N - 3 degrees of freedom, which the noise allows for.{brackets}",
        topic="noise",
        figure="findings",
        table="triangulated_noise",
    )


def _noise_of(table: pl.DataFrame, tracker: str) -> Part | None:
    sentences: list[str] = []
    estimates: list[Estimate] = []
    for measure, source in _MEASURES.items():
        for row in table.filter(measure=measure).to_dicts():
            estimates.append(Estimate.of_row(row, "sigma_px", "low", "high", "px"))
            of = " it is" if sentences else f", the noise of {tracker} is"
            sentences.append(f"{source}{of} {format_estimate(estimates[-1])}.")
    return (" ".join(sentences), estimates) if sentences else None


IN = {"u": "in u", "v": "in v", "along": "along the motion"}
"""What an error is in, or along."""
_SIDES = {EdgeSide.far: "the far side", EdgeSide.near: "the near side"}
_MOST = 0.5


def depth_edges(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Whether features beside depth edges have other mean errors than all others."""
    return by_tracker(
        conditions.trackers,
        lambda tracker: _edges_of(conditions.of(tables["surrounding_errors"], tracker), conditions, tracker),
        opening=f"Depth edges {conditions.where(tables['summary'])}, in untrimmed errors of visible features.",
        closing="A feature beside a depth edge has two surfaces in its window.",
        topic="depth edges",
        figure="error-by-place",
        table="surrounding_errors",
    )


def _edges_of(errors: pl.DataFrame, conditions: ReportedConditions, tracker: str) -> Part | None:
    """Sentences about the oldest age that has intervals; None where no side differs from the other features."""
    sides = errors.filter(surrounding=Surrounding.side)
    bounded = sides.filter(pl.col("class").is_in([*_SIDES]), statistic="mean").drop_nulls(["low", "high"])
    if bounded.is_empty():
        return None
    at = int(bounded["at"].sort()[-1])
    found = {name: _rows(sides.filter(at=at, coordinate=name)) for name in IN}
    coordinate = max(found, key=lambda name: abs(_mean_of_all(found[name])))
    rows = found[coordinate]
    differing = [side for side in _SIDES if _differs(rows, side)]
    if not differing:
        return None
    means = [_estimate(rows[side, "mean"]) for side in differing]
    where = f"{conditions.opening_place(at)}, the mean error of {tracker} {IN[coordinate]}"
    sentences = [f"{where} on {_SIDES[differing[0]]} of depth edges is {format_estimate(means[0])}."]
    sentences += [f"On {_SIDES[side]} it is {format_estimate(mean)}." for side, mean in _rest(differing, means)]
    sentences += [f"Elsewhere it is {format_estimate(_estimate(rows[EdgeSide.none, 'mean']))}."]
    return " ".join([*sentences, *_shares(rows, differing[0]), *_removed(rows)]), means


def _rest(sides: Sequence[EdgeSide], means: Sequence[Estimate]) -> Sequence[tuple[EdgeSide, Estimate]]:
    return list(zip(sides, means, strict=True))[1:]


def _rows(table: pl.DataFrame) -> dict[tuple[str, str], Mapping[str, Any]]:
    """Rows by class and statistic."""
    return {(row["class"], row["statistic"]): row for row in table.to_dicts()}


def _estimate(row: Mapping[str, Any]) -> Estimate:
    return Estimate.of_row(row, "value", "low", "high", row["unit"])


def _mean_of_all(rows: Mapping[tuple[str, str], Mapping[str, Any]]) -> float:
    means = [row for (_, statistic), row in rows.items() if statistic == "mean"]
    return float(sum(row["n"] * row["value"] for row in means) / max(sum(row["n"] for row in means), 1))


def _differs(rows: Mapping[tuple[str, str], Mapping[str, Any]], side: str) -> bool:
    """Whether the interval of the mean on a side excludes both zero and the interval of all features elsewhere."""
    if (side, "mean") not in rows or (EdgeSide.none, "mean") not in rows:
        return False
    there, elsewhere = _estimate(rows[side, "mean"]), _estimate(rows[EdgeSide.none, "mean"])
    if elsewhere.low is None or elsewhere.high is None:
        return False
    return there.above(max(0.0, elsewhere.high)) or there.below(min(0.0, elsewhere.low))


def _shares(rows: Mapping[tuple[str, str], Mapping[str, Any]], side: EdgeSide) -> list[str]:
    """Sentences about the side on which most of the mean error is; empty where that is not established."""
    share, of_mean = (rows.get((side, name)) for name in ("share", "share_of_mean"))
    without = rows.get((side, "mean_without"))
    if share is None or of_mean is None or without is None:
        return []
    if not _estimate(of_mean).above(_MOST):
        return []
    numbers = f"{percent(share['value'])} of the features, {percent(of_mean['value'])} of the mean"
    left = f"The mean of all features is {px(_mean_of_all(rows))}; without {_SIDES[side]} it is {px(without['value'])}."
    return [f"Most of the drift is features on {_SIDES[side]} of depth edges: {numbers}.", left]


def _removed(rows: Mapping[tuple[str, str], Mapping[str, Any]]) -> list[str]:
    row = rows.get((EdgeSide.none, "second_removed_by_others"))
    if row is None or not _estimate(row).above(0.0):
        return []
    return [f"Without features beside depth edges, the second moment falls by {format_estimate(_estimate(row))}."]
