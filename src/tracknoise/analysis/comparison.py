"""Runs compared with the first of them: names, verdicts, conclusions, and the document that has them all."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from tracknoise.analysis.conclusion import conclusion
from tracknoise.analysis.estimand import Estimand
from tracknoise.analysis.run_changes import GateResult, Row
from tracknoise.tables.enumerations import ComparedAges
from tracknoise.tables.trust import TruthVerdict


@dataclass(frozen=True, slots=True)
class RunSide:
    """One of the runs."""

    name: str  # by which rows refer to it
    path: str
    # settings and versions of packages that differ from those of the first run: name, there, here
    differs: tuple[tuple[str, str, str], ...] = ()
    notes: tuple[str, ...] = ()  # what the comparison leaves out, one sentence each
    truth: TruthVerdict = field(default_factory=TruthVerdict)  # the verdict on the truth of the run


@dataclass(frozen=True, slots=True)
class Comparison:
    """Runs compared with the first of them."""

    first: RunSide
    others: tuple[RunSide, ...]
    rows: tuple[Row, ...]  # one per statistic, condition and run
    margin: float
    level: float
    ages: ComparedAges
    gate: GateResult | None = None  # outcome of the gate, if there was one

    @property
    def conclusions(self) -> tuple[str, ...]:
        """Which run is better for what: one sentence for each that is compared with the first."""
        return tuple(conclusion(self.names(side), self.rows_of(side)) for side in self.others)

    def rows_of(self, side: RunSide) -> list[Row]:
        """Those of a run that is compared with the first."""
        return [row for row in self.rows if row.of.run == side.name]

    def names(self, side: RunSide) -> tuple[str, str]:
        """What sentences call the first run, and one that is compared with it: by their trackers if these differ."""
        of = next((row.of for row in self.rows_of(side) if row.of.tracker != row.of.other_tracker), None)
        if of is None:
            return self.first.name, side.name
        if self.first.name == side.name:
            return of.tracker, of.other_tracker
        return f"{of.tracker} of {self.first.name}", f"{of.other_tracker} of {side.name}"

    @property
    def estimands(self) -> Mapping[str, Estimand]:
        """Every statistic that occurs, by name."""
        return {row.statistic: row.estimand for row in self.rows}

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is said of the truth of each run whose truth is not trusted, or of which this is unknown."""
        sides = (self.first, *self.others)
        return tuple(f"{side.name}: {side.truth.sentence}" for side in sides if not side.truth.is_usable)

    @property
    def truths(self) -> str:
        """The verdicts on the truths, a sentence."""
        verdicts = dict.fromkeys(str(side.truth.verdict) for side in (self.first, *self.others))
        return f"Truth of the runs: {', '.join(verdicts)}."


FORMAT = 1


def comparison_json(comparison: Comparison) -> str:
    """Write a comparison.

    Returns
    -------
    str
        An object with `format`, `conclusions`, the fields of `Comparison`, and `estimands`: title, meaning and unit of
        every statistic that occurs. What is missing is null.
    """
    estimands = {
        name: {part: getattr(estimand, part) for part in ("title", "meaning", "unit", "larger_is_better")}
        for name, estimand in comparison.estimands.items()
    }
    document: dict[str, Any] = {
        "format": FORMAT,
        "conclusions": comparison.conclusions,
        **asdict(comparison, dict_factory=_with_statistics),
        "estimands": estimands,
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _with_statistics(fields: list[tuple[str, Any]]) -> dict[str, Any]:
    """Fields of a dataclass, with the name of the statistic in place of the estimand."""
    return dict(("statistic", value["name"]) if name == "estimand" else (name, value) for name, value in fields)
