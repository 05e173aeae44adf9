"""What a headline is, and how the parts about several trackers make one."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

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
    brief
        The same in one sentence; empty where there is none.
    opening, closing, parts
        What the text is made of, where it has a part for each tracker.
    """

    topic: str
    text: str
    figure: str
    table: str
    estimate: Estimate | None = None
    brief: str = ""
    opening: str = ""
    closing: str = ""
    parts: tuple["TrackerPart", ...] = ()

    def row(self, rank: int) -> dict[str, Any]:
        """The headline as a row of `FINDINGS`."""
        texts = {
            name: getattr(self, name) for name in ("topic", "text", "figure", "table", "brief", "opening", "closing")
        }
        numbers = {name: getattr(self.estimate, name, None) for name in ("value", "low", "high", "unit")}
        leading_id = getattr(self.estimate, "id", None)
        parts = self.parts or (TrackerPart(None, self.text, () if leading_id is None else (leading_id,)),)
        ids = [leading_id, *(name for part in parts for name in part.rows)]
        return {
            "rank": rank,
            **texts,
            **numbers,
            "rows": list(dict.fromkeys(filter(None, ids))),
            "parts": [{"tracker": part.tracker, "text": part.text, "rows": list(part.rows)} for part in parts],
        }


@dataclass(frozen=True, slots=True)
class TrackerPart:
    """The part of a headline that is about one tracker, or about none, and the ids of its rows of results."""

    tracker: str | None
    text: str
    rows: tuple[str, ...]


def ids_of(estimates: Sequence[Estimate]) -> tuple[str, ...]:
    """Ids of the rows of results that numbers come from."""
    return tuple(dict.fromkeys(one.id for one in estimates if one.id is not None))


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
    described = {tracker: part for tracker in trackers if (part := describe(tracker))}
    if not described:
        return None
    named = dict(list(described.items())[:MOST_TRACKERS])
    more = len(described) - len(named)
    sentences = [opening, *(text for text, _ in named.values())]
    sentences += [f"The table has {count(more, 'other tracker')}."] if more else []
    estimates = [estimate for _, found in named.values() for estimate in found]
    text = " ".join(filter(None, [*sentences, closing]))
    parts = tuple(TrackerPart(tracker, words, ids_of(found)) for tracker, (words, found) in described.items())
    return Headline(
        topic, text, figure, table, leading(estimates), opening=opening, closing=closing.strip(), parts=parts
    )


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
