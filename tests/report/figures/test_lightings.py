"""Figures by lighting: their order and colours, and the numbers in boxes and sentences."""

import io
import re
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import polars as pl
import pytest

from tracknoise.report.figures import frames as light_stage
from tracknoise.report.figures import levels, light_sweeps, track_ends
from tracknoise.report.figures.figure import Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.words import number, percent, px

LIGHTINGS = ("diffuse", "LR0", "LR1", "LR2", "LR3", "LR4", "LR10", "BF0", "BF1", "lamp")
LEFT_TO_RIGHT = ["LR0", "LR1", "LR2", "LR3", "LR4", "LR10"]


@pytest.fixture(scope="module")
def data(make_run: Callable[..., RunFolder]) -> ReportData:
    return ReportData.of(make_run(scenes=("only",), trackers=("one",), lightings=LIGHTINGS, born=40))


@pytest.fixture(scope="module")
def figure(data: ReportData) -> Figure:
    """Light that moves from left to right, at the lowest speed."""
    made = levels.lighting_figures(data)
    sweeps = ("left-to-right", "back-to-front", "other-light")
    assert [item.id for item in made] == [
        f"error-by-lighting-one-speed-{speed}-{sweep}" for speed in (1, 2) for sweep in sweeps
    ]
    assert isinstance(made[0], Figure)
    return made[0]


@pytest.fixture(scope="module")
def boxes(data: ReportData) -> Figure:
    return {item.id: item for item in track_ends.outlier_ratio_figures(data)}["outlier-ratio-by-lighting"]


def _brightness(colour: str) -> int:
    return sum(int(colour[i : i + 2], 16) for i in (1, 3, 5))


def test_sweeps_leave_the_reference_out_and_keep_their_order(data: ReportData) -> None:
    assert light_sweeps.sweeps(data) == {
        "left to right": LEFT_TO_RIGHT,
        "back to front": ["BF0", "BF1"],
        "other light": ["lamp"],
    }


def test_the_reference_is_black_and_ramps_go_from_dark_to_light(data: ReportData) -> None:
    colours = light_sweeps.colours(data, "one", "left to right")
    assert list(colours) == ["diffuse", *LEFT_TO_RIGHT]
    assert colours["diffuse"] == "#000000"
    assert len(set(colours.values())) == len(colours)
    ramp = [_brightness(colour) for colour in light_sweeps.colours(data, "one", "back to front").values()]
    assert all(a < b for a, b in pairwise(ramp))


def test_of_many_curves_the_extremes_are_told_and_only_one_moment_is_drawn(data: ReportData, figure: Figure) -> None:
    age = int(re.match(r"At age (\d+), ", figure.look_for).group(1))
    here = {"tracker": "one", "speed": 1, "population": "visible", "trimming": "trimmed", "role": "second", "at": age}
    rows = data.points.filter(**here).filter(pl.col("lighting").is_in(["diffuse", *LEFT_TO_RIGHT])).sort("u")
    low, high = rows.row(0, named=True), rows.row(-1, named=True)
    told = f"in u between {px(low['u'])} (under {low['lighting']}) and {px(high['u'])} (under {high['lighting']})"
    assert told in figure.look_for
    assert "Dashed" not in figure.shows
    assert not any("about the mean" in str(data) for data in figure.spec["datasets"].values())


def test_each_figure_has_the_reference_and_the_lightings_of_its_sweep(figure: Figure) -> None:
    curves = [pl.read_csv(io.StringIO(text)) for text in figure.spec["datasets"].values() if "of" in str(text)[:40]]
    assert {*pl.concat(table.select("lighting") for table in curves)["lighting"]} == {"diffuse", *LEFT_TO_RIGHT}


def test_the_reference_is_drawn_above_the_others(figure: Figure) -> None:
    curves = [pl.read_csv(io.StringIO(text)) for text in figure.spec["datasets"].values() if "of" in str(text)[:40]]
    assert all(table["lighting"].unique(maintain_order=True)[-1] == "diffuse" for table in curves)


def test_lifetimes_by_lighting_are_those_of_the_tracks(data: ReportData) -> None:
    tracks = pl.concat(data.run.sequence_tables("tracks")).filter(speed=1)
    figure = {item.id: item for item in levels.lifetimes_by_lighting_figures(data)}["lifetimes-by-lighting"]
    means = tracks.group_by("lighting").agg(pl.col("lifetime").mean()).sort("lifetime").rows()
    assert f"from {number(means[0][1])} frames under {means[0][0]}" in figure.look_for
    assert f"to {number(means[-1][1])} frames under {means[-1][0]}." in figure.look_for
    boxes = pl.concat(
        pl.read_csv(io.StringIO(text)) for text in figure.spec["datasets"].values() if "median" in str(text)[:200]
    )
    box = boxes.filter(lighting="LR2", speed=1).row(0, named=True)
    lived = tracks.filter(lighting="LR2")["lifetime"].to_numpy()
    expected = np.percentile(lived, [25, 50, 75])
    assert [box[name] for name in ("lower_quartile", "median", "upper_quartile")] == pytest.approx(expected)


def test_outlier_ratios_by_lighting_are_the_pooled_ones(data: ReportData, boxes: Figure) -> None:
    frames = pl.concat(data.run.sequence_tables("frames")).filter(speed=1)
    ratios = frames.group_by("lighting").agg(r=pl.col("outliers").sum() / pl.col("offered").sum()).sort("r").rows()
    ends = [f"{percent(ratios[place][1])} under {ratios[place][0]}" for place in (0, -1)]
    assert f"one rejected between {ends[0]} and {ends[1]}." in boxes.look_for


def test_intervals_are_beside_their_boxes(boxes: Figure) -> None:
    for panel in boxes.spec["concat"]:
        box, dot = panel["layer"][4]["encoding"]["xOffset"], panel["layer"][-1]["encoding"]["xOffset"]
        assert box["scale"]["domain"] == dot["scale"]["domain"] == ["1 beside", "1", "2 beside", "2"]
        assert (box["field"], dot["field"]) == ("speed", "beside")


def test_boxes_have_a_panel_a_sweep_that_begins_with_the_reference(boxes: Figure) -> None:
    orders = [panel["layer"][0]["encoding"]["x"]["sort"] for panel in boxes.spec["concat"]]
    assert orders == [["diffuse", *LEFT_TO_RIGHT], ["diffuse", "BF0", "BF1"], ["diffuse", "lamp"]]


def test_one_scene_is_shown_under_the_reference_and_some_lights_of_each_sweep(data: ReportData) -> None:
    (figure,) = light_stage.light_stage_figures(data)
    assert isinstance(figure, Figure)
    titles = [panel["title"]["text"] for panel in figure.spec["concat"]]
    assert titles == ["diffuse", "LR0", "LR3", "LR10", "BF0", "BF1", "lamp"]
    shown = [panel["data"]["name"] for panel in figure.spec["concat"]]
    assert len({*shown}) == len(titles)
    assert all(figure.spec["datasets"][name][0]["url"].startswith("data:image/png;base64,") for name in shown)
