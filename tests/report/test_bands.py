"""Bands around curves are the intervals of their own points."""

import io
from collections.abc import Callable

import numpy as np
import polars as pl
import pytest
from tests.report.figures.test_lightings import LIGHTINGS

from tracknoise.report.figures import error_curves, levels, track_ends
from tracknoise.report.figures.figure import Figure
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import upright
from tracknoise.tables.store import RunFolder
from tracknoise.topics import bands


@pytest.fixture(scope="module")
def data(run: RunFolder) -> ReportData:
    return ReportData.of(run)


def drawn(figure: Figure, *columns: str) -> pl.DataFrame:
    """All inline data of a figure that have certain columns."""
    texts = [data for data in figure.spec["datasets"].values() if isinstance(data, str)]
    tables = [pl.read_csv(io.StringIO(text)) for text in texts]
    return pl.concat([table for table in tables if {*columns} <= {*table.columns}], how="diagonal_relaxed")


def figure_of(items: object, name: str) -> Figure:
    return next(item for item in items if isinstance(item, Figure) and item.id == name)  # type: ignore[attr-defined]


def test_points_carry_the_roots_of_their_bounds(data: ReportData) -> None:
    keys = {"tracker": "lucas-kanade", "speed": 1, "at": 5, "population": "visible", "trimming": "trimmed"}
    point = data.points.filter(**keys, role="second").row(0, named=True)
    asked = {"weighting": "features", "statistic": "Phi", "coordinate": "v"}
    interval = data["intervals"].filter(**keys, **asked).row(0, named=True)
    assert point["v_low"] == pytest.approx(interval["low"] ** 0.5)
    assert point["v_high"] == pytest.approx(interval["high"] ** 0.5)
    assert (point["level"], point["resampled"], point["n_resampled"]) == (0.95, "blocks", interval["n_scenes"])


def test_no_point_is_lost_or_doubled(data: ReportData) -> None:
    bare = data.with_tables(intervals=data["intervals"].clear())
    columns = [name for name in bare.points.columns if name not in (*bands.BOUNDS, *bands.KIND)]
    assert data.points.select(columns).equals(bare.points.select(columns))
    assert bare.points["u_low"].null_count() == bare.points.height


def test_curves_draw_their_bounds(data: ReportData) -> None:
    figure = figure_of(error_curves.curve_figures(data), "error-by-age")
    band = drawn(figure, "u_low", "u_high").filter(tracker="lucas-kanade")
    expected = data.nominal(data.points).filter(
        pl.col("role") != "central", tracker="lucas-kanade", trimming="trimmed", population="visible"
    )
    expected = expected.drop_nulls("u_low")
    assert band.height == expected.height
    np.testing.assert_allclose(sorted(band["u_low"]), sorted(expected["u_low"]), rtol=1e-3, atol=1e-12)
    assert "95\N{NO-BREAK SPACE}% intervals from blocks of tracks resampled within" in figure.shows
    assert "They hold only for the scenes of this run." in figure.shows


def test_selections_live_where_the_legend_is(data: ReportData) -> None:
    panel = figure_of(error_curves.curve_figures(data), "error-by-age").spec["concat"][0]
    named = [layer for layer in panel["layer"] if "name" in layer]
    assert [layer["mark"]["type"] for layer in panel["layer"]][:2] == ["area", "line"]
    assert [layer["mark"]["type"] for layer in named] == ["line"]


def test_without_intervals_there_is_no_band(data: ReportData) -> None:
    bare = data.with_tables(intervals=data["intervals"].clear())
    for figure in (
        figure_of(error_curves.curve_figures(bare), "error-by-age"),
        figure_of(track_ends.lifetime_figures(bare), "lifetimes"),
    ):
        assert not any(
            layer["mark"]["type"] == "area" for panel in figure.spec["concat"] for layer in panel.get("layer", [])
        )
        assert "No intervals were computed for the" in figure.shows


def test_of_many_curves_the_first_alone_has_a_band(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(scenes=("only",), trackers=("one",), lightings=LIGHTINGS, born=40))
    figure, *_ = levels.lighting_figures(data)
    assert drawn(figure, "u_low", "u_high")["lighting"].unique().to_list() == ["diffuse"]
    assert "Bands around the curve under diffuse:" in figure.shows


def test_a_band_does_not_squash_its_curve(data: ReportData) -> None:
    wide = data["intervals"].with_columns(low=pl.col("value") - 1e3, high=pl.col("value") + 1e3)
    figure = figure_of(error_curves.curve_figures(data.with_tables(intervals=wide)), "error-by-age")
    values = drawn(figure, "u", "v", "of")["u"]
    domain = figure.spec["concat"][0]["layer"][1]["encoding"]["y"]["scale"]["domain"]
    assert domain[1] - domain[0] < 10 * (values.max() - values.min())  # type: ignore[operator]


def test_survival_and_outlier_ratio_draw_their_bounds(data: ReportData) -> None:
    survival = drawn(figure_of(track_ends.lifetime_figures(data), "lifetimes"), "series", "low", "high")
    expected = data["intervals"].filter(statistic="survival", speed=1)
    np.testing.assert_allclose(sorted(survival["high"]), sorted(expected["high"]), rtol=1e-3)
    ratio = drawn(figure_of(track_ends.outlier_ratio_figures(data), "outlier-ratio"), "pooled_ratio", "low", "high")
    expected = data["intervals"].filter(statistic="outlier_ratio")
    np.testing.assert_allclose(sorted(ratio["low"]), sorted(expected["low"]), rtol=1e-3)


@pytest.mark.parametrize("rotation", [0, 90, 180, 270])
@pytest.mark.parametrize("signed", [True, False])
def test_bounds_turn_with_their_values(rotation: int, signed: bool) -> None:
    points = pl.DataFrame(
        {
            "rotation": [rotation],
            "u": [0.3],
            "v": [0.7],
            "u_low": [0.1],
            "u_high": [0.4],
            "v_low": [0.6],
            "v_high": [1.0],
            "floor_u": [0.2],
            "floor_v": [0.5],
        }
    )
    row = bands.upright_bounds(points, signed=pl.lit(signed)).row(0, named=True)
    assert (row["u"], row["v"]) == upright(points, signed=pl.lit(signed)).select("u", "v").row(0)
    widths = {"u": 0.3, "v": 0.4} if rotation in (0, 180) else {"u": 0.4, "v": 0.3}
    assert row["floor_u"] == (0.2 if rotation in (0, 180) else 0.5)
    for axis, width in widths.items():
        assert row[f"{axis}_low"] <= row[axis] <= row[f"{axis}_high"]
        assert row[f"{axis}_high"] - row[f"{axis}_low"] == pytest.approx(width)


def test_turned_images_have_bands(make_run: Callable[..., RunFolder]) -> None:
    turned = make_run(
        views=((0, "forward"), (90, "forward")), scenes=("only",), trackers=("one",), speeds=(1,), born=40
    )
    (figure,) = levels.rotations(ReportData.of(turned))
    band = drawn(figure, "u_low", "u_high")
    assert set(band["rotation"]) == {"upright", "sideways"}
    assert (band["u_low"] <= band["u_high"]).all()
