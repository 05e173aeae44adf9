"""The headline that says which answers change where the tracks with the largest errors are dropped."""

from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.findings.headlines.error_size import first
from tracknoise.findings.headlines.headline import Headline, RunTables
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
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
    """One sentence for each axis in which another tracker has the smallest error, as a number: it can be by chance."""
    rows = {tracker: first(conditions.of(tables["summary"], tracker)) for tracker in conditions.trackers}
    known = {tracker: row for tracker, row in rows.items() if row is not None and row["at"] is not None}
    found = [_ranking(known, axis) for axis in "uv"] if len(known) > 1 else []
    return [sentence for sentence in found if sentence]


def _ranking(rows: Mapping[str, Mapping[str, Any]], axis: str) -> str:
    values = {
        trimming: {tracker: row[f"{trimming}_rms_{axis}_px"] for tracker, row in rows.items()} for trimming in _BOTH
    }
    if any(value is None for each in values.values() for value in each.values()):
        return ""
    best = {trimming: min(each, key=lambda tracker: each[tracker]) for trimming, each in values.items()}
    if len(set(best.values())) == 1:
        return ""
    untrimmed, trimmed = (_smallest(values[trimming], best[trimming]) for trimming in _BOTH)
    order = f"that of {untrimmed} without trimming, and that of {trimmed} after it"
    return f"In the measured scenes, the smallest RMS in {axis} is {order}."


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
