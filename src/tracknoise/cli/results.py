"""Print what a run produced: the summary, the path of the report, and the sequences that failed."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tracknoise.cli.terminal import Terminal
    from tracknoise.experiments.running.execute import Outcome
    from tracknoise.tables.store import RunFolder

_NAMED = 10
"""Maximum number of causes of failure for which the final message names the sequences."""


def print_outcome(terminal: "Terminal", out: Path, outcome: "Outcome", *, report: bool) -> int:
    """Print the summary of a run that has ended, its report and its failures.

    Returns
    -------
    int
        Exit status: 0 if every sequence was measured, 2 if some were, 1 if none was.
    """
    from tracknoise.tables.store import RunFolder

    if not outcome.measured:
        return 1 if outcome.failures else 0
    print_results(terminal, RunFolder(out), report=report)
    if not outcome.failures:
        return 0
    _print_failures(terminal, outcome)
    return 2


def print_results(terminal: "Terminal", run: "RunFolder", *, report: bool) -> None:
    """Print the summary of a run. With `report`, also write its report and print the path."""
    from tracknoise.cli.summary import summary_text

    terminal.result(summary_text(run))
    if report:
        from tracknoise.report.page import write_report

        terminal.say("writing the report")
        terminal.result(f"report: {write_report(run).resolve()}")


def _print_failures(terminal: "Terminal", outcome: "Outcome") -> None:
    """Name the sequences that failed, grouped by cause: the errors themselves may have scrolled away."""
    from tracknoise.report.names import by_statement, together

    failures = outcome.failures
    named = list(by_statement(sorted(failures.items())).values())[:_NAMED]
    rest = len(failures) - sum(map(len, named))
    names = "; ".join([*map(together, named), *([f"{rest} more"] if rest else [])])
    of_all = f"{len(failures)} of {len(failures) + len(outcome.measured)} sequences failed"
    terminal.say(f"{of_all}: {names}; see failures.jsonl. Run the same command again to retry them.")
