"""Findings as short sentences, each with a link to its evidence; the whole finding is kept as details."""

from collections.abc import Mapping, Sequence
from typing import Any

from tracknoise.phrases.answer_summary import Card, Finding, Judgement, Statement
from tracknoise.phrases.covariance_topic import covariance_sentence
from tracknoise.phrases.depth_topic import depth_sentence
from tracknoise.phrases.factor_topic import changes
from tracknoise.phrases.measures import Subject
from tracknoise.phrases.run_data import RunData
from tracknoise.phrases.sentences import sentences_of
from tracknoise.phrases.window_topic import depth_noise_sentence

_MEASURES = {
    "noise": ("error", "noise"),
    "bias": ("bias",),
    "shape": ("tails",),
    "growth": ("growth",),
    "outliers": ("outliers",),
    "lifetimes": ("lifetime",),
}
"""Topics whose sentences are those of the cards, and the names of the measures."""
_NUMBERS = ("ratios", "survivorship", "pose errors", "differences", "depth edges")
"""Topics whose sentences are numbers of the measured scenes."""
_OF_TRACKERS = {"covariances": covariance_sentence, "depth": depth_sentence, "depth noise": depth_noise_sentence}
"""Topics with a sentence for each tracker."""


def findings(data: RunData, cards: Sequence[Card], accuracy: Judgement) -> tuple[Finding, ...]:
    """Every finding of the run in short sentences, by rank."""
    rows = data.findings.sort("rank").to_dicts()
    return tuple(_finding(data, row, cards, accuracy) for row in rows)


def _finding(data: RunData, row: Mapping[str, Any], cards: Sequence[Card], accuracy: Judgement) -> Finding:
    texts = _of_cards(row, cards) or _of_topic(data, row, accuracy)
    statements = tuple(Statement(text, section) for text, section in texts)
    return Finding(row["topic"], statements, row["table"].replace("_", "-"), row["text"], tuple(row["rows"]))


def _of_cards(row: Mapping[str, Any], cards: Sequence[Card]) -> list[tuple[str, str]]:
    if row["topic"] == "estimator":
        texts = (f"{card.tracker}: {card.sigma[0].lower()}{card.sigma[1:]}" for card in cards if card.sigma)
        return [(sentences_of(text)[0], row["figure"]) for text in texts]
    names = _MEASURES.get(row["topic"], ())
    return [(one.sentence, one.section) for card in cards for one in card.measures if one.name in names]


def _of_topic(data: RunData, row: Mapping[str, Any], accuracy: Judgement) -> list[tuple[str, str]]:
    if row["topic"] == "factors":
        first = [(accuracy.text, accuracy.section)] if len(data.trackers) > 1 else []
        return [*first, *((text, row["figure"]) for text in changes(data))]
    say = _OF_TRACKERS.get(row["topic"])
    if say is not None and (sentences := [*filter(None, (say(data, one) for one in data.trackers))]):
        return [(text, row["figure"]) for text in sentences]
    if row["topic"] in _NUMBERS and data.trackers:
        return [(Subject(data, data.trackers[0]).said(row["brief"]), row["figure"])]
    return [(row["brief"] or f"This run has a finding about {row['topic']}.", row["figure"])]
