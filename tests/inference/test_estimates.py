"""Estimates: what their intervals decide, and how they are written."""

import numpy as np
import pytest

from tracknoise.inference.estimates import Estimate, EstimateArray
from tracknoise.words import format_as, format_estimate, percent


def test_an_interval_is_above_or_below_a_bound_with_all_of_it() -> None:
    estimate = Estimate(0.5, 0.4, 0.6)
    assert estimate.above(0.39)
    assert not estimate.above(0.4)
    assert estimate.below(0.61)
    assert not estimate.below(0.6)


def test_without_bounds_nothing_is_decided() -> None:
    unknown = Estimate(0.5)
    assert not unknown.above(-1e9)
    assert not unknown.below(1e9)


@pytest.mark.parametrize("frames", [44.0, 43.99999999999999, 44.00000000000001])
def test_whole_frames_are_written_the_same_whatever_the_last_bit(frames) -> None:
    """Machines of two kinds round differently."""
    assert format_estimate(Estimate(frames, frames, None, "frames")) == "44\N{NO-BREAK SPACE}frames (44 or more)"
    assert format_estimate(Estimate(43.9, None, None, "frames")) == "43.9\N{NO-BREAK SPACE}frames"


def test_one_of_an_array_has_none_where_the_array_has_nan() -> None:
    counts = np.full((2, 2), 8)
    values, low, high = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[0.5, np.nan], [2.0, 3.0]]), np.full((2, 2), 9.0)
    array = EstimateArray(values, low, high, counts, counts, "bca", 0.9)
    assert array.at(0, 1, unit="px") == Estimate(2.0, None, 9.0, "px", "bca", 0.9)
    assert array.at(1) == Estimate(3.0, 2.0, 9.0, "", "bca", 0.9)


def test_a_row_of_a_table_is_an_estimate_with_its_kind_and_level() -> None:
    row = {"size": 1.0, "size_low": 0.5, "size_high": None, "kind": "student", "level": 0.95, "why": "no"}
    assert Estimate.of_row(row, "size", "size_low", "size_high", "px") == Estimate(
        1.0, 0.5, None, "px", "student", 0.95
    )


def test_a_value_takes_the_interval_that_was_found_for_it() -> None:
    assert Estimate.of(0.41, None, "px") == Estimate(0.41, unit="px")
    found = Estimate(0.4100001, 0.38, 0.45, "px", "student", 0.95)
    assert Estimate.of(0.41, found, "px") == Estimate(0.41, 0.38, 0.45, "px", "student", 0.95)


@pytest.mark.parametrize(
    ("estimate", "text"),
    [
        (Estimate(0.41, 0.38, 0.45, "px"), "0.410 px (0.380 to 0.450)"),
        (Estimate(0.41, unit="px"), "0.410 px"),
        (Estimate(7.0, 6.0, None, "frames"), "7 frames (6 or more)"),
        (Estimate(1.0, None, 2.5, "frames"), "1 frame (up to 2.50)"),
        (Estimate(0.0482, 0.041, 0.055, "share"), "4.8 % (4.1 % to 5.5 %)"),
        (Estimate(None), "\N{EN DASH}"),
    ],
)
def test_estimates_are_written_with_unit_and_interval(estimate: Estimate, text: str) -> None:
    assert format_estimate(estimate).replace("\N{NO-BREAK SPACE}", " ") == text


def test_numbers_can_be_written_in_another_way() -> None:
    text = format_as(Estimate(0.5, 0.4, 0.6), percent, unit=" of all")
    assert text.replace("\N{NO-BREAK SPACE}", " ") == "50.0 % of all (40.0 % to 60.0 %)"
