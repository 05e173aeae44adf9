"""Changes from frame to frame: drawn and told as the tables have them, with the bounds that were found."""

import io
from collections.abc import Callable

import numpy as np
import polars as pl
import pytest

from tracknoise.report.figures import growth_curves
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import LAGS
from tracknoise.tables.findings_schema import INTERVALS
from tracknoise.tables.store import RunFolder
from tracknoise.words import SPACE, number, px


@pytest.fixture(scope="module")
def data(run: RunFolder) -> ReportData:
    return ReportData.of(run)


def drawn(data: ReportData, column: str) -> pl.DataFrame:
    (figure,) = growth_curves.change_figures(data)
    assert isinstance(figure, Figure)
    texts = [data for data in figure.spec["datasets"].values() if isinstance(data, str)]
    tables = [pl.read_csv(io.StringIO(text)) for text in texts]
    return pl.concat([table for table in tables if column in table.columns], how="diagonal_relaxed")


def nominal(data: ReportData) -> pl.DataFrame:
    return data.nominal(data["changes"]).filter(pl.col("n") >= data.min_features, trimming="trimmed")


def test_means_spreads_and_autocorrelations_are_those_of_the_table(data: ReportData) -> None:
    table, points = nominal(data), drawn(data, "u")
    expected = [
        *table.drop_nulls("mean_u_px")["mean_u_px"],
        *table.drop_nulls("covariance_uu")["covariance_uu"].sqrt(),
        *table.drop_nulls("autocorrelation_u")["autocorrelation_u"],
    ]
    np.testing.assert_allclose(sorted(points["u"]), sorted(expected), rtol=1e-3, atol=1e-12)
    assert points.filter(pl.col("tracker") == "lucas-kanade")["at"].max() > LAGS


def test_the_sentence_quotes_the_change_that_ends_at_the_reference_age(data: ReportData) -> None:
    (figure,) = growth_curves.change_figures(data)
    assert isinstance(figure, Figure)
    ages = nominal(data).filter(pl.col("lag") == 0, pl.col("age") <= 10, tracker="lucas-kanade").sort("age")
    row = ages.row(-1, named=True)
    told = f"ends at age {row['age']} is {px(row['mean_u_px'])} in u and {px(row['mean_v_px'])} in v."
    assert told in figure.look_for
    assert px(row["covariance_uu"] ** 0.5) in figure.look_for


def test_bounds_stand_where_their_values_do_and_those_of_variances_are_roots(data: ReportData) -> None:
    table = nominal(data).filter(lag=0, tracker="lucas-kanade")
    labels = {
        name: table[name] for name in ("dataset", "tracker", "speed", "lighting", "rotation", "direction", "camera")
    }
    kind = {
        "aspect": "change",
        "at_least": None,
        "trimming": "trimmed",
        "weighting": "features",
        "statistic": "central",
        "axis": "age",
    }
    said = {"level": 0.95, "resampled": "scenes", "n_scenes": 8, "n_units": 8, "kind": "student", "unit": "px^2"}
    said |= dict.fromkeys(("spread", "next_low", "next_high", "coverage"))
    rows = [
        pl.DataFrame({**labels, "at": table["age"], "value": table[f"covariance_{axis}{axis}"]}).with_columns(
            low=0.25 * pl.col("value"), high=4 * pl.col("value"), coordinate=pl.lit(axis), population=pl.lit("visible"),
            **{name: pl.lit(value) for name, value in {**kind, **said}.items()},
        )
        for axis in "uv"
    ]  # fmt: skip
    found = pl.concat(rows).select(pl.col(name).cast(kind) for name, kind in INTERVALS.items())
    bounded = data.with_tables(intervals=found)
    bands = drawn(bounded, "u_low").sort("at")
    spread = table.sort("age")["covariance_uu"].sqrt()
    np.testing.assert_allclose(bands["u_low"], 0.5 * spread, rtol=1e-3)
    np.testing.assert_allclose(bands["u_high"], 2 * spread, rtol=1e-3)
    (figure,) = growth_curves.change_figures(bounded)
    assert f"95{SPACE}% intervals over 8 scenes" in figure.shows


def test_without_intervals_the_figure_says_so_and_without_changes_there_is_none(data: ReportData) -> None:
    (figure,) = growth_curves.change_figures(data.with_tables(intervals=data["intervals"].clear()))
    assert "No intervals were computed for the curves." in figure.shows
    (absence,) = growth_curves.change_figures(data.with_tables(changes=data["changes"].clear()))
    assert isinstance(absence, Absence)


def test_correlations_are_said_to_be_of_all_ages(data: ReportData) -> None:
    (figure,) = growth_curves.change_figures(data)
    row = nominal(data).filter(lag=1, tracker="lucas-kanade").row(0, named=True)
    told = [number(row[f"autocorrelation_{axis}"]) for axis in "uv"]
    assert (
        f"Over all ages, the correlation with the previous change is {told[0]} in u and {told[1]} in v."
        in figure.look_for
    )


@pytest.mark.parametrize("n_frames", [2, 3, 4])
def test_with_few_frames_nothing_is_drawn_outside_of_the_panels(
    make_run: Callable[..., RunFolder], n_frames: int
) -> None:
    run = make_run(scenes=("only",), trackers=("one",), speeds=(1,), born=80, n_frames=n_frames, min_features=20)
    for item in growth_curves.change_figures(ReportData.of(run)):
        assert isinstance(item, Figure)
        lines = [layer for panel in item.spec["concat"] for layer in panel["layer"] if layer["mark"]["type"] == "line"]
        assert all(line["mark"].get("clip") for line in lines)


def test_changes_that_are_all_alike_vary_by_nothing(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(scenes=("only",), trackers=("one",), speeds=(1,), sigma_px=0.0, bias_px=0.1, percentile=None)
    constant = ReportData.of(run)
    (figure,) = growth_curves.change_figures(constant)
    assert "nan" not in figure.look_for
    assert drawn(constant, "u").drop_nulls("u")["u"].is_finite().all()
