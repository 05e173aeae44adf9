"""Figures of errors by place: what they draw is what the tables have."""

from io import StringIO

import polars as pl
import pytest

from tracknoise.report.figures import maps
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData


@pytest.fixture(scope="module")
def data(run) -> ReportData:
    return ReportData.of(run)


def drawn(figure: Figure, *, layer: int = 0, panel: int = 0) -> pl.DataFrame:
    """Rows of a layer of a panel, which may have the data of the whole panel."""
    chart = figure.spec["concat"][panel]
    part = chart["layer"][layer]
    values = part.get("data", chart.get("data"))
    name = values.get("name")
    return pl.read_csv(StringIO(figure.spec["datasets"][name] if name else values["values"]))


def test_every_tracker_has_a_map_of_each_age(data: ReportData) -> None:
    figures = maps.image_map_figures(data)
    assert [figure.id for figure in figures] == [f"image-map-{data.slug(tracker)}" for tracker in data.trackers]
    for tracker, figure in zip(data.trackers, figures, strict=True):
        every = data.nominal(data["image_cells"]).filter(tracker=tracker)
        cells = every.filter(pl.col("n").sum().over("at") >= data.min_features).filter(pl.col("n") >= 5)
        ages = cells["at"].unique().sort().to_list()
        titles = [panel["title"]["text"] for panel in figure.spec["concat"]]
        assert [title.split(":")[0] for title in titles] == [f"At age {age}" for age in ages]
        for place, age in enumerate(ages):
            found, expected = drawn(figure, panel=place), cells.filter(at=age).sort("row", "column")
            assert found.sort("y", "x")["n"].to_list() == expected["n"].to_list()
            length = ((found["to_x"] - found["x"]) ** 2 + (found["to_y"] - found["y"]) ** 2).sqrt()
            assert length.max() <= 1.6 + 1e-3
            means = (expected["mean_u_px"] ** 2 + expected["mean_v_px"] ** 2).sqrt()
            assert (length > 1e-9).sum() == (means > 0).sum()


def test_arrows_point_where_the_mean_error_points(data: ReportData) -> None:
    found = drawn(maps.image_map_figures(data)[0]).with_columns(
        u=pl.col("to_x") - pl.col("x"), v=pl.col("to_y") - pl.col("y")
    )
    longer = found.filter((pl.col("u").abs() > 0.05) & (pl.col("v").abs() > 0.05))
    assert not longer.is_empty()
    assert (longer["u"].sign() == longer["mean_u_px"].sign()).all()
    assert (longer["v"].sign() == longer["mean_v_px"].sign()).all()
    right = longer.filter((pl.col("u") > 0) & (pl.col("v") > 0))  # right and down: between 90 and 180 degrees from up
    assert right["angle"].is_between(90, 180).all()


def test_classes_are_drawn_with_their_values_and_sides_are_named(data: ReportData) -> None:
    figure = maps.surrounding_figures(data)[0]
    assert isinstance(figure, Figure)
    errors = data.nominal(data["surrounding_errors"]).filter(tracker=data.trackers[0])
    whole = errors.filter(surrounding="side", coordinate="u", statistic="mean").group_by("at").agg(pl.col("n").sum())
    age = whole.filter(pl.col("n") >= data.min_features)["at"].max()
    last = errors.filter(pl.col("at") == age, pl.col("n") >= 20)
    expected = last.filter(surrounding="edge", statistic="mean", coordinate="u").sort("class_low", nulls_last=True)
    found = drawn(figure, panel=1).filter(pl.col("coordinate") == "u")
    assert sorted(found["n"].to_list()) == sorted(expected["n"].to_list())
    assert sorted(found["value"].to_list()) == pytest.approx(sorted(expected["value"].to_list()), rel=1e-3)
    assert "Features on the far side of depth edges are " in figure.look_for


def test_speeds_are_drawn_for_both_directions_at_each_age(data: ReportData) -> None:
    (figure,) = maps.image_speed_figures(data)
    points = data.nominal(data["speed_errors"]).filter(pl.col("n") >= data.min_features)
    assert isinstance(figure, Figure) == (not points.is_empty())
    if isinstance(figure, Figure):
        assert len(figure.spec["concat"]) == 2 * points["at"].n_unique()


def test_without_depth_or_errors_the_reason_is_given(make_run) -> None:
    data = ReportData.of(make_run(depth=False))
    made = [*maps.image_map_figures(data), *maps.image_speed_figures(data), *maps.surrounding_figures(data)]
    assert all(isinstance(one, Absence) for one in made)
    assert len({one.id for one in made}) == len(made)
