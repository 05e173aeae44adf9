import pytest

from tracknoise.inference.estimates import Estimate
from tracknoise.words import (
    SPACE,
    count,
    coverage_sentence,
    format_estimate,
    interval_text,
    listing,
    next_scene_text,
    number,
    percent,
    pixels,
    px,
    spread_text,
    times,
)


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (None, "–"),
        (0, "0"),
        (0.0, "0"),
        (12345, "12,345"),
        (-3, "−3"),
        (11.52, "11.5"),
        (0.12345, "0.123"),
        (-0.5, "−0.500"),
        (999.6, "1,000"),
        (-9.996, "−10.0"),
        (0.9996, "1.00"),
        (0.000996, "0.00100"),
        (-0.0, "0"),
        (123456.7, "123,457"),
        (0.00012, "1.2\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10⁻⁴"),
        (-3e-12, "−3.0\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10⁻¹²"),
    ],
)
def test_numbers_have_three_significant_digits(value: float | None, written: str) -> None:
    assert number(value) == written


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (0.0, "0"),
        (0.0304, "0.030"),
        (-0.0006, "−0.001"),
        (1.23456, "1.235"),
        (12.345, "12.3"),
        (9.9996, "10.0"),
        (None, "–"),
    ],
)
def test_short_lengths_are_written_to_a_thousandth_of_a_pixel(value: float | None, written: str) -> None:
    assert pixels(value) == written


def test_units_stay_with_their_numbers() -> None:
    assert px(0.5) == "0.500\N{NO-BREAK SPACE}px"
    assert percent(0.0483) == "4.8\N{NO-BREAK SPACE}%"
    assert percent(-0.0483) == "\N{MINUS SIGN}4.8\N{NO-BREAK SPACE}%"
    assert percent(-1e-5) == "0.0\N{NO-BREAK SPACE}%"
    assert px(None) == percent(None) == "unknown"


def test_counts_agree_with_their_noun() -> None:
    assert [count(n, "track") for n in (0, 1, 1200)] == ["no tracks", "1 track", "1,200 tracks"]


def test_listings_read_like_prose() -> None:
    assert [listing("abc"[:n]) for n in range(4)] == ["", "a", "a and b", "a, b and c"]


def test_a_huge_ratio_is_not_written_out() -> None:
    assert times(2.5e22).replace(SPACE, " ") == "more than 1000 times"
    assert format_estimate(Estimate(3000.0, 812.0, 9e9, unit="times")).replace(SPACE, " ") == (
        "more than 1000 times (812 to more than 1000)"
    )


@pytest.mark.parametrize(
    ("resampled", "expected"),
    [
        ("scenes", "95 % intervals over 8 scenes"),
        ("groups", "95 % intervals over groups of 8 scenes"),
        ("within", "95 % intervals over 8 scenes, resampled within their groups"),
        ("blocks", "95 % intervals from blocks of tracks resampled within 8 scenes"),
    ],
)
def test_what_intervals_resample_is_said(resampled: str, expected: str) -> None:
    assert interval_text(0.95, resampled, [8]).replace(SPACE, " ") == expected


def test_how_much_scenes_differ_is_said() -> None:
    said = coverage_sentence("There", 0.95, 0.883).replace(SPACE, " ")
    assert said == "There a 95 % interval can cover as little as 88 % in data like yours."
    assert {coverage_sentence("There", 0.95, covered) for covered in (0.95, 0.99, None)} == {""}
    assert spread_text(0.64, "px", is_scale=True) == "varies between scenes by a factor of 1.9"
    assert spread_text(0.64, "share", is_scale=True) == "varies between scenes by a factor of 1.9 in odds"
    assert spread_text(0.12, "px", is_scale=False).replace(SPACE, " ") == "varies between scenes by 0.120 px"
    assert next_scene_text(0.2, 1.4, "px").replace(SPACE, " ") == "0.200 to 1.400 px are expected in the next scene"
    assert next_scene_text(0.021, 0.4, "share").replace(SPACE, " ") == "2.1 % to 40.0 % are expected in the next scene"
