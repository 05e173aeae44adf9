"""What the page says of depth intervals: the made-up ones of `made_up_findings.depth_intervals`."""

import polars as pl
import pytest

from tracknoise.report.answer import summarise
from tracknoise.report.figures import noise_models
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.topics.depth_topic import depth_sentence, depth_shares

SENTENCE = (
    "lucas-kanade: 95 % depth intervals contain 57 % of the true depths with the residual core, and 80 % with the "
    "sigma for depths."
)


@pytest.fixture(scope="module")
def data(run: RunFolder) -> ReportData:
    return ReportData.of(run)


def plain(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


def without(data: ReportData, keep: pl.Expr) -> ReportData:
    return data.with_tables(depth_intervals=data["depth_intervals"].filter(keep))


def test_shares_are_those_of_the_longest_window_with_enough_tracks(data: ReportData) -> None:
    assert depth_shares(data)["window"].unique().to_list() == [15]
    few = pl.when(pl.col("window") == 15).then(99).otherwise(pl.col("n"))
    table = data["depth_intervals"].with_columns(n=few.cast(pl.Int64))
    assert depth_shares(data.with_tables(depth_intervals=table))["window"].unique().to_list() == [10]


def test_shares_of_all_trackers_are_those_of_one_window(data: ReportData) -> None:
    short = without(data, (pl.col("tracker") != "correspondence") | (pl.col("window") == 5))
    found = depth_shares(short)
    assert found["window"].unique().to_list() == [5]
    assert set(found["tracker"]) == set(data.trackers)


def test_a_sentence_compares_both_sigmas(data: ReportData) -> None:
    assert plain(depth_sentence(data, "lucas-kanade")) == SENTENCE
    assert depth_sentence(without(data, pl.col("covariance") != "consistent sigma"), "lucas-kanade") == ""


def test_the_finding_names_each_tracker_and_leads_to_its_section(data: ReportData) -> None:
    (found,) = (one for one in summarise(data).findings if one.topic == "depth")
    assert [one.section for one in found.statements] == ["estimator"] * len(data.trackers)
    assert SENTENCE in [plain(one.text) for one in found.statements]


def test_the_figure_says_what_each_noise_holds(data: ReportData) -> None:
    (figure,) = noise_models.depth_interval_figures(data)
    assert isinstance(figure, Figure)
    assert (
        "Intervals of 95 % of lucas-kanade contain these shares of true depths: 57 % from the residual core, 80 % from "
        "the sigma for depths, 82 % from the covariance of whole tracks." in plain(figure.look_for)
    )
    assert "Windows of 15 observations." in figure.shows
    assert plain(figure.message).startswith("95 % depth intervals of ")
    assert plain(figure.message).endswith(" from the residual core contain 57 % of depths")


def test_nothing_is_established_where_the_interval_holds_the_level(data: ReportData) -> None:
    wide = data.with_tables(depth_intervals=data["depth_intervals"].with_columns(high=pl.lit(0.96)))
    (figure,) = noise_models.depth_interval_figures(wide)
    assert isinstance(figure, Figure)
    assert figure.message == ""


def test_the_figure_is_absent_where_nothing_was_tried(data: ReportData) -> None:
    (absent,) = noise_models.depth_interval_figures(without(data, pl.lit(value=False)))
    assert isinstance(absent, Absence)
