"""Headlines about the truth: what errors of the stated poses explain, and how trackers differ whatever the truth is."""

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_estimate
from tracknoise.findings.headlines.headline import (
    MOST_TRACKERS,
    Headline,
    Part,
    RunTables,
    TrackerPart,
    by_tracker,
    ids_of,
    leading,
)
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.findings.wording import count, opening_place
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.enumerations import Axis, FittedTo

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
