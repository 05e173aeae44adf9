"""What a headline is, and how its numbers are written."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import polars as pl

from tracknoise.findings.headlines.scope import Estimate, Scope
from tracknoise.findings.wording import SPACE, count, interval_text, listing, number, percent, pixels
from tracknoise.statistics.definitions import NAMES, POOLED

Tables: TypeAlias = Mapping[str, pl.DataFrame]
"""Tables of a run, by their names."""
Said: TypeAlias = tuple[str, list[Estimate]]
"""Part of a sentence, and the numbers in it."""
Tell: TypeAlias = Callable[[Tables, Scope, str], Said | None]
"""Says something of one tracker, or nothing."""
MOST_TRACKERS = 4
"""Of more trackers than this the headlines name only the first."""


@dataclass(frozen=True, slots=True)
class Headline:
    """A sentence or two about one topic.

    Attributes
    ----------
    topic
        One word.
    text
        Plain text.
    figure
        Anchor of the section of the report that shows it.
    table
        Where its numbers can be checked.
    estimate
        The first of its numbers that has an interval; the first of all where none has; None where it has no number.
    """

    topic: str
    text: str
    figure: str
    table: str
    estimate: Estimate | None = None


def told(estimate: Estimate) -> str:
    """Write a number with its unit, and the interval in brackets where there is one."""
    write = _WRITTEN.get(estimate.unit, number)
    unit = "" if estimate.unit in ("", "share") else f"{SPACE}{_unit(estimate)}"
    text = f"{write(estimate.value)}{unit}"
    if estimate.low is None or estimate.high is None:
        beyond = f" ({write(estimate.low)} or more)" if estimate.low is not None else ""
        return f"{text} (up to {write(estimate.high)})" if estimate.high is not None else f"{text}{beyond}"
    return f"{text} ({write(estimate.low)} to {write(estimate.high)})"


def _unit(estimate: Estimate) -> str:
    return "frame" if estimate.unit == "frames" and estimate.value == 1 else estimate.unit


def _whole(value: float | None) -> str:
    """Frames, which are whole more often than not."""
    return number(value) if value is None or value != int(value) else number(int(value))


_WRITTEN: Mapping[str, Callable[[float | None], str]] = {"share": percent, "px": pixels, "frames": _whole}
"""How numbers of a unit are written; others to three digits."""


def by_tracker(
    tables: Tables, scope: Scope, tell: Tell, write: Callable[[list[str]], str], *, topic: str, figure: str, table: str
) -> Headline | None:
    """A headline of what is said of each tracker; None where there is nothing to say of any.

    Parameters
    ----------
    tables, scope
        What is told of.
    tell
        Says its part, with the numbers in it, of one tracker.
    write
        Makes the text of the parts.
    topic, figure, table
        Of the headline.
    """
    parts, estimates = _parts(tables, scope, tell)
    return Headline(topic, write(parts), figure, table, leading(estimates)) if parts else None


def _parts(tables: Tables, scope: Scope, tell: Tell) -> tuple[list[str], list[Estimate]]:
    """What `tell` says of each tracker, of the first few where there are many, and the numbers in it."""
    known = [said for tracker in scope.trackers if (said := tell(tables, scope, tracker))]
    more = len(known) - MOST_TRACKERS
    parts = [text for text, _ in known[:MOST_TRACKERS]]
    parts += [f"the table has {count(more, 'other')}"] if more > 0 else []
    return parts, [estimate for _, estimates in known[:MOST_TRACKERS] for estimate in estimates]


def leading(estimates: Sequence[Estimate]) -> Estimate | None:
    """The first number that has an interval, or else the first."""
    return next((one for one in estimates if one.low is not None), estimates[0] if estimates else None)


def resampled(tables: Tables, scope: Scope, role: str) -> str:
    """Say of what kind the intervals of a statistic at the reference are; nothing where there are none."""
    name = NAMES[scope.axis][role]
    known = tables["intervals"].filter(aspect="all", axis=scope.axis, statistic=name, weighting="features")
    reference = tables["summary"].select(*POOLED, pl.col("at").cast(pl.Int64))
    known = known.join(reference, on=[*POOLED, "at"], how="semi").drop_nulls(["low", "high"])
    known = pl.concat([known.clear(), *(scope.of(known, tracker) for tracker in scope.trackers)])
    if known.is_empty():
        return ""
    kinds = known.group_by("level", "resampled").agg(pl.col("n_scenes").unique()).sort("level", "resampled")
    return f"In brackets: {listing(interval_text(*row) for row in kinds.iter_rows())}."


def capitalised(parts: Sequence[str]) -> str:
    """Parts as one sentence without its full stop."""
    text = "; ".join(parts)
    return text[:1].upper() + text[1:]
