"""Tables of verdicts: one column per reading, and what differs between readings is named."""

import csv
import io

from tracknoise.paper.claim_verdicts import (
    READINGS,
    Agreement,
    Claim,
    Judged,
    Judgement,
    best_reading,
    table,
    tallies,
    to_csv,
    verdicts,
)
from tracknoise.tables.enumerations import Reading

CLAIM = Claim("level", "kitti", "outlier_level", "The ratio is 40 %.", "text", note="The tracker is not on record.")


def made(none: Agreement, every: Agreement, followed: Agreement) -> Judged:
    found = zip(Reading, (none, every, followed), strict=True)
    return Judged(CLAIM, {reading: Judgement(agreement, f"by {reading}") for reading, agreement in found})


MIXED = made(Agreement.agrees, Agreement.opposite, Agreement.agrees)
OPEN = Judged(CLAIM, {reading: Judgement(Agreement.open, reason="too few") for reading in Reading})


def test_every_reading_has_its_verdict_and_value() -> None:
    cells = table([MIXED], "x")
    assert [span for _, span in cells.groups] == [2, 2, 2, 2, 1]
    assert [name for name, _ in cells.groups if name] == list(READINGS.values())
    assert list(cells.rows[0][2:8]) == ["agrees", "by none", "opposite sign", "by all", "agrees", "by followed"]
    assert cells.rows[0][-1] == CLAIM.note
    assert list(verdicts([MIXED], "x").rows[0]) == [CLAIM.text, "agrees", "opposite sign", "agrees"]


def test_a_reason_of_all_readings_stands_once_and_others_are_named() -> None:
    assert OPEN.reasons == "too few"
    some = Judged(CLAIM, {**OPEN.judgements, Reading.all: Judgement(Agreement.agrees)})
    assert some.reasons == "none and followed: too few"


def test_the_reading_with_most_agreement_is_named() -> None:
    assert tallies([MIXED, OPEN], "x").rows[0] == ["untrimmed", "1", "0", "0", "1"]
    alone = made(Agreement.agrees, Agreement.disagrees, Agreement.open)
    assert best_reading([MIXED, alone]) == "The most claims agree if errors are untrimmed: 2 of 2."
    assert best_reading([OPEN]).startswith("Equally many claims agree if errors are untrimmed, trimmed among")


def test_the_csv_has_one_line_per_claim_and_reading() -> None:
    rows = list(csv.DictReader(io.StringIO(to_csv([MIXED, OPEN]))))
    assert len(rows) == 6
    assert rows[1] == {
        "experiment": "kitti",
        "claim": "level",
        "text": CLAIM.text,
        "source": "text",
        "reading": "all",
        "verdict": "opposite sign",
        "measured": "by all",
        "reason": "",
        "note": CLAIM.note,
    }
