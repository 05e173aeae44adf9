"""Panels that show all of their data, and nothing else: axes, boxes and the width of the page."""

import re

import polars as pl
import pytest

from tracknoise.report.figure_files import render, specification
from tracknoise.report.figures import levels, marks
from tracknoise.report.figures.curve_panels import Series
from tracknoise.report.figures.families import FAMILIES
from tracknoise.report.figures.figure import Figure
from tracknoise.report.figures.levels import comparison
from tracknoise.report.report_data import ReportData

WIDEST = 968
"""Width of the column of figures in a window of 1280 px, less the bar that scrolls."""
NINE_SPEEDS = (1, 2, 3, 4, 5, 8, 10, 15, 20)


def test_a_logarithmic_axis_starts_where_the_data_do() -> None:
    low, high = _domain(2500.0, 30_000.0)
    assert 1000 < low < 2500
    assert 30_000 < high < 60_000
    assert _domain(2500.0, marked=100)[0] == pytest.approx(100 / 1.5)
    assert _domain(0.6, 50.0)[0] == 0.6
    assert _domain()[0] < 1


def _domain(*drawn: float, marked: float | None = None) -> list[float]:
    """Ends of the axis for the counts that are drawn."""
    axis = marks.log_count("", pl.Series(drawn, dtype=pl.Float64), *([] if marked is None else [marked]))
    return axis.to_dict()["scale"]["domain"]


def test_a_speed_without_a_curve_has_no_box_and_no_colour_in_the_legend(make_run):
    data = ReportData.of(make_run(scenes=("only",), trackers=("one",), speeds=(1, 2, 20), born=40))
    assert data.points.filter(speed=20)["since"].unique().to_list() == [0]
    (figure,) = levels.speed_figures(data)
    curves, boxes = figure.spec["concat"][:2]
    line = next(layer["encoding"] for layer in curves["layer"] if "color" in layer["encoding"])
    assert line["color"]["scale"]["domain"] == ["1", "2"]
    assert boxes["layer"][0]["encoding"]["x"]["sort"] == ["1", "2"]
    assert "No age has enough features for speed 20." in figure.look_for


def test_all_rows_of_a_figure_have_the_frames_of_its_curves_and_the_key_frame(make_run):
    data = ReportData.of(make_run(scenes=("only",), trackers=("one",), speeds=(1,), born=40, key_frame=8))
    few = data.points.filter(pl.col("since").is_in([0, 2]))
    figure = comparison(data, few, Series("speed", {"1": "#000000"}), id="a", title="", shows="", advice="")
    assert isinstance(figure, Figure)
    frames = [panel["layer"] for panel in figure.spec["concat"] if panel["layer"][-1]["mark"]["type"] == "text"]
    assert len(frames) == 8
    for layers in frames:
        low, high = next(layer["encoding"]["x"] for layer in layers if "scale" in layer["encoding"]["x"])["scale"][
            "domain"
        ]
        assert low < 8 < 10 < high


LIT = ("error-by-tracker", "error-by-lighting", "lifetimes", "outlier-ratio")
"""Families whose figures have other panels where there are a key frame and several lightings."""


@pytest.mark.parametrize(
    ("world", "ids"),
    [
        ({"speeds": NINE_SPEEDS, "n_frames": 45, "born": 20}, [family.id for family in FAMILIES]),
        ({"key_frame": 8, "lightings": ("diffuse", "LR0", "BF0"), "speeds": (1,), "born": 40}, LIT),
    ],
    ids=["age", "frame"],
)
def test_no_figure_is_wider_than_the_page(make_run, world, ids):
    data = ReportData.of(make_run(scenes=("only",), trackers=("one",), **world))
    families = [family for family in FAMILIES if family.id in ids]
    assert len(families) == len(ids)
    made = [figure for family in families for figure in family.figures(data) if isinstance(figure, Figure)]
    widths = {figure.id: _width(figure) for figure in made}
    assert {name: width for name, width in widths.items() if width > WIDEST} == {}


def _width(figure: Figure) -> int:
    svg = render(specification(figure), ("svg",))["svg"].decode()
    return int(re.search(r'width="(\d+)"', svg).group(1))
