import math

import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.statistics.yardstick import largest_differences


def points(**curves: dict[int, float]) -> pl.DataFrame:
    """Curves by level: place and value in u; v is half of it."""
    rows = [(level, at, value, value / 2) for level, curve in curves.items() for at, value in curve.items()]
    return pl.DataFrame(rows, schema=["level", "at", "u", "v"], orient="row").with_columns(statistic=pl.lit("eta"))


def compare(table: pl.DataFrame, coordinate: str = "u") -> pl.DataFrame:
    found = largest_differences(table, by=["statistic"], level="level").filter(coordinate=coordinate)
    return found.sort("level_a", "level_b")


def test_two_curves_by_hand() -> None:
    # apart by 1, 2, 1; the curve between them is 1.5, 3, 5.5 and starts at 0
    row = compare(points(a={1: 1.0, 2: 2.0, 3: 5.0}, b={1: 2.0, 2: 4.0, 3: 6.0})).row(0, named=True)
    assert (row["level_a"], row["level_b"], row["at"], row["n_shared"]) == ("a", "b", 2, 3)
    assert (row["difference"], row["common"]) == (2.0, 5.5)
    assert row["effect"] == pytest.approx(2 / 5.5)


def test_coordinates_are_compared_apart() -> None:
    table = points(a={1: 1.0}, b={1: 3.0})
    assert compare(table, "u")["difference"][0] == 2.0
    assert compare(table, "v")["difference"][0] == 1.0


def test_the_zero_at_the_beginning_counts_as_variation_on_either_side() -> None:
    assert compare(points(a={1: 4.0, 2: 5.0}, b={1: 4.0, 2: 5.0}))["common"][0] == 5.0
    assert compare(points(a={1: -4.0, 2: -5.0}, b={1: -4.0, 2: -5.0}))["common"][0] == 5.0
    assert compare(points(a={1: -4.0, 2: 5.0}, b={1: -4.0, 2: 5.0}))["common"][0] == 9.0


def test_each_pair_is_compared_where_it_has_been_seen() -> None:
    # speeds 2 and 3 share age 6 alone, where speed 1 was not seen any more
    found = compare(points(s1={1: 1.0, 2: 2.0, 3: 3.0}, s2={2: 2.5, 4: 4.0, 6: 6.0}, s3={3: 3.0, 6: 9.0}))
    assert found.select("level_a", "level_b", "difference", "at", "n_shared").rows() == [
        ("s1", "s2", 0.5, 2, 1),
        ("s1", "s3", 0.0, 3, 1),
        ("s2", "s3", 3.0, 6, 1),
    ]


def test_a_pair_that_shares_nothing_has_no_row() -> None:
    assert compare(points(a={1: 1.0}, b={2: 1.0})).is_empty()
    assert compare(points(a={1: 1.0})).is_empty()


def test_of_equal_differences_the_first_is_named() -> None:
    assert compare(points(a={3: 1.0, 2: 1.0, 1: 1.0}, b={1: 2.0, 2: 2.0, 3: 2.0}))["at"][0] == 1


def test_where_nothing_varies_a_difference_is_infinite_and_none_is_none() -> None:
    assert compare(points(a={1: 1.0}, b={1: -1.0}))["effect"][0] == math.inf
    assert compare(points(a={1: 0.0}, b={1: 0.0}))["effect"][0] == 0.0


def test_a_missing_value_is_no_shared_place() -> None:
    table = points(a={1: 1.0, 2: 2.0}, b={1: 1.5, 2: 9.0})
    cut = table.with_columns(u=pl.when((pl.col("level") == "b") & (pl.col("at") == 2)).then(None).otherwise("u"))
    assert compare(cut).select("difference", "n_shared").row(0) == (0.5, 1)
    assert compare(cut, "v")["n_shared"][0] == 2


# Subnormal numbers cannot be scaled: half of 5e-324 is 0, and an infinite effect becomes none.
values = st.dictionaries(st.integers(1, 6), st.floats(-9, 9, allow_subnormal=False), min_size=1)


@given(values, values, st.floats(0.1, 10))
def test_an_effect_has_no_unit(a: dict[int, float], b: dict[int, float], scale: float) -> None:
    once = compare(points(a=a, b=b))
    scaled = compare(points(a={k: v * scale for k, v in a.items()}, b={k: v * scale for k, v in b.items()}))
    assert scaled["effect"].to_list() == pytest.approx(once["effect"].to_list(), rel=1e-6)
