import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracknoise.trackers.detection import Detection
from tracknoise.trackers.spacing import Mask


def one_after_the_other(uv: np.ndarray, size: tuple[int, int], detection: Detection, centres: list) -> list[int]:
    """The definition, word by word; `centres` grows."""
    kept, margin, reach = [], detection.margin_px, detection.square_px // 2
    for index, (u, v) in enumerate(uv):
        if not np.isfinite([u, v]).all():
            continue
        column, row = np.floor(u), np.floor(v)
        inside = margin <= column < size[0] - margin and margin <= row < size[1] - margin
        if inside and not any(abs(column - x) <= reach and abs(row - y) <= reach for x, y in centres):
            centres.append((np.floor(u + 0.5), np.floor(v + 0.5)))
            kept.append(index)
    return kept


@given(
    seed=st.integers(0, 2**32),
    size=st.tuples(st.integers(1, 70), st.integers(1, 70)),
    square_px=st.sampled_from([1, 3, 5, 15]),
    margin_px=st.integers(0, 9),
    whole=st.booleans(),
)
def test_two_rounds_of_claims_are_those_of_the_sequential_definition(seed, size, square_px, margin_px, whole):
    detection = Detection(square_px=square_px, margin_px=margin_px)
    rng = np.random.default_rng(seed)
    first, second = (rng.uniform(-4, max(size) + 4, (count, 2)) for count in rng.integers(0, 80, 2))
    if whole:
        first, second = np.round(first), np.round(second)
    first[rng.random(len(first)) < 0.05] = np.nan
    mask, centres = Mask(size, detection), []
    assert mask.claim(first).tolist() == one_after_the_other(first, size, detection, centres)
    assert mask.claim(second).tolist() == one_after_the_other(second, size, detection, centres)


def test_a_limit_keeps_the_first():
    uv = np.array([[20.0, 20.0], [22.0, 20.0], [60.0, 20.0], [20.0, 60.0]])
    assert Mask((100, 100), Detection()).claim(uv, limit=2).tolist() == [0, 2]
    assert Mask((100, 100), Detection()).claim(uv, limit=0).tolist() == []


@pytest.mark.parametrize(("u", "free"), [(7.99, False), (8.0, True), (91.99, True), (92.0, False)])
def test_the_margin_is_eight_pixels_wide(u, free):
    assert len(Mask((100, 100), Detection()).claim(np.array([[u, 50.0]]))) == free


@pytest.mark.parametrize(("distance", "free"), [(7.0, False), (7.99, False), (8.0, True)])
def test_a_square_reaches_seven_pixels_from_its_centre(distance, free):
    uv = np.array([[50.0, 50.0], [50.0 + distance, 50.0]])
    assert len(Mask((100, 100), Detection()).claim(uv)) == 1 + free
