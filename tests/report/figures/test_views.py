"""Curves of turned images and of sequences played backward, against the errors that were made up for them."""

import re
from collections.abc import Callable

import polars as pl
import pytest

from tracknoise.report.figures import levels
from tracknoise.report.figures.figure import Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.words import px

VIEWS = ((0, "forward"), (90, "forward"), (0, "backward"))
DRIFT_PX = 0.05


@pytest.fixture(scope="module")
def data(make_run: Callable[..., RunFolder]) -> ReportData:
    """Errors drift by (1, -1/2) a frame in the upright image, and nothing else is wrong."""
    world = {"scenes": ("only",), "trackers": ("one",), "speeds": (1,), "sigma_px": 0.0, "bias_px": DRIFT_PX}
    return ReportData.of(make_run(**world, views=VIEWS, percentile=None, hidden=0.0))


def _told(figure: object) -> str:
    assert isinstance(figure, Figure)
    return figure.look_for


def test_errors_in_turned_images_are_told_in_the_axes_of_the_upright_one(data: ReportData) -> None:
    table = data.across(data.points, "rotation").filter(trimming="trimmed", population="visible", role="mean")
    rows = {row["rotation"]: row for row in table.filter(at=4).to_dicts()}
    assert (rows[90]["u"], rows[90]["v"]) == pytest.approx((-0.5 * 4 * DRIFT_PX, -4 * DRIFT_PX))  # as measured
    (figure,) = levels.rotations(data)
    told = re.findall(r"in upright images is (.*) in v\. In sideways images it is (.*) in v\.", _told(figure))
    ((upright, sideways),) = told
    assert upright == sideways  # the same path was made up for both


def test_both_rotations_draw_the_same_signed_curve(data: ReportData) -> None:
    (figure,) = levels.rotations(data)
    assert isinstance(figure, Figure)
    tables = [text for text in figure.spec["datasets"].values() if isinstance(text, str) and "mean" in text]
    mean = pl.read_csv(tables[0].encode())
    upright, sideways = (mean.filter(rotation=name).sort("at") for name in ("upright", "sideways"))
    assert upright["u"].max() == pytest.approx(DRIFT_PX * upright["at"].max(), rel=1e-3)
    assert upright["v"].min() == pytest.approx(-DRIFT_PX / 2 * upright["at"].max(), rel=1e-3)
    both = upright.join(sideways, on="at", suffix="_sideways")
    assert both.height > 5
    assert (both["u"] - both["u_sideways"]).abs().max() < 1e-3
    assert (both["v"] - both["v_sideways"]).abs().max() < 1e-3


def test_a_bias_that_follows_the_motion_is_told_with_both_signs(data: ReportData) -> None:
    (figure,) = levels.directions(data)
    age = int(re.match(r"At age (\d+), the mean error when played forward is", _told(figure)).group(1))
    u, v = age * DRIFT_PX, age * DRIFT_PX / 2
    told = f"{px(u)} in u and {px(-v)} in v. When played backward it is {px(-u)} in u and {px(v)} in v."
    assert told in _told(figure)


def test_one_view_leaves_nothing_to_compare(run: RunFolder) -> None:
    assert levels.rotations(ReportData.of(run)) == levels.directions(ReportData.of(run)) == []


def test_a_drift_that_trimming_may_hide_is_shown_without_it_too(make_run: Callable[..., RunFolder]) -> None:
    world = {"scenes": ("only",), "trackers": ("one",), "speeds": (1,), "views": ((0, "forward"), (0, "backward"))}
    for trimming, ids in {"trimmed": ["", "-untrimmed"], "untrimmed": [""]}.items():
        figures = levels.directions(ReportData.of(make_run(**world, trimming=trimming, trim_among="followed")))
        assert [figure.id for figure in figures] == [f"error-by-direction-one{end}" for end in ids]
        assert isinstance(figures[-1], Figure)
        assert figures[-1].shows.startswith("Untrimmed errors of one")
