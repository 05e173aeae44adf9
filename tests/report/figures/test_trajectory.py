"""The camera path, against one that moves a decimetre along x and turns by one degree in every frame."""

import io

import polars as pl
import pytest

from tracknoise.report.figures.figure import Figure
from tracknoise.report.figures.frames import first_of_each_motion, trajectory_figures
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.words import SPACE


@pytest.fixture(scope="module")
def figure(run: RunFolder) -> Figure:
    (made,) = trajectory_figures(ReportData.of(run))
    assert isinstance(made, Figure)
    return made


def test_moving_and_turning_are_told_with_the_share_of_turning(figure: Figure) -> None:
    # 19 steps: 1.9 m at 3 m depth are 1.9 / 3 rad = 36.3 degrees; 19 / (19 + 36.3) = 34.4 %.
    told = f"In total, fixating moves 1.90{SPACE}m and rotates 19.0°. At the median feature depth of 3.00{SPACE}m,"
    assert told in figure.look_for
    assert f"by up to 36.3°. Rotation is then 34.4{SPACE}% or more of the total shift." in figure.look_for


def test_what_is_drawn_is_the_path(figure: Figure) -> None:
    tables = [pl.read_csv(io.StringIO(text)) for text in figure.spec["datasets"].values()]
    (turned, *_) = [table for table in tables if "rotated" in table.columns]
    for axis, expected in {"x": [0.0] * 20, "y": [0.0] * 20, "z": list(range(20))}.items():
        assert turned.filter(axis=axis)["rotated"].to_list() == pytest.approx(expected, abs=1e-6)
    (moved, *_) = [table for table in tables if "moved" in table.columns]
    assert moved.filter(axis="x")["moved"].to_list() == pytest.approx([0.1 * frame for frame in range(20)])
    assert moved.filter(axis="y")["moved"].unique().to_list() == [0]


def test_the_view_from_above_has_one_scale(figure: Figure) -> None:
    panel = figure.spec["concat"][0]
    (left, right), (low, high) = (panel["layer"][0]["encoding"][axis]["scale"]["domain"] for axis in "xy")
    assert (right - left) / panel["width"] == pytest.approx((high - low) / panel["height"])
    assert left < 0
    assert right > 1.9


def test_each_motion_has_its_first_scene() -> None:
    keys = ["arvr-00@default", "arvr-01@default", "fr1 desk@default", "scene001@LR0", "scene002@LR0", "walk@led-1"]
    assert first_of_each_motion(keys) == ["arvr-00@default", "fr1 desk@default", "scene001@LR0", "walk@led-1"]
