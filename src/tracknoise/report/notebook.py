"""A run as a notebook shows it: the cards of its trackers."""

from tracknoise.report.answer import interval_plot
from tracknoise.report.answer.answer import summarise
from tracknoise.report.report_data import ReportData
from tracknoise.report.templates import template


def run_html(data: ReportData) -> str:
    """A part of an HTML page: what was measured, whether it can be trusted, and a card per tracker.

    Its style is limited to the part itself.
    """
    summary = summarise(data)
    scales = interval_plot.scales(summary.cards)
    return template("notebook.html.j2").render(summary=summary, scales=scales, interval_plot=interval_plot)
