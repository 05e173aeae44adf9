"""The headline that says which answers change where the tracks with the largest errors are dropped."""

import math
from collections.abc import Mapping, Sequence

import polars as pl

from tracknoise.findings.headlines.error_size import first
from tracknoise.findings.headlines.headline import Headline, RunTables
from tracknoise.findings.headlines.reported_conditions import ReportedConditions, curve_rows
from tracknoise.findings.wording import listing, px
from tracknoise.tables.enumerations import Behaviour, Trimming

_BOTH = (Trimming.untrimmed, Trimming.trimmed)
_WORDS: Mapping[str, str] = {Behaviour.none: "no model fits", Behaviour.white: "constant"}
"""Verdicts that are clearer in other words."""


def trimming_matters(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Where trimmed and untrimmed errors give different answers; none where they agree or nothing was trimmed."""
    if conditions.percentile is None:
        return None
    verdicts, rankings = _verdicts(tables, conditions), _rankings(tables, conditions)
    if not verdicts and not rankings:
        return None
    count = "one" if len(verdicts) == 1 else str(len(verdicts))
    answers = [f"Trimming changes {count} of the answers below.", *verdicts] if verdicts else []
    orders = [*rankings, "Whether trimming reverses the order in other scenes was not tested."] if rankings else []
    return Headline("trimming", " ".join([*answers, *orders]), "trimming", "summary")


def _rankings(tables: RunTables, conditions: ReportedConditions) -> list[str]:
    """One sentence for each axis in which another tracker has the smallest error, as a number: it can be by chance.

    All are compared at one age (frame), the nearest to the first of those that their headlines are about.
    """
    rows = [first(conditions.of(tables["summary"], tracker)) for tracker in conditions.trackers]
    known = [int(row["at"]) for row in rows if row is not None and row["at"] is not None]
    if len(known) < 2:
        return []
    at = min(known, key=abs)
    found = [_ranking(tables["intervals"], conditions, at, axis) for axis in "uv"]
    return [sentence for sentence in found if sentence]


def _ranking(intervals: pl.DataFrame, conditions: ReportedConditions, at: int, axis: str) -> str:
    values = {trimming: _rms(intervals, conditions, at, axis, trimming) for trimming in _BOTH}
    if len(values[_BOTH[0]]) < 2 or len({frozenset(each) for each in values.values()}) > 1:
        return ""
    best = {trimming: min(each, key=lambda tracker: each[tracker]) for trimming, each in values.items()}
    if len(set(best.values())) == 1:
        return ""
    untrimmed, trimmed = (_smallest(values[trimming], best[trimming]) for trimming in _BOTH)
    order = f"that of {untrimmed} without trimming, and that of {trimmed} after it"
    return f"In the measured scenes, features pooled, the smallest RMS in {axis} {conditions.place(at)} is {order}."


def _rms(
    intervals: pl.DataFrame, conditions: ReportedConditions, at: int, axis: str, trimming: str
) -> Mapping[str, float]:
    """Root mean square errors of the trackers that have one, px, features pooled."""
    rows = {
        tracker: first(curve_rows(conditions.of(intervals, tracker), conditions, "second", at, axis, trimming=trimming))
        for tracker in conditions.trackers
    }
    return {
        tracker: math.sqrt(row["value"])
        for tracker, row in rows.items()
        if row is not None and row["value"] is not None
    }


def _smallest(values: Mapping[str, float], best: str) -> str:
    return f"{best} ({px(values[best])})"


def _verdicts(tables: RunTables, conditions: ReportedConditions) -> list[str]:
    """One sentence for each question and tracker whose verdicts differ."""
    sentences: list[str] = []
    for tracker in conditions.trackers:
        for coordinate in "uv":
            rows = conditions.of(tables["time_structure"], tracker).filter(coordinate=coordinate)
            sentences += _differs(rows, f"The growth of the error of {tracker} in {coordinate}")
        zero = conditions.of(tables["zero_mean"], tracker).filter(pl.col("at").is_null(), axis=conditions.axis)
        sentences += _differs(zero, f"Whether {tracker} has a mean error")
    return sentences


def _differs(rows: pl.DataFrame, subject: str) -> Sequence[str]:
    found = [first(rows.filter(trimming=trimming)) for trimming in _BOTH]
    verdicts = [None if row is None else str(row["verdict"]) for row in found]
    if None in verdicts or verdicts[0] == verdicts[1]:
        return []
    words = [_WORDS.get(verdict, verdict) for verdict in verdicts if verdict is not None]
    answers = (f"{word} {trimming}" for word, trimming in zip(words, _BOTH, strict=True))
    return [f"{subject}: {listing(answers)}."]
