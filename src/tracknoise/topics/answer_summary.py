"""The answer of a run as plain data: what the first screen of the report shows, for programs too."""

import json
from dataclasses import asdict, dataclass
from functools import cache
from typing import Any

from pydantic import TypeAdapter

from tracknoise.tables.enumerations import Trust, Verdict

FORMAT = 3
SUMMARY = "summary.json"
"""Name of its file in the folder of a report."""


@dataclass(frozen=True, slots=True)
class Number:
    """A value with its interval.

    Attributes
    ----------
    value, low, high
        Null where unknown; low and high are the ends of the interval.
    text, interval
        The value with its unit, and the ends, as they are printed; empty where unknown.
    """

    value: float | None
    low: float | None
    high: float | None
    text: str
    interval: str


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a question with yes, no or undecided.

    Attributes
    ----------
    question
        A few words, such as ``biased``.
    verdict
        The answer; of the question ``truth``, a verdict on it.
    is_good
        Whether the answer is what one would wish for; null where it is undecided.
    """

    question: str
    verdict: Verdict | Trust
    is_good: bool | None


@dataclass(frozen=True, slots=True)
class Measure:
    """One row of a card.

    Attributes
    ----------
    name
        What was measured.
    unit
        Of its numbers: px, frames, times, share, or empty.
    number
        Its value.
    reference
        Value that it would have without what is asked about: 0 for a mean, 8 for the kurtosis of a Gaussian.
    answer
        Null where there is nothing to compare with.
    note
        Where and how it was measured.
    sentence
        The finding: at most 25 words and three numbers, apart from names.
    section
        Anchor of the evidence in the report.
    """

    name: str
    unit: str
    number: Number
    reference: float | None
    answer: Answer | None
    note: str
    sentence: str
    section: str


@dataclass(frozen=True, slots=True)
class Card:
    """One tracker at the lowest speed, in the view that the report shows.

    Attributes
    ----------
    tracker
        Its name.
    colour
        In all figures, as ``#rrggbb``.
    measures
        Error, bias, tails, growth, outlier ratio and median lifetime, as far as they were measured.
    sigma
        The sentence for estimators: what to set, and what innovations suggest. Empty where it is unknown.
    """

    tracker: str
    colour: str
    measures: tuple[Measure, ...]
    sigma: str


@dataclass(frozen=True, slots=True)
class NoiseToSet:
    """What to set in an estimator for one tracker.

    Attributes
    ----------
    tracker, colour
        Its name, and its colour in all figures, as ``#rrggbb``.
    window
        Length of the windows of the estimator, frames.
    features
        Features of a frame whose errors in common sigma counts; null where it takes them as independent.
    sigma
        Standard deviation of each coordinate, px.
    is_bound
        Whether sigma is at most this, because the truth is not trusted, or this is unknown.
    limit
        What belongs to sigma: a track or observation gate, or a robust loss with its knee. Empty where there is none.
    innovations
        What innovations suggest, px.
    cameras
        Of how many cameras positions are that sigma is for: 2 of a tracker of a second camera.
    """

    tracker: str
    colour: str
    window: int
    features: int | None
    sigma: Number
    is_bound: bool
    limit: str
    innovations: Number
    cameras: int = 1


@dataclass(frozen=True, slots=True)
class Statement:
    """A finding in one sentence.

    Attributes
    ----------
    text
        At most 25 words and three numbers, apart from names.
    section
        Anchor of the evidence in the report.
    """

    text: str
    section: str


@dataclass(frozen=True, slots=True)
class Finding:
    """What was found about one topic.

    Attributes
    ----------
    topic
        As in the table of findings.
    statements
        Its sentences.
    table
        Name of the table file that holds the numbers, without extension.
    details
        The whole finding with all conditions and numbers.
    rows
        Ids of the rows of results that hold its numbers.
    """

    topic: str
    statements: tuple[Statement, ...]
    table: str
    details: str
    rows: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Judgement:
    """A sentence that answers a question about the whole run.

    Attributes
    ----------
    answer
        In a word.
    text
        In a sentence.
    section
        Anchor of the evidence in the report.
    """

    answer: Answer
    text: str
    section: str


@dataclass(frozen=True, slots=True)
class Summary:
    """What a run says, in the order in which the first screen of the report shows it.

    Attributes
    ----------
    format
        Of this structure.
    experiment
        Name of the experiment.
    measured
        What was measured, in one line.
    estimator
        Title of the estimator that `settings` are for.
    settings
        What to set in it, for each tracker with a noise model.
    holds
        On how much this was measured, and what it holds for.
    accuracy
        Which tracker is more accurate, and by how much.
    certainty
        How sure the numbers are.
    truth
        Whether the true positions can be trusted.
    cards
        One for each tracker.
    findings
        The most important first.
    """

    format: int
    experiment: str
    measured: str
    estimator: str
    settings: tuple[NoiseToSet, ...]
    holds: str
    accuracy: Judgement
    certainty: Judgement
    truth: Judgement
    cards: tuple[Card, ...]
    findings: tuple[Finding, ...]


def summary_json(summary: Summary) -> str:
    """Write a summary as JSON. What is missing is null."""
    return json.dumps(asdict(summary), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


@cache
def summary_schema() -> dict[str, Any]:
    """JSON schema of what `summary_json` writes."""
    return TypeAdapter(Summary).json_schema()
