"""The title of the figure of surroundings: only what intervals establish."""

import polars as pl
import pytest

from tracknoise.report.figures.messages import surroundings_message

Row = tuple[str, str, str, str, float, float | None, float | None]


def table(*rows: Row) -> pl.DataFrame:
    names = ["surrounding", "class", "statistic", "coordinate", "value", "low", "high"]
    return pl.DataFrame(rows, schema=names, orient="row")


def sides(*, far: float, near: float = 1.0, spread: float = 0.2) -> list[Row]:
    """Second moments of both coordinates, px²; elsewhere they are 1."""
    values = {"far": far, "near": near, "none": 1.0}
    return [
        ("side", side, "second", axis, value, value * (1.0 - spread), value * (1.0 + spread))
        for side, value in values.items()
        for axis in "uv"
    ]


def removed(low: float | None) -> Row:
    return ("occlusion", "now", "second_removed", "u", 0.25, low, 0.4)


def test_errors_beside_depth_edges_are_compared_with_those_elsewhere() -> None:
    expected = "Errors of one are {} times as large on the {} side of depth edges"
    assert surroundings_message("one", table(*sides(far=9.0))) == expected.format("3.0", "far")
    assert surroundings_message("one", table(*sides(far=1.0, near=16.0))) == expected.format("4.0", "near")


@pytest.mark.parametrize("rows", [sides(far=1.3), sides(far=9.0, spread=0.9), sides(far=0.1, near=0.1)])
def test_intervals_that_overlap_or_lie_below_establish_nothing(rows: list[Row]) -> None:
    assert surroundings_message("one", table(*rows)) == ""


def test_both_coordinates_have_to_differ() -> None:
    only_u = [row for row in sides(far=9.0) if row[3] == "u" or row[1] == "none"]
    assert surroundings_message("one", table(*only_u)) == ""


def test_occluded_points_are_stated_where_edges_are_not() -> None:
    expected = "Excluding occluded points removes 25.0 % of the second moment of one in u"
    assert surroundings_message("one", table(*sides(far=1.0), removed(0.1))).split() == expected.split()
    assert surroundings_message("one", table(*sides(far=9.0), removed(0.1))).startswith("Errors of one are 3.0 times")
    assert surroundings_message("one", table(removed(-0.1))) == ""
    assert surroundings_message("one", table(removed(None))) == ""


def test_errors_that_are_exactly_zero_elsewhere_are_not_divided_by() -> None:
    exact = [(*row[:4], 0.0, 0.0, 0.0) if row[1] == "none" else row for row in sides(far=9.0)]
    assert surroundings_message("one", table(*exact)) == ""
