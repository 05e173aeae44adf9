import pytest

from tracknoise.exceptions import SettingsError
from tracknoise.sequences.frame_range import frame_range


@pytest.mark.parametrize("frames", [3, "ab", [2, 1], [0], [0, 5, 0], [0.0, 5.0], [0, 5, 1, 1], None, [-1, 5]])
def test_what_is_no_range_is_named(frames):
    with pytest.raises(SettingsError, match="expected first, last and step"):
        frame_range(frames, 9, "here")


def test_the_last_frame_is_included_and_may_lie_beyond_the_end():
    assert list(frame_range([1, 7, 3], 9, "here")) == [1, 4, 7]
    assert list(frame_range((6, 99), 9, "here")) == [6, 7, 8]
