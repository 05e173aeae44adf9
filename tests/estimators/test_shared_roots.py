import numpy as np
import pytest

from tracknoise.estimators.equivalents import shared_roots


def test_roots_inside_and_outside_of_the_first_range_are_found_with_few_evaluations() -> None:
    roots, seen = np.array([-4.0, 0.3, 2.5]), []

    def values(at: float) -> np.ndarray:
        seen.append(at)
        return -np.expm1(at - roots) - (at - roots)

    assert shared_roots(values, np.array([0.0, 1.0]), close=0.02) == pytest.approx(roots, abs=0.005)
    assert len(seen) < 20


def test_a_root_that_is_nowhere_is_taken_to_be_at_the_end_of_what_was_tried() -> None:
    found = shared_roots(lambda at: np.array([1.0, -at]), np.array([0.5, 1.5]), close=0.02)
    assert found == pytest.approx([13.5, 0.0], abs=0.01)
