"""Findings as short sentences, each with a link to its evidence; the whole finding is kept as details."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.headlines.place_topic import IN
from tracknoise.findings.wording import number
from tracknoise.report.answer.ranking import counted
from tracknoise.report.answer.subject import number as plain
from tracknoise.report.answer.summary import Card, Finding, Judgement, Statement
from tracknoise.report.depth_shares import depth_sentence
from tracknoise.report.report_data import ReportData

_MEASURES = {
    "noise": ("error", "noise"),
    "bias": ("bias",),
    "shape": ("tails",),
    "growth": ("growth",),
    "outliers": ("outliers",),
    "lifetimes": ("lifetime",),
}
"""Topics whose sentences are those of the cards, and the names of the measures."""


def findings(data: ReportData, cards: Sequence[Card], accuracy: Judgement) -> tuple[Finding, ...]:
    """Every finding of the run in short sentences, by rank.

    Parameters
    ----------
    data
        The run.
    cards
        Its trackers.
    accuracy
        Which tracker is more accurate.
    """
    rows = data.findings.sort("rank").to_dicts()
    return tuple(_finding(data, row, cards, accuracy) for row in rows)


def _finding(data: ReportData, row: Mapping[str, Any], cards: Sequence[Card], accuracy: Judgement) -> Finding:
    texts = _of_cards(row, cards) or _of_topic(data, row, accuracy)
    statements = tuple(Statement(text, section) for text, section in texts)
    return Finding(row["topic"], statements, row["table"].replace("_", "-"), row["text"], tuple(row["rows"]))


def _of_cards(row: Mapping[str, Any], cards: Sequence[Card]) -> list[tuple[str, str]]:
    if row["topic"] == "estimator":
        return [
            (f"{card.tracker}: {card.sigma[0].lower()}{card.sigma[1:]}", row["figure"]) for card in cards if card.sigma
        ]
    names = _MEASURES.get(row["topic"], ())
    return [(one.sentence, one.section) for card in cards for one in card.measures if one.name in names]


def _of_topic(data: ReportData, row: Mapping[str, Any], accuracy: Judgement) -> list[tuple[str, str]]:
    if row["topic"] == "factors":
        first = [(accuracy.text, accuracy.section)] if len(data.trackers) > 1 else []
        return [*first, *([(text, row["figure"])] if (text := counted(data)) else [])]
    if row["topic"] == "depth" and (sentences := [*filter(None, (depth_sentence(data, one) for one in data.trackers))]):
        return [(text, row["figure"]) for text in sentences]
    if row["topic"] in _OF_RESULTS and (result := _result_of(data, row)):
        return [(_OF_RESULTS[row["topic"]](result), row["figure"])]
    return [(_SENTENCES.get(row["topic"], _brief)(row), row["figure"])]


def _brief(row: Mapping[str, Any]) -> str:
    return row["brief"] or f"This run has a finding about {row['topic']}."


def _value(row: Mapping[str, Any]) -> str:
    shown = plain(Estimate.of_row(row, "value", "low", "high", row["unit"] or ""))
    return f"{shown.text} ({shown.interval})" if shown.interval else shown.text


def _result_of(data: ReportData, row: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The row of results of the number that a finding leads with: it says of which tracker and coordinate it is."""
    rows = data.results.filter(pl.col("id").is_in(row["rows"][:1]))
    return rows.row(0, named=True) if rows.height else None


def _root(row: Mapping[str, Any]) -> Mapping[str, Any]:
    """A row of second moments as root mean squares."""
    roots = {name: None if row[name] is None else math.sqrt(max(row[name], 0.0)) for name in ("value", "low", "high")}
    return {**row, **roots, "unit": "px"}


def _scenes(row: Mapping[str, Any]) -> str:
    n = 0 if row["value"] is None else int(row["value"])
    return f"Conditions have as few as {n} scene{'' if n == 1 else 's'}, which limits what intervals and tests can say."


def _truth(row: Mapping[str, Any]) -> str:
    if row["table"] == "triangulated_noise":
        return "True positions are fitted to the tracks, which hides drift along epipolar lines."
    return "True positions were recorded, so that their own errors are part of every number."


_SENTENCES: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "groups": lambda row: f"Scenes come in {number(int(row['value']))} groups; intervals allow for it.",
    "scenes": _scenes,
    "truth": _truth,
    "estimator": lambda row: (
        f"Residuals in windows of tracks look like {_value(row)}; how certain depths are is unknown."
    ),
    "data": lambda _: "Some data look wrong, so that errors may not be those of the trackers.",
    "copies": lambda _: "Some scenes have the images of others, so that intervals are too narrow.",
    "trimming": lambda _: "Trimming the tracks with the largest errors changes some of these answers.",
}
"""Sentence of each topic that is not about a tracker of a card."""
_OF_RESULTS: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "pose errors": lambda row: (
        f"A motion that the stated poses do not have is {_value(row)} of the second moment of {row['tracker']}."
    ),
    "depth edges": lambda row: (
        f"On the {row['part'].rpartition(' ')[2]} side of depth edges, the mean error of {row['tracker']} is "
        f"{_value(row)} {IN[row['coordinate']]}."
    ),
    "differences": lambda row: (
        f"At the same corners, the mean position of {row['tracker']} less that of {row['against']} is {_value(row)} in "
        f"{row['coordinate']}."
    ),
    "survivorship": lambda row: f"The RMS in u of tracks of {row['tracker']} that live long is {_value(_root(row))}.",
}
"""Sentence of each topic that leads with the number of one row of results, from this row."""
