"""The tables of docs/paper.md are those of the claims. Their numbers depend on the run that they are from."""

import re
from pathlib import Path

import pytest
from benchmarks.paper_claims import BEGIN, END, read, tables, written

from tracknoise.paper.claim_verdicts import Agreement, Judged, Judgement, cells, claims, to_csv
from tracknoise.tables.enumerations import Reading

PAGE = Path(__file__).resolve().parents[2] / "docs" / "paper.md"


def rows(text: str) -> list[list[list[str]]]:
    """Cells of each table, without its headings."""
    lines = [block.splitlines() for block in re.split(r"\n\n+", text) if block.startswith("|")]
    return [[[cell.strip() for cell in line.strip("|").split("|")] for line in block[2:]] for block in lines]


@pytest.fixture(scope="module")
def documented() -> list[list[list[str]]]:
    page = PAGE.read_text(encoding="utf-8")
    assert page.count(BEGIN) == page.count(END) == 1
    return rows(page.partition(BEGIN)[2].partition(END)[0])


def test_every_claim_has_a_row_with_a_verdict_for_each_reading(documented: list[list[list[str]]]) -> None:
    stated, _, _ = documented
    assert [row[1] for row in stated] == [one.text for one in claims()]
    assert [row[2] for row in stated] == [one.source for one in claims()]
    verdict = re.compile(rf"\*\*({'|'.join(Agreement)})\*\*")
    assert all(verdict.match(cell) for row in stated for cell in row[3:6])
    assert all(len(row) == 7 and all(row) for row in stated)


def test_cells_of_what_was_repeated_have_their_verdicts(documented: list[list[list[str]]]) -> None:
    _, of_tables, counts = documented
    known = [one.text for one in cells() if one.experiment.startswith("gazebo")]
    assert [row[1] for row in of_tables][-len(known) :] == known
    assert {cell for row in of_tables for cell in row[2:]} <= set(Agreement)
    for name, number in (("claims", len(claims())), ("cells", len(cells()))):
        counted = [row for row in counts if row[0].startswith(name)]
        assert [sum(int(row[column]) for row in counted) for column in (1, 2, 3)] == [number] * 3


def test_the_tables_are_made_from_the_verdicts_and_replace_the_old_ones(tmp_path: Path) -> None:
    judged = [
        Judged(one, {reading: Judgement(Agreement.agrees, f"{reading}: 1 px", "why") for reading in Reading})
        for one in (*claims(), *cells())
    ]
    (tmp_path / "claims.csv").write_text(to_csv(judged), encoding="utf-8")
    text = tables(read(tmp_path))
    stated, of_tables, counts = rows(text)
    assert stated[0][3:6] == [f"**agrees** {reading}: 1 px" for reading in Reading]
    assert stated[0][6].startswith("why")
    assert (len(stated), len(of_tables)) == (len(claims()), len(cells()))
    assert counts[0] == ["claims: agrees", *[str(len(claims()))] * 3]
    assert written(f"a\n{BEGIN}\nold\n{END}\nb\n", text) == f"a\n{BEGIN}\n\n{text}\n\n{END}\nb\n"
