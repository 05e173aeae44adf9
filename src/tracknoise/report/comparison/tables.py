"""Tables of a comparison."""

from collections.abc import Sequence

from tracknoise.findings.comparison.result import Comparison, GateResult, Row
from tracknoise.findings.wording import DASH
from tracknoise.report.cells import Cells
from tracknoise.report.comparison.words import condition_words, effect_words, tolerance_words, varying, where_words

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
    conditions = dict.fromkeys(row.of for row in rows)
    return [
        Cells(
            f"{run} compared with {comparison.first.name}: {condition_words(of, named)}",
            ["statistic", "verdict", f"change ({100 * comparison.level:g} % interval)", "where", "scenes", "remark"],
            [_cells(row) for row in rows if row.of == of],
            [False, False, True, False, True, False],
        )
        for of in conditions
    ]


def _cells(row: Row) -> list[str]:
    where = where_words(row) or ("mean" if row.effect is not None else DASH)
    return [row.estimand.title, str(row.verdict), effect_words(row), where, str(row.n_scenes), row.why or ""]


def gate_cells(result: GateResult) -> Cells:
    """The rows of a gate."""
    runs = {row.of.run for row in result.rows}
    conditions = {row.of for row in result.rows}
    rows = [
        [
            *([f"{row.of.run}: {condition_words(row.of, ('speed', 'lighting'))}"] if len(conditions) > 1 else []),
            row.estimand.title,
            row.outcome,
            effect_words(row),
            tolerance_words(row),
            row.why or "",
        ]
        for row in result.rows
    ]
    first = ["run and condition" if len(runs) > 1 else "condition"] if len(conditions) > 1 else []
    headings = [*first, *_GATE_HEADINGS]
    return Cells("Gate", headings, rows, [name in _GATE_HEADINGS[2:4] for name in headings])
