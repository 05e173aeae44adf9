"""Tables of a comparison."""

from collections.abc import Sequence

from tracknoise.findings.comparison.result import Comparison, GateResult, GateRow, Row
from tracknoise.findings.wording import DASH
from tracknoise.report.cells import Cells
from tracknoise.report.comparison.words import (
    condition_words,
    effect_words,
    intervals_words,
    tolerance_words,
    varying,
    where_words,
)

_HEADINGS = ("statistic", "verdict", "change (interval)", "where", "scenes", "remark")
_NUMERIC = (False, False, True, False, True, False)
_GATE_HEADINGS = ("statistic", "outcome", "change (interval)", "tolerance", "why undecided")


def verdict_cells(comparison: Comparison, run: str, rows: Sequence[Row]) -> list[Cells]:
    """One table per condition: verdicts and effects of all statistics.

    Parameters
    ----------
    comparison
        The comparison.
    run
        Name of the run that is compared with the first.
    rows
        Its rows.
    """
    named = varying(rows)
    tables = []
    for of in dict.fromkeys(row.of for row in rows):
        shown = [row for row in rows if row.of == of]
        intervals = intervals_words(shown, comparison.level)
        title = f"{run} compared with {comparison.first.name}: {condition_words(of, named)}"
        caption = f"{title} ({intervals})" if intervals else title
        tables.append(Cells(caption, _HEADINGS, [_cells(row) for row in shown], _NUMERIC))
    return tables


def _cells(row: Row) -> list[str]:
    where = where_words(row) or ("mean" if row.effect is not None else DASH)
    return [row.estimand.title, str(row.verdict), effect_words(row), where, str(row.n_scenes), row.why or ""]


def gate_cells(result: GateResult) -> Cells:
    """The rows of a gate."""
    named = varying(result.rows)
    several = len({row.of for row in result.rows}) > 1
    rows = [
        [
            *([_condition(row, named)] if several else []),
            row.estimand.title,
            row.outcome,
            effect_words(row),
            tolerance_words(row),
            row.why or "",
        ]
        for row in result.rows
    ]
    headings = [*(["condition"] if several else []), *_GATE_HEADINGS]
    return Cells("Gate", headings, rows, [name in _GATE_HEADINGS[2:4] for name in headings])


def _condition(row: GateRow, named: Sequence[str]) -> str:
    words = condition_words(row.of, named)
    return f"{row.of.run}: {words}" if "run" in named else words
