import numpy as np
import pytest

from tracknoise.sequences.kitti import still_stretch

RULE = {"frames": 4, "step_m": 0.02}


def moving_by(*steps_m: float) -> np.ndarray:
    poses = np.broadcast_to(np.eye(4), (len(steps_m) + 1, 4, 4)).copy()
    poses[1:, 0, 3] = np.cumsum(np.array(steps_m) * 0.6)
    poses[1:, 2, 3] = np.cumsum(np.array(steps_m) * 0.8)
    return poses


@pytest.mark.parametrize(
    ("steps_m", "expected"),
    [
        ([1.0] * 8, None),
        ([1.0, 0.01, 0.01, 0.01, 1.0, 0.01, 0.01, 0.01], None),  # twice three frames
        ([1.0, 0.01, 0.01, 0.01, 0.0199, 1.0], range(2, 6)),
        ([1.0, 0.01, 0.01, 0.0201, 0.01, 0.01], None),
        ([0.0] * 4 + [1.0] + [0.0] * 5, range(6, 11)),  # the longest
        ([0.0] * 4 + [1.0] + [0.0] * 4, range(1, 5)),  # the first of two
        ([-0.01] * 4, range(1, 5)),
        ([], None),
    ],
)
def test_by_hand(steps_m, expected):
    assert still_stretch(moving_by(*steps_m), **RULE) == expected


def test_creeping_is_not_standing():
    """2.1 cm a frame for ever, and less than 2 cm in every frame but each fourth."""
    assert still_stretch(moving_by(*[0.021] * 50), **RULE) is None
    assert still_stretch(moving_by(*[0.0, 0.0, 0.0, 0.021] * 12), **RULE) is None
