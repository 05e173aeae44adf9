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


def test_every_claim_about_a_repeated_experiment_has_a_verdict_for_each_reading(
    documented: list[list[list[str]]],
) -> None:
    stated, _ = documented
    assert [row[1] for row in stated] == [one.text for one in claims() if one.experiment.startswith("gazebo")]
    verdict = re.compile("|".join(Agreement))
    assert all(verdict.match(cell) for row in stated for cell in row[2:])
    assert {len(row) for row in stated} == {5}


def test_the_counts_are_those_of_all_claims_and_cells(documented: list[list[list[str]]]) -> None:
    _, counts = documented
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
    stated, counts = rows(text)
    assert stated[0][2:] == [f"agrees: {Reading.none}: 1 px", "agrees", "agrees"]
    assert len(stated) == len(claims())
    assert counts[0] == ["claims: agrees", *[str(len(claims()))] * 3]
    assert written(f"a\n{BEGIN}\nold\n{END}\nb\n", text) == f"a\n{BEGIN}\n\n{text}\n\n{END}\nb\n"
