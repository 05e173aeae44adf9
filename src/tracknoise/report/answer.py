"""The answers of a run: its cards, its statements, and how far they can be trusted."""

from tracknoise.phrases import bias_topic, factor_topic, growth_topic, shape_topic, size_topic, track_topics
from tracknoise.phrases.answer_summary import FORMAT, Card, Measure, Summary
from tracknoise.phrases.measures import Subject
from tracknoise.phrases.scene_topic import certainty, measured
from tracknoise.phrases.statements import findings
from tracknoise.phrases.truth_topic import truth
from tracknoise.phrases.window_topic import sigma_sentence
from tracknoise.report import small_plots
from tracknoise.report.report_data import ReportData
from tracknoise.report.templates import template


def summarise(data: ReportData) -> Summary:
    """Answer what a reader asks first."""
    size = size_topic.size_name([Subject(data, tracker) for tracker in data.trackers])
    cards = tuple(_card(data, tracker, size) for tracker in data.trackers)
    errors = {card.tracker: _size(card) for card in cards}
    accuracy = factor_topic.accuracy(data, errors)
    return Summary(
        FORMAT,
        data.name,
        measured(data),
        accuracy,
        certainty(data),
        truth(data),
        cards,
        findings(data, cards, accuracy),
    )


def _card(data: ReportData, tracker: str, size: str) -> Card:
    subject = Subject(data, tracker)
    smallest, fewest, longest = (
        factor_topic.best(data, tracker, role, question)
        for role, question in (("core", "smallest"), ("outlier_ratio", "fewest"), ("lifetime", "longest"))
    )
    about_errors = [size_topic.size_measure(subject, smallest, name=size)]
    if not data.truth_is_fitted:
        makes = bias_topic.bias_measure, shape_topic.shape_measure, growth_topic.growth_measure
        about_errors += [make(subject) for make in makes]
    found = [
        *about_errors,
        track_topics.outliers_measure(subject, fewest),
        track_topics.lifetime_measure(subject, longest),
    ]
    measures = tuple(one for one in found if one is not None)
    return Card(tracker, data.colour[tracker], measures, sigma_sentence(data, tracker))


def _size(card: Card) -> Measure | None:
    return next((one for one in card.measures if one.name in ("error", "noise")), None)


def run_html(data: ReportData) -> str:
    """A part of an HTML page: what was measured, whether it can be trusted, and a card per tracker.

    Its style is limited to the part itself.
    """
    summary = summarise(data)
    scales = small_plots.scales(summary.cards)
    return template("notebook.html.j2").render(summary=summary, scales=scales, interval_plot=small_plots)
