"""Findings as short sentences, each with a link to its evidence; the whole finding is kept as details."""

import re
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

MOST_WORDS, MOST_NUMBERS = 25, 3
_NUMBER = re.compile(r"\d[\d.,]*")
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
    return Finding(row["topic"], statements, row["table"].replace("_", "-"), row["text"])


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
    if row["topic"] in _OF_ROWS and (found := _row_of(data, row)):
        return [(_OF_ROWS[row["topic"]](found, _value(row)), row["figure"])]
    make = _SENTENCES.get(row["topic"])
    return [(short(row["text"], row["topic"]) if make is None else make(row), row["figure"])]


def short(text: str, topic: str) -> str:
    """The first sentence of a finding if it is short; otherwise a sentence that only names its topic.

    Parameters
    ----------
    text
        The whole finding.
    topic
        Its topic.
    """
    first = re.split(r"(?<=[.:]) (?=[A-Z])", text, maxsplit=1)[0]
    fits = len(first.split()) <= MOST_WORDS and len(_NUMBER.findall(first)) <= MOST_NUMBERS
    return first if fits else f"This run has a finding about {topic}."


def _value(row: Mapping[str, Any]) -> str:
    found = plain(Estimate.of_row(row, "value", "low", "high", row["unit"] or ""))
    return f"{found.text} ({found.interval})" if found.interval else found.text


def _row_of(data: ReportData, row: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The first row of the table of a finding that has its number: it says of which tracker and coordinate this is."""
    table = data.nominal(getattr(data, row["table"]))
    column = "share" if "share" in table.columns else "value"
    of_second = row["topic"] == "survivorship"
    number = pl.col(column).clip(lower_bound=0.0).sqrt() if of_second else pl.col(column)
    found = data.in_order(table.filter(number == row["value"]))
    return found.row(0, named=True) if found.height else None


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
_OF_ROWS: Mapping[str, Callable[[Mapping[str, Any], str], str]] = {
    "pose errors": lambda row, value: (
        f"A motion that the stated poses do not have is {value} of the second moment of {row['tracker']}."
    ),
    "depth edges": lambda row, value: (
        f"On the {row['class']} side of depth edges, the mean error of {row['tracker']} is {value} "
        f"{IN[row['coordinate']]}."
    ),
    "differences": lambda row, value: (
        f"At the same corners, the mean position of {row['tracker']} less that of {row['other']} is {value} in "
        f"{row['coordinate']}."
    ),
    "survivorship": lambda row, value: f"The RMS in u of tracks of {row['tracker']} that live long is {value}.",
}
"""Sentence of each topic whose number is that of one row of a table, from the row and the number."""
