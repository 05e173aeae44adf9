"""Verdicts on the paper's claims under every reading of its trimming: as tables, as text and as CSV."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from tracknoise.findings.wording import DASH, listing, number
from tracknoise.report.cells import Cells
from tracknoise.report.claims.claim import Agreement, Claim, Judgement
from tracknoise.report.claims.judge import judge
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Reading

READINGS: Mapping[Reading, str] = {
    Reading.none: "untrimmed",
    Reading.all: "trimmed among all tracks",
    Reading.followed: "trimmed among followed tracks",
}
"""Names of the readings."""
Runs = Mapping[Reading, Mapping[str, ReportData]]
"""Runs by experiment of the paper, for each reading."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A claim and its verdicts.

    Attributes
    ----------
    claim
        Of the paper.
    judgements
        One for each reading.
    """

    claim: Claim
    judgements: Mapping[Reading, Judgement]

    @property
    def reasons(self) -> str:
        """Reasons of the verdicts, each once, with the readings that it is about unless it is about all."""
        found: dict[str, list[str]] = {}
        for reading, judgement in self.judgements.items():
            if judgement.reason:
                found.setdefault(judgement.reason, []).append(reading)
        whole = len(self.judgements)
        return "; ".join(
            reason if len(names) == whole else f"{listing(names)}: {reason}" for reason, names in found.items()
        )


def judged(claims: Iterable[Claim], runs: Runs) -> list[Judged]:
    """Judge claims under every reading."""
    return [Judged(claim, {reading: judge(claim, runs.get(reading, {})) for reading in Reading}) for claim in claims]


def tally(items: Sequence[Judged], reading: Reading) -> dict[Agreement, int]:
    """How many claims have each verdict under a reading."""
    found = [item.judgements[reading].agreement for item in items]
    return {agreement: found.count(agreement) for agreement in Agreement}


def tallies(items: Sequence[Judged], caption: str) -> Cells:
    """Count of each verdict, one row per reading."""
    rows = [[name, *map(number, tally(items, reading).values())] for reading, name in READINGS.items()]
    return Cells(caption, ["reading", *Agreement], rows, [False, *[True] * len(Agreement)])


def best_reading(items: Sequence[Judged]) -> str:
    """One sentence: the reading under which most claims agree."""
    counts = {reading: tally(items, reading)[Agreement.agrees] for reading in Reading}
    most = max(counts.values(), default=0)
    best = [READINGS[reading] for reading, agreeing in counts.items() if agreeing == most]
    how_many = "The most" if len(best) == 1 else "Equally many"
    return f"{how_many} claims agree if errors are {listing(best, joint='or')}: {number(most)} of {number(len(items))}."


def verdicts(items: Sequence[Judged], caption: str) -> Cells:
    """Verdicts only, one row per claim."""
    rows = [[item.claim.text, *(item.judgements[reading].agreement for reading in Reading)] for item in items]
    return Cells(caption, ["claim of the paper", *Reading], rows, [False] * (1 + len(Reading)))


def table(items: Sequence[Judged], caption: str) -> Cells:
    """Verdicts with what was measured, and reasons: one row per claim."""
    headings = ["claim of the paper", "source", *["verdict", "measured"] * len(Reading), "reason"]
    groups = [("", 2), *((name, 2) for name in READINGS.values()), ("", 1)]
    return Cells(caption, headings, [_row(item) for item in items], [False] * len(headings), groups)


def _row(item: Judged) -> list[str]:
    pairs = [(one.agreement, one.value or DASH) for one in (item.judgements[reading] for reading in Reading)]
    reasons = "; ".join(filter(None, [item.reasons, item.claim.note])) or DASH
    return [item.claim.text, item.claim.source, *(text for pair in pairs for text in pair), reasons]


def to_csv(items: Sequence[Judged]) -> str:
    """One line per claim and reading."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["experiment", "claim", "text", "source", "reading", "verdict", "measured", "reason", "note"])
    for item in items:
        claim = item.claim
        for reading, one in item.judgements.items():
            told = [reading, one.agreement, one.value, one.reason, claim.note]
            writer.writerow([claim.experiment, claim.id, claim.text, claim.source, *told])
    return buffer.getvalue()
