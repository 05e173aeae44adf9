import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.statistics.histograms import Box, box_of_counts, box_summary


def test_by_hand() -> None:
    # Quartiles at places 2, 4, 6 of 0..8: 3, 5, 7; reach 6: -3 to 13; 20 lies beyond, 8 is the last within.
    assert box_summary([20, 1, 2, 3, 4, 5, 6, 7, 8]) == Box(9, 56 / 9, 5.0, 3.0, 7.0, 1.0, 8.0)


def test_a_whisker_never_ends_inside_the_box() -> None:
    # Lower quartile 7.5, upper 10, fence at 3.75: the first value within is 10, above the quartile.
    assert box_summary([0, 10, 10, 10]).lower_whisker == 7.5


@pytest.mark.parametrize("value", [0.0, -2.5])
def test_one_value_is_everything(value: float) -> None:
    assert box_summary([value]) == Box(1, *[value] * 6)


def test_nothing() -> None:
    assert box_summary([]) == Box(0, None, None, None, None, None, None)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30), st.randoms(use_true_random=False))
def test_parts_are_ordered_and_the_order_of_values_does_not_matter(values: list[float], random) -> None:
    box = box_summary(values)
    parts = [box.lower_whisker, box.lower_quartile, box.median, box.upper_quartile, box.upper_whisker]
    assert parts == sorted(parts)
    assert min(values) <= parts[0]
    assert parts[-1] <= max(values)
    assert box_summary(random.sample(values, len(values))) == box


def test_values_stay_as_they_were() -> None:
    values = np.array([3.0, 1.0, 2.0])
    box_summary(values)
    assert values.tolist() == [3.0, 1.0, 2.0]


@given(st.dictionaries(st.integers(1, 50), st.integers(0, 6), max_size=8))
def test_a_histogram_has_the_box_of_the_values_that_were_counted(counts: dict[int, int]) -> None:
    values = [value for value, n in counts.items() for _ in range(n)]
    found, expected = box_of_counts(list(counts), list(counts.values())), box_summary(values)
    assert found.n == expected.n
    for name in ("mean", "median", "lower_quartile", "upper_quartile", "lower_whisker", "upper_whisker"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name))
