"""Numbers of two runs, paired by scene and place."""

import numpy as np
import polars as pl

from tracknoise.analysis.scene_values import NUMBERS, number_differences

SCENES = [f"s{place}" for place in range(6)]


def numbers(value: float, windows: tuple[int | None, ...]) -> pl.DataFrame:
    rows = [(scene, window, value) for scene in SCENES for window in windows]
    return pl.DataFrame(rows, schema=NUMBERS, orient="row")


def test_numbers_are_compared_at_the_windows_that_both_runs_have() -> None:
    found = number_differences([numbers(2.0, (5, 10)), numbers(1.0, (3, 5))], SCENES, logarithms=True)
    assert found.places.tolist() == [5]
    np.testing.assert_allclose(found.values, np.log(2.0))
    assert found.both.all()


def test_numbers_without_windows_have_one_change() -> None:
    found = number_differences([numbers(3.0, (None,)), numbers(1.0, (None,))], SCENES, logarithms=False)
    assert not len(found.places)
    np.testing.assert_allclose(found.values, 2.0)


def test_without_a_common_window_nothing_is_compared() -> None:
    found = number_differences([numbers(2.0, (3, 5)), numbers(1.0, (10, 15))], SCENES, logarithms=True)
    assert np.isnan(found.values).all()
    assert found.both.all()
