"""The answers of a run: its cards, its statements, and how far they can be trusted."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from tracknoise.estimators.exports import estimator
from tracknoise.report import small_plots
from tracknoise.report.contents import TRUTH_TITLE
from tracknoise.report.report_data import ReportData
from tracknoise.report.templates import template
from tracknoise.topics import factor_topic
from tracknoise.topics.answer_summary import FORMAT, Card, Judgement, Measure, NoiseToSet, Number, Summary
from tracknoise.topics.catalogue import TOPICS
from tracknoise.topics.headlines import basis_of
from tracknoise.topics.measures import Subject
from tracknoise.topics.scene_topic import certainty, holds, measured
from tracknoise.topics.statements import findings
from tracknoise.topics.truth_topic import truth
from tracknoise.topics.window_topic import advised, is_for_both, sigma_sentence
from tracknoise.words import SPACE, TIMES, number, pixels, px


def summarise(data: ReportData) -> Summary:
    """Answer what a reader asks first."""
    cards = _cards(data)
    accuracy = _accuracy(data, cards)
    return Summary(
        FORMAT,
        data.name,
        measured(data),
        estimator(data.estimator).title,
        tuple(noise_to_set(data)),
        holds(data),
        accuracy,
        certainty(data),
        truth(data),
        cards,
        findings(data, cards, accuracy),
    )


def noise_to_set(data: ReportData) -> Iterator[NoiseToSet]:
    """What to set in the estimator of the experiment, for each tracker in their order."""
    is_bound = not data.truth.is_usable
    for tracker in data.trackers:
        if advice := advised(data, tracker):
            sigma, innovations = (_number(advice[name]) for name in ("sigma", "innovations"))
            factors = {name: row["value"] for name, row in advice.items()}
            limit = limit_text(advice["sigma"]["kernel"], factors, is_bound=is_bound)
            window = advice["sigma"]["window"]
            features = int(advice["features"]["value"]) if "features" in advice else None
            cameras, colour = 2 if is_for_both(advice) else 1, data.colour[tracker]
            yield NoiseToSet(tracker, colour, window, features, sigma, is_bound, limit, innovations, cameras)


def _number(row: Mapping[str, Any]) -> Number:
    return number_of(row["value"], row["low"], row["high"])


def number_of(value: float, low: float | None, high: float | None) -> Number:
    """A length in px as it is printed."""
    interval = "" if low is None or high is None else f"{pixels(low)} to {pixels(high)}"
    return Number(value, low, high, px(value), interval)


def limit_text(kernel: str | None, factors: Mapping[str, float], *, is_bound: bool = False) -> str:
    """A robust loss with its knee in sigmas, or a gate as a factor on the quantile of chi-square; empty without either.

    Parameters
    ----------
    kernel
        Name of the robust loss; None for least squares.
    factors
        By name; `track_gate`, `observation_gate` and `knee` count.
    is_bound
        Whether sigma is an upper bound: then no setting belongs to it.
    """
    if is_bound:
        return ""
    if kernel is not None and "knee" in factors:
        return f"{kernel.title()} loss, knee {number(factors['knee'])} sigma"
    gates = [
        f"{name} gate {number(factors[key])}{SPACE}{_TIMES_QUANTILE}" for name, key in _GATES.items() if key in factors
    ]
    return next(iter(gates), "")


_TIMES_QUANTILE = f"{TIMES}{SPACE}\N{GREEK SMALL LETTER CHI}²(.95)"
_GATES = {"track": "track_gate", "observation": "observation_gate"}


def conclusions(summary: Summary) -> dict[str, str]:
    """The sentence that concludes what the figures of a section show, by the id of the section."""
    stated = [statement for finding in summary.findings for statement in finding.statements]
    by_section = {statement.section: statement.text for statement in reversed(stated)}
    return by_section | {"error-by-tracker": summary.accuracy.text, "pose-errors": summary.truth.text}


def accuracy(data: ReportData) -> str:
    """Which tracker is more accurate, in a sentence; empty where there is one tracker."""
    return _accuracy(data, _cards(data)).text if len(data.trackers) > 1 else ""


def _accuracy(data: ReportData, cards: Sequence[Card]) -> Judgement:
    return factor_topic.accuracy(data, {card.tracker: _size(card) for card in cards})


def _cards(data: ReportData) -> tuple[Card, ...]:
    return tuple(_card(data, tracker) for tracker in data.trackers)


def _card(data: ReportData, tracker: str) -> Card:
    subject, basis = Subject(data, tracker), basis_of(data.truth, is_fitted=data.truth_is_fitted)
    candidates = [topic.measure(subject) for topic in TOPICS if topic.measure is not None and basis in topic.in_cards]
    measures = tuple(_limited(subject, measure) for measure in candidates if measure is not None)
    return Card(tracker, data.colour[tracker], measures, subject.said(sigma_sentence(data, tracker)))


def _limited(subject: Subject, measure: Measure) -> Measure:
    """A measure that says where it holds for these scenes only, and its interval is from blocks of tracks."""
    blocks = f"; blocks of tracks {subject.limits}" if subject.limits and measure.number.interval else ""
    return replace(measure, sentence=subject.said(measure.sentence), note=f"{measure.note}{blocks}")


def _size(card: Card) -> Measure | None:
    return next((measure for measure in card.measures if measure.name in ("error", "noise")), None)


def run_html(data: ReportData) -> str:
    """A part of an HTML page: what was measured, whether it can be trusted, and a card per tracker.

    Its style is limited to the part itself.
    """
    summary = summarise(data)
    scales = small_plots.scales(summary.cards)
    return template("notebook.html.j2").render(
        summary=summary, scales=scales, interval_plot=small_plots, truth_title=TRUTH_TITLE
    )
