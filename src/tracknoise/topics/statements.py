"""Findings as short sentences, each with a link to its evidence; the whole finding is kept as details."""

from collections.abc import Mapping, Sequence
from typing import Any

from tracknoise.topics.answer_summary import Card, Finding, Judgement, Statement
from tracknoise.topics.catalogue import TOPICS
from tracknoise.topics.factor_topic import EFFECTS_OF_FACTORS, changes
from tracknoise.topics.headlines import findings_of
from tracknoise.topics.measures import Subject
from tracknoise.topics.run_data import RunData
from tracknoise.topics.sentences import sentences_of
from tracknoise.topics.topic import Topic
from tracknoise.topics.window_topic import ESTIMATOR


def findings(data: RunData, cards: Sequence[Card], accuracy: Judgement) -> tuple[Finding, ...]:
    """Every finding of the run in short sentences, by rank."""
    rows = findings_of(data.tables).to_dicts()
    return tuple(_finding(data, row, cards, accuracy) for row in rows)


def _finding(data: RunData, row: Mapping[str, Any], cards: Sequence[Card], accuracy: Judgement) -> Finding:
    texts = _of_cards(row, cards) or _of_topic(data, row, accuracy)
    statements = tuple(Statement(text, section) for text, section in texts)
    return Finding(row["topic"], statements, row["table"].replace("_", "-"), row["text"], tuple(row["rows"]))


def _of_cards(row: Mapping[str, Any], cards: Sequence[Card]) -> list[tuple[str, str]]:
    if row["topic"] == ESTIMATOR.name:
        texts = (f"{card.tracker}: {card.sigma[0].lower()}{card.sigma[1:]}" for card in cards if card.sigma)
        return [(sentences_of(text)[0], row["figure"]) for text in texts]
    names = {name for topic in _topics(row) for name in topic.rows_of_card}
    return [(measure.sentence, measure.section) for card in cards for measure in card.measures if measure.name in names]


def _of_topic(data: RunData, row: Mapping[str, Any], accuracy: Judgement) -> list[tuple[str, str]]:
    if row["topic"] == EFFECTS_OF_FACTORS.name:
        first = [(accuracy.text, accuracy.section)] if len(data.trackers) > 1 else []
        return [*first, *((text, row["figure"]) for text in changes(data))]
    for topic in _topics(row):
        say = topic.sentence
        if say is not None and (sentences := [*filter(None, (say(data, tracker) for tracker in data.trackers))]):
            return [(text, row["figure"]) for text in sentences]
        if topic.of_these_scenes and data.trackers:
            return [(Subject(data, data.trackers[0]).said(row["brief"]), row["figure"])]
    return [(row["brief"] or f"This run has a finding about {row['topic']}.", row["figure"])]


def _topics(row: Mapping[str, Any]) -> list[Topic]:
    """Topics whose finding this may be."""
    return [topic for topic in TOPICS if topic.name == row["topic"]]
