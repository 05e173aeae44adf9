"""Titles of figures that state what was found.

A message has at most `MOST_WORDS` words and `MOST_NUMBERS` numbers, apart from names. It is empty where nothing is
established; the figure then has its topic as title.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import EdgeSide, Occlusion, Surrounding, Verdict
from tracknoise.topics.factor_topic import comparisons
from tracknoise.words import STATISTICS, bound_text, listing, percent, px, ratio, times

MOST_WORDS, MOST_NUMBERS = 15, 2
_SIZES = ("core", "absolute")
"""Roles of statistics that say how large errors are, the preferred one first."""


def effect(
    data: ReportData, factor: str, tracker: str, *, speed: int | None = None, roles: Sequence[str] = _SIZES
) -> str:
    """Whether a factor changes a statistic of a tracker, by the verdict of the paired comparison.

    The size that is stated is that of the clearest difference. Other levels or ages may differ by more. `speed`: None
    where the factor is the speed.
    """
    texts = (_effect(row, factor, role) for role in roles for row in _rows(data, factor, tracker, speed, role))
    return next((text for text in texts if text), "")


def trackers(data: ReportData, role: str, text: str) -> str:
    """How many times as large a statistic of one tracker is as that of another, where this is established of all ages.

    Parameters
    ----------
    data
        The run.
    role
        Of the statistic.
    text
        With places for the tracker with the larger value, the ratio, and the other tracker.
    """
    for row in _rows(data, "tracker", None, data.slowest, role):
        pair = [row["level_a"], row["level_b"]]
        if row["verdict"] == Verdict.yes and row["larger"] in pair and row["at"] is None:
            smaller = pair[1 - pair.index(row["larger"])]
            return text.format(row["larger"], ratio(row["effect"]), smaller)
    return ""


def _rows(data: ReportData, factor: str, tracker: str | None, speed: int | None, role: str) -> list[dict[str, Any]]:
    """Comparisons of several levels of a factor by one statistic; none where they differ by more than that."""
    rows = comparisons(data, factor, role)
    rows = rows.filter(pl.col("speed").eq_missing(speed), pl.col("tracker").eq_missing(tracker)).drop_nulls("effect")
    return rows.to_dicts() if rows.height == 1 else []


def _effect(row: Mapping[str, Any], factor: str, role: str) -> str:
    subject = f"The {'core error' if role == 'core' else STATISTICS[role]} of {row['tracker']}"
    if row["verdict"] == Verdict.yes:
        size = px(row["effect"]) if role == "mean" else times(row["effect"])
        return f"{subject} depends on {factor}; the clearest difference is {size}"
    if row["verdict"] == Verdict.no:
        return f"{subject} depends on {factor} by less than {bound_text(row['margin'], row['unit'])}"
    return ""


def apart(larger: Mapping[str, Any], smaller: Mapping[str, Any], name: str, other: str | None = None) -> bool:
    """Whether the interval of one value is above that of another."""
    low, high = larger[f"{name}_low"], smaller[f"{other or name}_high"]
    return low is not None and high is not None and low > high


def values(found: Mapping[str, str], opening: str) -> str:
    """One value of each of a few trackers: ``opening: 9 frames for one, 5 frames for two``."""
    if not 1 <= len(found) <= MOST_NUMBERS:
        return ""
    return f"{opening}: {listing((f'{value} for {name}' for name, value in found.items()), joint='and')}"


def surroundings_message(tracker: str, table: pl.DataFrame) -> str:
    """What is established: larger errors beside depth edges, or else the part of occluded points. Empty otherwise."""
    return _beside_edges(tracker, table) or _of_occluded(tracker, table)


def _beside_edges(tracker: str, table: pl.DataFrame) -> str:
    """How many times as large errors are on one side of depth edges, if intervals lie apart in u and in v."""
    second = table.filter(pl.col("coordinate").is_in(["u", "v"]), surrounding=Surrounding.side, statistic="second")
    rows = {(row["class"], row["coordinate"]): row for row in second.to_dicts()}
    for side in (EdgeSide.far, EdgeSide.near):
        pairs = [(rows.get((side, axis)), rows.get((EdgeSide.none, axis))) for axis in "uv"]
        if all(_above(*pair) for pair in pairs):
            beside, elsewhere = (sum(row["value"] for row in column if row) for column in zip(*pairs, strict=True))
            times = ratio(math.sqrt(beside / elsewhere))
            return f"Errors of {tracker} are {times} times as large on the {side} side of depth edges"
    return ""


def _above(row: Mapping[str, Any] | None, other: Mapping[str, Any] | None) -> bool:
    """Whether the interval of a row lies above that of another one, whose value is positive."""
    is_known = row is not None and other is not None and row["low"] is not None and other["high"] is not None
    return is_known and row["low"] > other["high"] and other["value"] > 0  # type: ignore[index]


def _of_occluded(tracker: str, table: pl.DataFrame) -> str:
    """The part of the second moment in u that occluded points cause, if its interval is above zero."""
    removed = table.filter(
        surrounding=Surrounding.occlusion, statistic="second_removed", coordinate="u", **{"class": Occlusion.now}
    )
    established = removed.filter(pl.col("low") > 0.0)["value"].to_list()
    if not established:
        return ""
    return f"Excluding occluded points removes {percent(established[0])} of the second moment of {tracker} in u"
