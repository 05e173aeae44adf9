"""Second moments in px², against the curves of the run."""

import io

import polars as pl
import pytest

from tracknoise.report.figures.error_curves import second_moment_figures
from tracknoise.report.figures.figure import Figure
from tracknoise.report.report_data import ReportData
from tracknoise.words import SPACE, number


def test_elements_are_those_of_the_curves_and_not_their_roots(make_run):
    data = ReportData.of(make_run(scenes=("only",), trackers=("one",), speeds=(1,), born=40))
    (figure,) = second_moment_figures(data)
    assert isinstance(figure, Figure)
    assert figure.id == "second-moment-by-age"
    curve = data["curves"].filter(statistic="Phi", weighting="features", trimming="trimmed", population="visible")
    curve = curve.filter(~pl.col("cut")).sort("at")
    drawn = [pl.read_csv(io.StringIO(text)) for text in figure.spec["datasets"].values() if isinstance(text, str)]
    for element, table in zip(("u", "uv", "v"), drawn, strict=True):
        assert table[element].to_list() == pytest.approx(curve[element].to_list(), rel=1e-3, abs=1e-12)
    at_ten = curve.filter(at=10).row(0, named=True)
    u, uv, v = (f"{number(at_ten[name])}{SPACE}px²" for name in ("u", "uv", "v"))
    assert figure.look_for.startswith(f"At age 10, one has {u} in u, {v} in v and {uv} between them.")
