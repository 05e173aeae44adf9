"""What the findings and the report say about trackers that do not report outliers and causes of ends."""

import pytest
from tests.lean import without_audit, without_depths

import tracknoise as tn
from tracknoise.report import measured
from tracknoise.report.figures import track_ends
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder


@pytest.fixture(scope="module", params=[True, False], ids=["beside a native tracker", "alone"])
def analysed(request) -> tuple[tn.Run, bool]:
    sequence = tn.open_sequence("simulated", motions=["forward"], frames=6, width=160, height=120, supersampling=1)
    native = tn.LucasKanade(min_features=100, max_features=150)
    columns = tn.measure(sequence, native).observations.select("track", "frame", "u_px", "v_px")
    mine = tn.Imported.from_arrays(*columns)
    trackers = {"flow": native, "mine": mine} if request.param else {"mine": mine}
    with without_audit(), without_depths():
        return tn.analyse(tn.measure(sequence, trackers), min_features=5), request.param


def test_findings_say_that_outliers_are_not_recorded_and_never_0(analysed):
    run, beside = analysed
    by_topic = dict(run.findings().select("topic", "text").iter_rows())
    assert "The outliers of mine are not recorded." in by_topic["outliers"]
    assert "mine rejects" not in by_topic["outliers"]
    assert ("A failure is a lost track" in by_topic["lifetimes"]) is beside
    rows = run.table("intervals").filter(tracker="mine")
    assert not {"outlier_ratio", "survival_until_failure"} & set(rows["statistic"])
    assert "survival" in set(rows["statistic"])
    assert run.table("incidence")["tracker"].unique().to_list() == (["flow"] if beside else [])


def test_the_report_says_not_recorded_and_draws_the_others(analysed):
    run, beside = analysed
    data = ReportData.of(RunFolder(run.path))
    ends = measured.end_counts(data)
    (row,) = [row for row in ends.rows if row[0] == "mine"]
    named = dict(zip(ends.headings, row, strict=True))
    assert [named[heading] for heading in ("lost", "outlier")] == ["not recorded", "not recorded"]
    kind = Figure if beside else Absence
    for figures in (track_ends.incidence_figures(data), track_ends.outlier_ratio_figures(data)):
        assert isinstance(figures[0], kind)
    texts = " ".join(item.look_for for item in track_ends.lifetime_figures(data) if isinstance(item, Figure))
    assert "the causes of ends are not recorded" in texts
    summary = run.table("summary").filter(tracker="mine").row(0, named=True)
    assert (summary["outlier_ratio"], summary["restricted_mean_until_failure"]) == (None, None)
