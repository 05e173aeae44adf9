"""How errors grow, and their shape: figures and tables hold what was found."""

import io
from collections.abc import Callable

import numpy as np
import polars as pl
import pytest

from tracknoise.report.figures import distributions, growth_curves
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder


@pytest.fixture(scope="module")
def data(run: RunFolder) -> ReportData:
    return ReportData.of(run)


def drawn(figure: Figure, column: str) -> pl.DataFrame:
    texts = [data for data in figure.spec["datasets"].values() if isinstance(data, str)]
    tables = [pl.read_csv(io.StringIO(text)) for text in texts]
    return pl.concat([table for table in tables if column in table.columns], how="diagonal_relaxed")


def test_the_fit_is_drawn_over_what_was_measured(data: ReportData) -> None:
    (figure,) = growth_curves.time_structure_figures(data)
    assert isinstance(figure, Figure)
    table = drawn(figure, "moment").filter(tracker="lucas-kanade")
    fitted, measured = table.filter(pl.col("n").is_null()), table.filter(pl.col("n").is_not_null())
    expected = 0.05**2 + 0.09**2 * fitted["distance"]
    np.testing.assert_allclose(fitted["moment"], expected, rtol=2e-3)
    assert fitted["distance"].max() == measured["distance"].max()
    points = data.nominal(data.points).filter(
        pl.col("since") > 0, tracker="lucas-kanade", role="second", population="visible"
    )
    np.testing.assert_allclose(
        sorted(measured["moment"]), sorted([*(points["u"] ** 2), *(points["v"] ** 2)]), rtol=1e-3
    )
    assert "in u is a random walk. Its fitted parts in a typical scene: constant 0.050" in figure.look_for


def test_distances_from_a_key_frame_are_never_negative(make_run: Callable[..., RunFolder]) -> None:
    scanned = make_run(key_frame=8, scenes=("only",), trackers=("one",), speeds=(1,), born=40)
    (figure,) = growth_curves.time_structure_figures(ReportData.of(scanned))
    assert drawn(figure, "moment")["distance"].min() == 0  # type: ignore[arg-type]


def test_a_verdict_that_is_open_says_why(data: ReportData) -> None:
    (cells,) = growth_curves.tables(data)
    assert {row[-1] for row in cells.rows} == {""}
    verdict = pl.lit("undecided", dtype=data["time_structure"].schema["verdict"])
    open_ = data["time_structure"].with_columns(verdict=verdict, why=pl.lit("too few ages"))
    (cells,) = growth_curves.tables(data.with_tables(time_structure=open_))
    assert {tuple(row[-2:]) for row in cells.rows} == {("undecided", "too few ages")}
    assert len(cells.rows) == 16


def test_quantiles_are_drawn_for_both_trimmings(data: ReportData) -> None:
    (figure,) = distributions.gaussianity_figures(data)
    assert isinstance(figure, Figure)
    titles = [panel["title"]["text"] for panel in figure.spec["concat"]]
    assert titles[:2] == ["lucas-kanade, untrimmed", "lucas-kanade, trimmed"]
    table = drawn(figure, "observed")
    assert sorted(table["band"].unique()) == ["1 to 4", "10 to 19", "5 to 9"]
    assert "errors of lucas-kanade are heavy-tailed at ages 1 to 4, 5 to 9 and 10 to 19 (2.40 times" in figure.look_for


def test_the_tail_table_has_a_row_a_band_and_trimming(data: ReportData) -> None:
    (cells,) = distributions.tables(data)
    assert len(cells.rows) == 2 * 3 * 2
    assert all(len(row) == len(cells.headings) == len(cells.numeric) for row in cells.rows)
    assert cells.rows[0][5:9] == ["31.0 (25.0 to 40.0)", "2.40", "11.0", "0.410 (0.350 to 0.470)"]
    assert [row[-1] for row in cells.rows[:2]] == ["heavy-tailed", "light-tailed"]


def test_what_was_not_worked_out_is_absent(data: ReportData) -> None:
    empty = {name: data[name].clear() for name in ("time_structure", "gaussianity", "radii")}
    bare = data.with_tables(**empty)
    made = growth_curves.time_structure_figures, distributions.gaussianity_figures
    for family, figures in zip((growth_curves, distributions), made, strict=True):
        (item,) = figures(bare)
        assert isinstance(item, Absence)
        assert family.tables(bare) == []
