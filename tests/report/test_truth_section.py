"""The section on how much of the errors is the truth's."""

from collections.abc import Callable

import polars as pl
import pytest
from tests.report.made_up_findings import AUDITED

from tracknoise.report.report_data import ReportData
from tracknoise.report.truth_section import corrections, tables, verdicts
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict


@pytest.fixture(scope="module")
def data(make_run: Callable[..., RunFolder]) -> ReportData:
    return ReportData.of(make_run(scenes=("only",), trackers=("one",), speeds=(1,), n_frames=14))


def with_floor(data: ReportData, share: float) -> ReportData:
    """The run with a floor of this share of the second moment of every point."""
    second = data["curves"].filter(
        statistic="Phi", population=data.population, trimming=data.trimming, weighting="features"
    )
    floor = second.select(
        *[name for name in data["floor"].columns if name in second.columns],
        source=pl.lit("all", dtype=data["floor"].schema["source"]),
        floor_uu=share * pl.col("u"),
        floor_uv=pl.lit(0.0),
        floor_vv=share * pl.col("v"),
        mean_u_px=pl.lit(0.0),
        mean_v_px=pl.lit(0.0),
    )
    return data.with_tables(floor=floor.select(data["floor"].columns).cast(dict(data["floor"].schema)))


def test_it_begins_with_the_verdict_what_the_audit_found_and_how_to_correct_it(data: ReportData) -> None:
    assert verdicts(data)[:2] == [TruthVerdict.of(data["trust"]).sentence, AUDITED]
    assert corrections(data) == "[truth.corrections]\nfocal_scale = 0.90909"
    assert len(tables(data)[0].rows) == 2


@pytest.mark.parametrize(
    ("share", "limit"),
    [
        (0.0, "The truth is stated to be exact"),
        (0.25, "Errors of the truth can explain less than half of the second moment up to age"),
        (0.75, "Do not take a covariance from this recording"),
    ],
)
def test_it_says_what_errors_of_the_truth_can_cause(data: ReportData, share: float, limit: str) -> None:
    (found,) = verdicts(with_floor(data, share))[2:]
    assert limit in found
    if share:
        error_px, floor_px = (float(found.split(" px of one")[0].split()[place]) for place in (-1, -4))
        assert floor_px == pytest.approx(error_px * share**0.5, abs=0.2)  # as printed


def limit_of(data: ReportData, covered: pl.Expr) -> str:
    """What is said of covariances where the floor is three quarters of the second moment at some ages, else a tenth."""
    floor = with_floor(data, 0.1)["floor"]
    factor = pl.when(covered).then(7.5).otherwise(1.0)
    (found,) = verdicts(data.with_tables(floor=floor.with_columns(pl.col("floor_uu", "floor_vv") * factor)))[2:]
    return found.split("px of one. ")[1]


def test_ages_at_which_the_truth_is_the_smaller_part_are_named(data: ReportData) -> None:
    """White errors of poses are the same at every age, so that young features have the larger share of them."""
    shown = data.points.filter(role="second", trimming=data.trimming, population=data.population)
    last = shown["since"].max()
    reason = "errors of the truth can explain more than half of the second moment."
    young = limit_of(data, pl.col("at") <= 2)
    assert young == f"Take a covariance from this recording only from age 3 to age {last}: elsewhere, {reason}"
    assert limit_of(data, pl.col("at") >= 5) == (f"Do not take a covariance beyond age 4 from this recording: {reason}")
    between = limit_of(data, pl.col("at").is_between(3, 4))
    spans = f"from age 1 to age 2 and from age 5 to age {last}"
    assert between == f"Take a covariance from this recording only {spans}: elsewhere, {reason}"


def test_without_a_stated_accuracy_there_is_no_floor(data: ReportData) -> None:
    (found,) = verdicts(data.with_tables(floor=data["floor"].clear()))[2:]
    assert "is not stated, so that there is no truth floor" in found
