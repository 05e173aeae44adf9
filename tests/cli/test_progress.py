"""What is said of a run's pace."""

import pytest

from tracknoise.cli.progress import Pace


@pytest.mark.parametrize(
    ("done", "to_do", "elapsed_s", "said"),
    [
        (0, 10, 5.0, ""),
        (4, 10, 2.0, "2.0/s, 3 s left"),
        (1, 10, 20.0, "3.0/min, 3 min left"),
        (2, 60, 1200.0, "6.0/h, 9 h 40 min left"),
        (1, 3, 7200.0, "0.5/h, 4 h 00 min left"),
        (10, 10, 20.0, "30.0/min, 0 s left"),
    ],
)
def test_rate_and_time_left(done, to_do, elapsed_s, said):
    times = iter([100.0, 100.0 + elapsed_s])
    pace = Pace(to_do, clock=lambda: next(times))
    for _ in range(done):
        pace.advance()
    assert str(pace) == said
