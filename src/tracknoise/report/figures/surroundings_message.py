"""The title of the figure of surroundings: what depth edges or occluded points do to the errors of a tracker."""

import math
from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.findings.wording import percent, ratio
from tracknoise.tables.enumerations import EdgeSide, Occlusion, Surrounding


def surroundings_message(tracker: str, table: pl.DataFrame) -> str:
    """What is established: larger errors beside depth edges, or else the part of occluded points. Empty otherwise.

    Parameters
    ----------
    tracker
        Its name.
    table
        Rows of the table ``surrounding_errors`` of this tracker, at one age.
    """
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
    known = row is not None and other is not None and row["low"] is not None and other["high"] is not None
    return known and row["low"] > other["high"] and other["value"] > 0  # type: ignore[index]


def _of_occluded(tracker: str, table: pl.DataFrame) -> str:
    """The part of the second moment in u that occluded points cause, if its interval is above zero."""
    removed = table.filter(
        surrounding=Surrounding.occlusion, statistic="second_removed", coordinate="u", **{"class": Occlusion.now}
    )
    established = removed.filter(pl.col("low") > 0.0)["value"].to_list()
    if not established:
        return ""
    return f"Excluding occluded points removes {percent(established[0])} of the second moment of {tracker} in u"
