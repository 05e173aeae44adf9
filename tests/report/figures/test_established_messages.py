"""Titles of figures say nothing that the tables do not establish."""

from collections.abc import Callable, Sequence

import polars as pl
import pytest
from tests.report.figures.test_messages import judged, message, with_verdict
from tests.report.synthetic import DEGENERATE

from tracknoise.report.figures import error_curves, growth_curves, levels, maps, track_ends, truth_curves
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.tables.truth_audit import EVERYTHING, MEASURED
from tracknoise.topics.growth_topic import growth_message
from tracknoise.words import listing


@pytest.fixture(scope="module")
def data(run: RunFolder) -> ReportData:
    return ReportData.of(run)


def test_one_age_does_not_stand_for_all(data: ReportData) -> None:
    """A comparison that only a single age and coordinate decides says nothing of the tracker as a whole."""
    found = judged(with_verdict(data, "undecided", "undecided"), "yes")
    assert message(error_curves.curve_figures(found), "error-by-age").startswith("The core error of ")
    at_one_age = found["dependence"].with_columns(coordinate=pl.lit("v"), at=pl.lit(7, dtype=pl.Int64))
    assert message(error_curves.curve_figures(found.with_tables(dependence=at_one_age)), "error-by-age") == ""


def test_a_share_of_pose_errors_that_may_be_zero_is_not_stated(data: ReportData) -> None:
    assert message(truth_curves.pose_error_figures(data), "pose-errors").startswith(
        "Share that pose errors explain: 50"
    )
    undecided = data["rigid_share"].with_columns(low=pl.lit(-0.1))
    assert message(truth_curves.pose_error_figures(data.with_tables(rigid_share=undecided)), "pose-errors") == ""


def test_a_difference_of_trackers_that_one_of_many_intervals_shows_is_not_stated(data: ReportData) -> None:
    """The table says what is established for both coordinates and all ages together."""
    assert message(truth_curves.tracker_difference_figures(data), "between-trackers").endswith(
        "0.100\N{NO-BREAK SPACE}px"
    )
    open_ones = data["tracker_differences"].with_columns(established=pl.col("established") & False)
    assert (
        message(
            truth_curves.tracker_difference_figures(data.with_tables(tracker_differences=open_ones)),
            "between-trackers",
        )
        == ""
    )


def test_growth_that_the_truth_can_explain_is_not_stated(make_run: Callable[..., RunFolder]) -> None:
    world: dict[str, object] = {"scenes": ("only",), "speeds": (1,), "born": 40}
    accurate, coarse = (with_verdict(ReportData.of(make_run(**world, floor_px=size)), "drift") for size in (1e-6, 10.0))
    assert message(growth_curves.time_structure_figures(accurate), "time-structure").endswith(" is a drift")
    assert message(growth_curves.time_structure_figures(coarse), "time-structure") == growth_message(coarse) == ""


def test_a_verdict_of_one_coordinate_is_not_that_of_the_error(data: ReportData) -> None:
    fits = with_verdict(data, "random walk")["time_structure"].filter(coordinate="u")
    assert message(growth_curves.time_structure_figures(data.with_tables(time_structure=fits)), "time-structure") == ""


def test_corrections_that_change_nothing_are_not_said_to_change_the_core() -> None:
    def curves_of(after: float) -> pl.DataFrame:
        return pl.DataFrame({"at": [9, 9], "correction": [MEASURED, EVERYTHING], "core_u_px": [0.3, after]})

    assert truth_curves._audit_curve_message("lk", curves_of(0.3001)) == ""
    assert truth_curves._audit_curve_message("lk", curves_of(0.2)).startswith(
        "Corrections change the core of lk in u from "
    )


@pytest.mark.parametrize(("differing", "stated"), [(0, False), (1, False), (2, True)])
def test_one_place_of_a_few_may_differ_by_chance(differing: int, stated: bool) -> None:
    cells = pl.DataFrame({"differs": [place < differing for place in range(5)], "level": [0.95] * 5})
    found = maps._image_map_message("lk", cells)
    assert found == (f"The mean error of lk differs from zero in {differing} of 5 cells of the image" if stated else "")


@pytest.mark.parametrize(
    ("figures", "name"),
    [
        (levels.lifetimes_by_lighting_figures, "lifetimes-by-lighting"),
        (track_ends.outlier_ratio_figures, "outlier-ratio-by-lighting"),
    ],
)
def test_lightings_that_differ_by_chance_are_not_said_to_matter(
    figures: Callable[[ReportData], Sequence[Figure | Absence]], name: str, make_run
) -> None:
    data = ReportData.of(make_run(**DEGENERATE["a light stage"]))
    assert " depends on lighting; the clearest difference is " in message(figures(judged(data, "yes")), name)
    assert " depends on lighting by less than " in message(figures(judged(data, "no")), name)
    assert message(figures(judged(data, "undecided")), name) == ""


def test_speeds_whose_lifetimes_differ_by_chance_are_not_said_to_matter(data: ReportData) -> None:
    name = f"lifetimes-{data.slug(data.trackers[0])}"
    said = message(track_ends.lifetime_figures(judged(data, "yes")), name)
    assert said.startswith(f"The lifetime of {data.trackers[0]} depends on speed; ")
    assert message(track_ends.lifetime_figures(judged(data, "undecided")), name) == ""


@pytest.mark.parametrize(
    ("shares", "half", "stated"),
    [((0.5, 0.3), 0.05, True), ((0.5, 0.3), 0.15, False), ((0.4, 0.4), 0.0, False), ((0.4, 0.0), None, True)],
)
def test_one_of_several_causes_is_the_most_frequent_only_if_it_is_shown_to_be(
    data: ReportData, shares: tuple[float, float], half: float | None, stated: bool
) -> None:
    share = (
        pl.col("cause")
        .cast(pl.String)
        .replace_strict(dict(zip(("lost", "outlier"), shares, strict=True)), default=0.0, return_dtype=pl.Float64)
    )
    bounds = {"low": share - half, "high": share + half}
    table = data["incidence"].with_columns(incidence=share, **bounds)
    text = message(track_ends.incidence_figures(data.with_tables(incidence=table)), "ends-by-cause")
    assert text == (
        f"Most frequent cause of ends: {listing(f'lost for {name}' for name in data.trackers)}" if stated else ""
    )
