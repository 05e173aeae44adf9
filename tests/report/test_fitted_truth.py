"""What a report and a terminal show, and withhold, where true positions are fitted to the tracks themselves."""

from collections.abc import Callable

import polars as pl
import pytest

from tracknoise.analysis.truth_shares import TRIANGULATED_NOISE
from tracknoise.api.finished_run import Run
from tracknoise.cli.run_summary import summary_text
from tracknoise.report import findings_section
from tracknoise.report.page import write_report
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.findings_schema import SUMMARY
from tracknoise.tables.store import RunFolder

SHOWN = {
    "example-frames",
    "trajectory",
    "trimming",
    "lifetimes",
    "feature-counts",
    "outlier-ratio",
    "between-trackers",  # without any truth
}
NOISE = {"triangulated": 0.512, "epipolar": 0.634}


@pytest.fixture(scope="module")
def run(make_run: Callable[..., RunFolder]) -> RunFolder:
    run = make_run(
        told=True, scenes=("one", "two"), trackers=("lucas-kanade",), truth="triangulated", n_frames=14, born=30
    )
    conditions = run.statistics(SUMMARY).select(POOLED)
    rows = [
        {**condition, "measure": measure, "trimming": trimming, "coordinate": "both", "n": 100, "sigma_px": sigma}
        for condition in conditions.to_dicts()
        for measure, sigma in NOISE.items()
        for trimming in ("untrimmed", "trimmed")
    ]
    run.write_statistics({TRIANGULATED_NOISE: pl.DataFrame(rows, schema=dict(TRIANGULATED_NOISE))})
    return run


def test_no_figure_shows_errors_since_a_point_was_fixed(run: RunFolder) -> None:
    figures = Run(run).figures()
    drawn = figures.filter(pl.col("absent").is_null())
    assert set(drawn["section"]) <= SHOWN
    withheld = figures.filter(~pl.col("section").is_in(SHOWN))
    assert {"error-by-tracker", "survivorship-bias", "changes", "error-by-speed"} <= set(withheld["section"])
    assert withheld["absent"].str.contains("fitted to the tracks themselves").all()


def test_the_page_does_not_call_fitted_points_known_or_their_errors_noise(run: RunFolder) -> None:
    text = " ".join(write_report(run, figure_formats=()).read_text(encoding="utf-8").split())
    assert "the point that fits the track best" in text
    assert "depth of the scene" not in text
    assert "zero by construction</dd>" not in text
    assert "They are smaller than the noise of the tracks" in text


def test_verdicts_state_no_error_at_an_age(run: RunFolder) -> None:
    data = ReportData.of(run)
    assert data["summary"]["untrimmed_core_u_px"].null_count() == 0
    for row in findings_section.verdicts(data).rows:
        assert set(row[2:7]) == {"\N{EN DASH}"}
        assert "%" in row[-2], "outliers are observed"


def test_no_factor_is_judged_by_errors(run: RunFolder) -> None:
    data = ReportData.of(run)
    yardstick = data.comparison.filter(pl.col("yardstick_verdict").is_not_null())
    assert set(yardstick["role"]) == {"lifetime", "outlier_ratio"}


def test_the_terminal_states_noise_and_no_error_at_an_age(run: RunFolder) -> None:
    lines = summary_text(run).split("\n\n", 1)[1].splitlines()  # below the verdict on the truth
    assert lines[1].split()[-6:] == ["fitted", "points", "px", "epipolar", "lines", "px"]
    assert "core" not in lines[0]
    assert [line.split()[-2:] for line in lines[3:5]] == [["0.512", "0.634"]] * 2
