"""The findings of a run as sentences and verdicts."""

import textwrap
from pathlib import Path

from tracknoise.cli.run_answer import most_important
from tracknoise.cli.run_summary import summary_text
from tracknoise.cli.terminal import WIDTH, Terminal
from tracknoise.cli.text_table import show
from tracknoise.report import factor_section, findings_section
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.topics.headlines import findings_json, read_findings
from tracknoise.words import count

_MOST = 10
"""Sentences that are printed unless all are asked for."""


def print_findings(terminal: Terminal, run: Path, *, every: bool, as_json: bool) -> None:
    """Print at most ten sentences about a run, or all with the tables of numbers and verdicts, or one JSON document.

    Raises
    ------
    StoreError
        If it holds no findings.
    """
    data = ReportData.of(RunFolder(run))
    read_findings(data.run)
    if failed := data.manifest.failures:
        are = "is" if len(failed) == 1 else "are"
        terminal.warn(f"{run}: {count(len(failed), 'sequence')} failed and {are} not in these findings")
    if as_json:
        terminal.result(findings_json(data.tables).rstrip())
        return
    _print_sentences(terminal, data, every=every)
    if every and not data.truth.are_tracks_wrong:
        terminal.result(f"\n{summary_text(data.run)}")
        _print_verdicts(terminal, data)


def _print_sentences(terminal: Terminal, data: ReportData, *, every: bool) -> None:
    whole = [row["text"] for row in findings_section.sentences(data)]
    for rank, sentence in enumerate(whole if every else most_important(data, _MOST), start=1):
        marker = f"{rank:>2}. "
        terminal.result(textwrap.fill(sentence, WIDTH, initial_indent=marker, subsequent_indent=" " * len(marker)))
    if not every:
        terminal.result(f"All {len(whole)} findings, and the numbers of every tracker and speed: --all")


def _print_verdicts(terminal: Terminal, data: ReportData) -> None:
    effects, intervals = factor_section.verdicts(data), factor_section.intervals(data)
    asked = [effects] if len(effects.headings) > 1 else []
    for cells in [findings_section.verdicts(data), *asked, *([intervals] if intervals else [])]:
        terminal.result("")
        show(terminal.result, cells)
