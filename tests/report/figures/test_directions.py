"""Errors along and across, told and drawn, against the drift that was made up for them."""

import io
import re
from collections.abc import Callable

import numpy as np
import polars as pl
import pytest

from tracknoise.report.figures import error_curves
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.words import number, px

DRIFT_PX = 0.05 * np.array([1.0, -0.5])
"""A frame, in u and v."""
MOTION_PX = np.array([0.8, 0.3]) - DRIFT_PX
"""Of the true positions, a frame: the features are seen to move by (0.8, 0.3)."""


@pytest.fixture(scope="module")
def data(make_run: Callable[..., RunFolder]) -> ReportData:
    world = {"scenes": ("only",), "trackers": ("one",), "sigma_px": 0.0, "bias_px": 0.05}
    return ReportData.of(make_run(**world, percentile=None, hidden=0.0))


@pytest.fixture(scope="module")
def figure(data: ReportData) -> Figure:
    (made,) = error_curves.direction_figures(data)
    assert isinstance(made, Figure)
    return made


def test_the_mean_error_is_told_in_u_and_v_and_along_and_across_the_motion(figure: Figure) -> None:
    age = int(re.match(r"At age (\d+), the mean error is ", figure.look_for).group(1))
    u, v = age * DRIFT_PX
    d_u, d_v = MOTION_PX / np.hypot(*MOTION_PX)
    image, motion = f"{px(u)} in u and {px(v)} in v", f"{px(d_u * u + d_v * v)} along the motion"
    told = f"the mean error is {image}. It is {motion} and {px(d_u * v - d_v * u)} across it."
    assert told in figure.look_for
    assert re.search(r"px along the gradient and \S+\spx across it\. Number", figure.look_for)


def test_features_without_a_direction_are_said_to_be_left_out(data: ReportData, figure: Figure) -> None:
    age = int(re.match(r"At age (\d+), ", figure.look_for).group(1))
    observed = data.run.sequence_table("observations", next(iter(data.sequences))).filter(speed=1, age=age)
    n = number(observed.height)
    assert f"Number of features: {n} for u and v, {n} for motion and {n} for gradient." in figure.look_for


def test_no_mean_is_drawn_along_an_axis_without_sign(figure: Figure) -> None:
    tables = [pl.read_csv(io.StringIO(text)) for text in figure.spec["datasets"].values() if isinstance(text, str)]
    tables = [table for table in tables if "of" in table.columns]
    drawn = {of: set(table.filter(of=of)["axes"]) for table in tables for of in table["of"].unique()}
    assert drawn["mean"] == drawn["about the mean"] == {"u and v", "motion"}
    assert drawn["absolute"] == drawn["about zero"] == {"u and v", "motion", "gradient"}


def test_recorded_truth_has_noise_of_its_own_and_the_reader_is_told(
    figure: Figure, make_run: Callable[..., RunFolder]
) -> None:
    (recorded,) = error_curves.direction_figures(
        ReportData.of(make_run(scenes=("only",), trackers=("one",), truth="birth"))
    )
    assert isinstance(recorded, Figure)
    assert "noise of the true positions looks like a lag too" in recorded.look_for
    assert "noise of the true positions" not in figure.look_for


def test_without_known_errors_there_is_nothing_to_turn(make_run: Callable[..., RunFolder]) -> None:
    (item,) = error_curves.direction_figures(ReportData.of(make_run(scenes=("only",), trackers=("one",), depth=False)))
    assert isinstance(item, Absence)


def test_a_run_without_aspects_says_so(run: RunFolder) -> None:
    data = ReportData.of(run)
    data = data.with_tables(aspect_curves=data["aspect_curves"].clear())
    assert all(isinstance(item, Absence) for item in error_curves.direction_figures(data))
