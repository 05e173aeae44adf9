"""The table of the documentation on what the geometry does to ratios of errors."""

import pytest
from benchmarks.linear_table import NOISES, compared, windows

from tracknoise.estimators.linear_window import Motion


@pytest.mark.parametrize(
    ("motion", "short", "whole", "by_age"),
    [
        (Motion.SIDEWAYS, False, 0.97, 1.05),
        (Motion.SIDEWAYS, True, 0.82, 0.96),
        (Motion.FORWARD, False, 0.92, 1.20),
        (Motion.FORWARD, True, 0.81, 1.01),
    ],
)
def test_the_gain_under_a_walk_depends_on_motion_and_lengths(motion, short, whole, by_age) -> None:
    drawn = windows(motion, short=short)
    nees, position, _ = compared(drawn, NOISES["walk"], "whole tracks")
    assert nees == pytest.approx(1.0, abs=1e-6)
    assert position == pytest.approx(whole, abs=0.006)
    assert compared(drawn, NOISES["walk"], "by age")[1] == pytest.approx(by_age, abs=0.006)


def test_one_sigma_is_too_careful_where_the_first_position_is_exact() -> None:
    drawn = windows(Motion.SIDEWAYS, short=False)
    assert compared(drawn, NOISES["white, first exact"], "one sigma, 0.3 px")[0] == pytest.approx(0.60, abs=0.01)
    assert compared(drawn, NOISES["white, first exact"], "by age")[0] == pytest.approx(1.0, abs=1e-6)
