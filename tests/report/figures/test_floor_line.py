"""The truth floor in figures, in files, and in the summary."""

import json
from collections.abc import Callable

import numpy as np
import polars as pl
import pytest

from tracknoise.cli.run_summary import summary_text
from tracknoise.report.figures import error_curves
from tracknoise.report.figures.curve_panels import NAME
from tracknoise.report.figures.figure import Figure
from tracknoise.report.report_data import ReportData
from tracknoise.report.table_files import EXPORTS
from tracknoise.tables.store import RunFolder
from tracknoise.topics.bands import upright_bounds

FLOOR_PX = 0.1


@pytest.fixture(scope="module")
def data(make_run: Callable[..., RunFolder]) -> ReportData:
    return ReportData.of(make_run(scenes=("only",), speeds=(1,), born=40, floor_px=FLOOR_PX))


def lines_of(figure: Figure) -> list[dict[str, object]]:
    """Layers of the panels that draw the floor, with their rows."""
    layers = [layer for panel in figure.spec["concat"] for layer in panel["layer"]]
    found = [layer for layer in layers if layer.get("encoding", {}).get("strokeWidth")]
    data = figure.spec["datasets"]
    return [{**layer, "text": layer["data"].get("values") or data[layer["data"]["name"]]} for layer in found]


def rows(layer: dict[str, object]) -> pl.DataFrame:
    return pl.read_csv(str(layer["text"]).encode())


def test_the_floor_is_drawn_below_the_root_second_moment_and_around_the_mean(data: ReportData) -> None:
    figure = error_curves.curve_figures(data)[0]
    lines = lines_of(figure)
    assert len(lines) == 2 * 2 + 2
    drawn = [rows(line) for line in lines]
    assert all(set(table["line"]) == {NAME} for table in drawn)
    mean_u, second_u, second_v = drawn[0], drawn[4], drawn[5]
    np.testing.assert_allclose(second_u["floor"], FLOOR_PX * np.sqrt(second_u["at"]), rtol=1e-3)
    np.testing.assert_allclose(second_v["floor"], 2.0 * FLOOR_PX * np.sqrt(second_v["at"]), rtol=1e-3)
    np.testing.assert_allclose(mean_u["floor"], FLOOR_PX * np.sqrt(mean_u["at"]), rtol=1e-3)
    np.testing.assert_allclose(drawn[1]["floor"], -mean_u["floor"])
    assert "Grey dashed lines: the truth floor." in figure.shows
    assert all(line["mark"]["strokeDash"] == [6, 4] for line in lines)
    legends = [line["encoding"]["strokeWidth"]["legend"] for line in lines]
    assert all(legend["symbolDash"] == [6, 4] for legend in legends)


@pytest.mark.parametrize("world", [{}, {"scenes": ("only",), "speeds": (1,), "born": 40, "floor_px": 0.0}])
def test_there_is_no_line_where_nothing_is_known_or_the_truth_is_exact(make_run, world) -> None:
    data = ReportData.of(make_run(**world))
    figure = error_curves.curve_figures(data)[0]
    assert not lines_of(figure)
    assert "truth floor" not in figure.shows
    assert "floor" not in summary_text(data.run)


def test_along_and_across_the_motion_no_floor_is_known(data: ReportData) -> None:
    for figure in error_curves.direction_figures(data):
        assert isinstance(figure, Figure)
        assert not lines_of(figure)
        assert "truth floor" not in json.dumps(figure.spec)


def test_files_have_the_floor_in_the_unit_of_each_row(data: ReportData) -> None:
    table = {export.id: export for export in EXPORTS}["curves"].make(data)
    for statistic, value in (("nu", FLOOR_PX / 2.0), ("Phi", FLOOR_PX**2)):
        some = table.filter(statistic=statistic, weighting="features", at=4)
        assert not some.is_empty()
        factor = np.sqrt(4.0) if statistic == "nu" else 4.0
        np.testing.assert_allclose(some["floor_u"], value * factor)
    assert table.filter(statistic="eta")["floor_u"].null_count() == table.filter(statistic="eta").height
    every = {export.id: export for export in EXPORTS}["truth-floor"].make(data)
    assert set(every["source"]) == {"all", "poses"}


def test_the_summary_has_the_floor_at_its_age(data: ReportData) -> None:
    row = data["summary"].row(0, named=True)
    assert row["floor_u_px"] == pytest.approx(FLOOR_PX * np.sqrt(row["at"]))
    assert row["floor_mean_v_px"] == pytest.approx(FLOOR_PX * np.sqrt(row["at"]))
    text = summary_text(data.run)
    assert f"{row['floor_u_px']:.3f}" in text
    assert "floor u" in text


def test_floors_of_turned_images_are_upright(make_run: Callable[..., RunFolder]) -> None:

    data = ReportData.of(
        make_run(
            scenes=("only",),
            speeds=(1,),
            born=40,
            floor_px=FLOOR_PX,
            views=((0, "forward"), (90, "forward")),
        )
    )
    second = data.points.filter(role="second", at=4, trimming="untrimmed", population="visible")
    turned = upright_bounds(second, signed=pl.col("role") == "mean").filter(rotation=90)
    np.testing.assert_allclose(turned["floor_u"], 2.0 * FLOOR_PX * 2.0)
    np.testing.assert_allclose(turned["floor_v"], FLOOR_PX * 2.0)
