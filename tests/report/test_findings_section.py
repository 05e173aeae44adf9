"""The first section: sentences that lead to what they are about, and verdicts with the numbers of the tables."""

import re
from collections.abc import Callable

import polars as pl
import pytest

from tracknoise.report import findings_section
from tracknoise.report.page import write_report
from tracknoise.report.report_data import ReportData
from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.schema import empty
from tracknoise.tables.store import RunFolder
from tracknoise.topics.catalogue import FINDINGS_TABLES, TOPICS
from tracknoise.topics.topic import Column, Topic
from tracknoise.words import percent, pixels

MANY = tuple(f"scene-{place}" for place in range(8))
TABLE = re.compile(r'href="tables/([a-z-]+)\.csv"')


@pytest.fixture(scope="module")
def data(make_run: Callable[..., RunFolder]) -> ReportData:
    return ReportData.of(make_run(scenes=MANY, trackers=("lucas-kanade",), n_frames=14, born=12))


def test_sentences_stand_first_and_lead_to_their_sections_and_tables(make_run: Callable[..., RunFolder]) -> None:
    tum = {"dataset": "tum", "truth": "birth", "n_frames": 14, "born": 30}
    run = make_run(told=True, scenes=("one",), trackers=("lucas-kanade",), **tum)
    page = write_report(run, figure_formats=())
    text = page.read_text(encoding="utf-8")
    section = text.split('<details class="entry" id="findings">')[1].split('<details class="entry"')[0]
    assert text.index('id="findings">') < text.index('id="measured">')
    rows = run.statistics(FINDINGS).to_dicts()
    assert {"scenes", "truth", "noise", "bias", "shape", "growth"} <= {row["topic"] for row in rows}
    assert section.count("<li>") == len(rows)
    for row in rows:
        assert f'href="#{row["figure"]}"' in section
        assert f' id="{row["figure"]}"' in text
    assert all((page.parent / "tables" / f"{name}.csv").is_file() for name in TABLE.findall(section))


def test_a_run_without_findings_says_so_and_has_no_empty_list(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(scenes=("bare",), trackers=("one",), speeds=(1,), n_frames=8, born=20)
    run.write_statistics({table: empty(table) for table in FINDINGS_TABLES})
    text = write_report(run, figure_formats=()).read_text(encoding="utf-8")
    section = text.split('<details class="entry" id="findings">')[1].split('<details class="entry"')[0]
    assert "Findings were not computed for this run" in section
    assert "<ol>" not in section
    assert "No intervals were computed for the solid curves." in text


def test_verdicts_quote_the_tables(data: ReportData) -> None:
    cells = findings_section.verdicts(data)
    assert [row[:2] for row in cells.rows] == [["lucas-kanade", "1"], ["lucas-kanade", "2"]]
    assert all(len(row) == len(cells.headings) == len(cells.numeric) for row in cells.rows)
    assert sum(span for _, span in cells.groups) == len(cells.headings)
    summary = data["summary"].filter(speed=2).row(0, named=True)
    point = {"speed": 2, "statistic": "Phi", "coordinate": "u", "trimming": "trimmed", "weighting": "features"}
    interval = data["intervals"].filter(**point, at=summary["at"]).row(0, named=True)
    low, high = (pixels(interval[end] ** 0.5) for end in ("low", "high"))
    assert cells.rows[1][3] == pixels(summary["trimmed_core_u_px"])
    assert cells.rows[1][5] == f"{pixels(summary['trimmed_rms_u_px'])} ({low} to {high})"
    assert cells.rows[1][7] == "no (p = 0.012)"
    assert cells.rows[1][8:12] == ["light-tailed", "heavy-tailed", *["1.50 (1.48 to 1.52) times; random walk"] * 2]
    assert cells.rows[1][12].startswith(percent(summary["outlier_ratio"]))


def test_a_topic_brings_its_own_columns(data: ReportData, monkeypatch: pytest.MonkeyPatch) -> None:
    named = [Column(name, lambda subject: f"{subject.tracker} {subject.speed}", "drift", "Of errors.") for name in "ab"]
    monkeypatch.setattr(findings_section, "TOPICS", (*TOPICS, Topic("drift", columns=lambda _: named)))
    cells = findings_section.verdicts(data)
    assert [*cells.headings[-2:], cells.groups[-1]] == ["a", "b", ("drift", 2)]
    assert [row[-2:] for row in cells.rows] == [["lucas-kanade 1"] * 2, ["lucas-kanade 2"] * 2]
    assert cells.caption.count("Of errors.") == 1


def test_what_was_not_worked_out_has_a_dash(data: ReportData) -> None:
    bare = data.with_tables(
        **{name: data[name].clear() for name in ("intervals", "zero_mean", "gaussianity", "time_structure")},
    )
    row = findings_section.verdicts(bare).rows[0]
    assert row[7:12] == ["–"] * 5
    assert "(" not in row[3] + row[5]


def test_an_untrimmed_run_has_one_shape(make_run: Callable[..., RunFolder]) -> None:
    cells = findings_section.verdicts(
        ReportData.of(make_run(percentile=None, trimming="untrimmed", scenes=("only",), trackers=("one",)))
    )
    assert len(cells.rows[0]) == len(cells.headings) == sum(span for _, span in cells.groups)
    assert cells.rows[0][8] == "heavy-tailed"


def test_conditions_without_a_feature_are_no_trouble(make_run: Callable[..., RunFolder]) -> None:
    cells = findings_section.verdicts(ReportData.of(make_run(born=0, scenes=("only",), speeds=(1,))))
    assert all(cell == "–" for row in cells.rows for cell in row[2:])


def test_findings_are_told_in_order_of_rank(data: ReportData) -> None:
    turned = data.with_tables(findings=data["findings"].sort(pl.col("rank"), descending=True))
    assert findings_section.sentences(turned) == findings_section.sentences(data)
    assert [row["rank"] for row in findings_section.sentences(turned)] == list(range(1, data["findings"].height + 1))
