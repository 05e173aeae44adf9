"""A comparison in Markdown, for a pull request."""

import re
from collections.abc import Iterator

from tracknoise.findings.comparison.result import Comparison, RunSide
from tracknoise.printable import printable
from tracknoise.report.cells import Cells
from tracknoise.report.comparison.tables import gate_cells, verdict_cells
from tracknoise.report.comparison.words import answers, by_run, clearest, gate_sentences

_SIGNS = re.compile(r"([\\`*_\[\]|])")


def comparison_markdown(comparison: Comparison) -> str:
    """The answer, the gate, and one folded table per condition."""
    return "\n".join(_lines(comparison))


def _lines(comparison: Comparison) -> Iterator[str]:
    names = ", ".join(side.name for side in comparison.others)
    yield f"## {_escaped(names)} compared with {_escaped(comparison.first.name)}"
    yield ""
    if comparison.gate is not None:
        outcome, *reasons = gate_sentences(comparison.gate)
        yield f"**{outcome}**"
        yield from (f"- {_escaped(reason)}" for reason in reasons)
        yield from _table(gate_cells(comparison.gate))
    for side, rows in zip(comparison.others, by_run(comparison).values(), strict=True):
        if len(comparison.others) > 1:
            yield f"### {_escaped(side.name)}\n"
        yield from (f"- {_escaped(sentence)}" for sentence in [*answers(rows), *clearest(rows)])
        for cells in verdict_cells(comparison, side.name, rows):
            yield from ("", "<details>", f"<summary>{_escaped(cells.caption)}</summary>")
            yield from _table(cells)
            yield "</details>"
        yield from _differences(side)
    yield from ("", f"Margin: {100 * comparison.margin:g} %. Every number is paired by scene; see docs/compare.md.", "")


def _differences(side: RunSide) -> Iterator[str]:
    if side.differs or side.notes:
        yield ""
    yield from (
        f"- {_escaped(name)}: {_escaped(there)} before, {_escaped(here)} now" for name, there, here in side.differs
    )
    yield from (f"- {_escaped(note)}" for note in side.notes)


def _table(cells: Cells) -> Iterator[str]:
    yield ""
    rules = ["--:" if right else "---" for right in cells.numeric]
    yield f"| {' | '.join(cells.headings)} |"
    yield f"| {' | '.join(rules)} |"
    for row in cells.rows:
        yield f"| {' | '.join(_escaped(text) for text in row)} |"
    yield ""


def _escaped(text: str) -> str:
    """Text that Markdown shows as it is, in one line."""
    plain = printable(text).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return _SIGNS.sub(r"\\\1", plain)
