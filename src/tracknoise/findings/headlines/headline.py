"""What a headline is, and how the parts about several trackers make one."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.wording import count, interval_text, listing

RunTables: TypeAlias = Mapping[str, pl.DataFrame]
"""RunTables of a run, by their names."""
Part: TypeAlias = tuple[str, list[Estimate]]
"""One or several sentences about one tracker, and the numbers in them."""
MOST_TRACKERS = 4
"""Of more trackers than this the headlines name only the first."""


@dataclass(frozen=True, slots=True)
class Headline:
    """A few sentences about one topic.

    Attributes
    ----------
    topic
        One word.
    text
        Plain text.
    figure
        Anchor of the section of the report that shows it.
    table
        Table that holds its numbers.
    estimate
        The first of its numbers that has an interval; the first of all where none has; None where it has no number.
    """

    topic: str
    text: str
    figure: str
    table: str
    estimate: Estimate | None = None


def by_tracker(
    trackers: Sequence[str],
    describe: Callable[[str], Part | None],
    *,
    opening: str,
    closing: str = "",
    topic: str,
    figure: str,
    table: str,
) -> Headline | None:
    """A headline with a part for each tracker; None where there is no part.

    Parameters
    ----------
    trackers
        Names, in the order in which they are reported.
    describe
        Makes the part of one tracker, or none.
    opening, closing
        Sentences before and after the parts.
    topic, figure, table
        Of the headline.
    """
    known = [part for tracker in trackers if (part := describe(tracker))]
    if not known:
        return None
    more = len(known) - MOST_TRACKERS
    sentences = [opening, *(text for text, _ in known[:MOST_TRACKERS])]
    sentences += [f"The table has {count(more, 'other tracker')}."] if more > 0 else []
    estimates = [estimate for _, found in known[:MOST_TRACKERS] for estimate in found]
    text = " ".join(filter(None, [*sentences, closing]))
    return Headline(topic, text, figure, table, leading(estimates))


def leading(estimates: Sequence[Estimate]) -> Estimate | None:
    """The first number that has an interval, or else the first."""
    return next((one for one in estimates if one.low is not None), estimates[0] if estimates else None)


def in_brackets(rows: pl.DataFrame) -> str:
    """How the intervals in brackets were made, as the last sentence; empty where there are none.

    Parameters
    ----------
    rows
        Those reported, with columns low, high, level, resampled and n_scenes.
    """
    made = rows.drop_nulls(["low", "high"])
    if made.is_empty():
        return ""
    kinds = made.group_by("level", "resampled").agg(pl.col("n_scenes").unique()).sort("level", "resampled")
    return f" In brackets: {listing(interval_text(*row) for row in kinds.iter_rows())}."
