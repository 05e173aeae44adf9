"""A recorder fed by hand: numbering, ends, found counts and quality."""

from dataclasses import replace

import numpy as np
import pytest

from tracknoise.exceptions import TrackerError
from tracknoise.measurement.recording import Recorder
from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.tracker import Step


def step(uv, ids, born, ended=(), **quality):
    found = len(ids) - sum(born)
    return Step(
        ids=np.array(ids, np.int64),
        uv=np.array(uv, float).reshape(-1, 2),
        born=np.array(born, bool),
        response=np.arange(len(ids), dtype=np.float32),
        ended_ids=np.array([i for i, _ in ended], np.int64),
        ended=np.array([reason for _, reason in ended], np.int8),
        offered=found + len(ended),
        matched=found,
        outliers=0,
        alive=len(ids),
        quality={name: np.array(values, np.float32) for name, values in quality.items()},
    )


def add(recorder, index, one):
    """Record a step whose features have their own place for a gradient."""
    return recorder.add(index, one, gradient_rad=lambda uv: uv[:, 0].astype(np.float32))


STEPS = {
    0: step([(50, 1), (5, 2), (95, 3)], [70, 30, 50], [True, True, True]),
    2: step([(52, 1), (96, 3)], [70, 50], [False, False], [(30, TrackEnd.lost)], sure=[0.5, np.nan]),
    4: step([(97, 3), (20, 9)], [50, 10], [False, True], [(70, TrackEnd.outlier)], sure=[1, 2], apt=[3, 4]),
}


@pytest.fixture
def recording():
    recorder = Recorder()
    for index, one in STEPS.items():
        add(recorder, index, one)
    return recorder.finish()


def test_tracks_are_numbered_in_the_order_of_birth_whatever_their_ids(recording):
    assert recording.track.tolist() == [0, 1, 2, 0, 2, 2, 3]
    assert recording.frame.tolist() == [0, 0, 0, 2, 2, 4, 4]
    assert recording.first_frame.tolist() == [0, 0, 0, 4]


def test_each_step_returns_the_numbers_of_its_tracks(recording):
    recorder = Recorder()
    numbers = [add(recorder, index, one) for index, one in STEPS.items()]
    assert [one.tolist() for one in numbers] == [[0, 1, 2], [0, 2], [2, 3]]
    assert all(one.dtype == np.uint32 for one in numbers)


def test_lifetime_counts_frames_found_and_survivors_end_with_the_sequence(recording):
    assert recording.found.tolist() == [2, 1, 3, 1]
    assert recording.end.tolist() == [TrackEnd.outlier, TrackEnd.lost, TrackEnd.sequence_end, TrackEnd.sequence_end]


def test_responses_and_gradients_belong_to_their_tracks(recording):
    assert recording.response.tolist() == [0, 1, 2, 1]
    assert recording.gradient_rad.tolist() == [50, 5, 95, 20]


def test_quality_is_unknown_where_a_step_does_not_have_it(recording):
    nan = np.nan
    assert list(recording.quality) == ["apt", "sure"]
    np.testing.assert_array_equal(recording.quality["apt"], np.float32([nan, nan, nan, nan, nan, 3, 4]))
    np.testing.assert_array_equal(recording.quality["sure"], np.float32([nan, nan, nan, 0.5, nan, 1, 2]))
    assert recording.quality["sure"].dtype == np.float32


def test_a_tracker_that_reports_an_unknown_feature_is_refused():
    recorder = Recorder()
    add(recorder, 0, step([(50, 1)], [7], [True]))
    with pytest.raises(TrackerError, match="feature 8"):
        add(recorder, 1, step([(50, 1)], [8], [False]))


@pytest.mark.parametrize("name", ["Sure", "2sure", "su-re", ""])
def test_quality_with_a_bad_name_is_refused(name):
    with pytest.raises(TrackerError, match=rf"quality '{name}', expected a name of the form"):
        add(Recorder(), 0, step([(50, 1)], [7], [True], **{name: [1.0]}))


@pytest.mark.parametrize("values", [np.float32([1, 2]), np.float64([1]), np.float32([[1]])])
def test_quality_of_another_shape_or_type_is_refused(values):
    one = step([(50, 1)], [7], [True])
    one.quality["sure"] = values
    with pytest.raises(TrackerError, match=r"quality 'sure' as .*, expected float32 of shape \(1,\)"):
        add(Recorder(), 0, one)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (step([(50, 1), (50, 1), (5, 2)], [7, 7, 9], [False, False, False]), "feature 7 twice in one frame"),
        (step([(50, 1), (5, 2), (6, 3)], [7, 9, 9], [False, False, True]), "feature 9 twice in one frame"),
        (step([(50, 1), (5, 2)], [7, 9], [True, False]), "feature 7 as new, which began before and has not ended"),
        (step([(50, 1)], [7], [False], [(9, TrackEnd.lost), (9, TrackEnd.lost)]), "feature 9 twice as ended"),
        (step([(50, 1)], [7], [False]), "1 feature alive, expected 2: all that began and are not among ended_ids"),
        (step([(np.nan, 1), (5, 2)], [7, 9], [False, False]), "feature 7 at a position that is not finite"),
        (step([(50, 1)], [7, 9], [False, False]), r"uv of shape \(1, 2\), expected \(2, 2\)"),
    ],
)
def test_a_step_that_contradicts_itself_or_earlier_ones_is_refused(wrong, message):
    recorder = Recorder()
    add(recorder, 0, step([(50, 1), (5, 2)], [7, 9], [True, True]))
    with pytest.raises(TrackerError, match=message):
        add(recorder, 1, wrong)


STEP_OF_TWO = step([(50, 1)], [7], [False], [(9, TrackEnd.lost)])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"offered": 1}, "1 feature offered, expected 2: all that were alive before"),
        ({"outliers": 2}, "2 outliers and 1 matched of 2 features"),
        ({"matched": 3}, "0 outliers and 3 matched of 2 features"),
        ({"matched": -1}, "0 outliers and -1 matched of 2 features"),
        ({"ended": np.int8([-1])}, "reason -1 why feature 9 ended, expected one of 0 .lost., 1"),
        ({"ended": np.int8([TrackEnd.sequence_end])}, "reason 4 why feature 9 ended"),
    ],
)
def test_a_step_whose_counts_or_reasons_are_impossible_is_refused(changes, message):
    recorder = Recorder()
    add(recorder, 0, step([(50, 1), (5, 2)], [7, 9], [True, True]))
    with pytest.raises(TrackerError, match=message):
        add(recorder, 1, replace(STEP_OF_TWO, **changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"ids": np.array([7.0])}, "ids of type float64, expected an array of whole numbers"),
        ({"uv": [[50, 1]]}, "uv of type list, expected an array of numbers"),
        ({"born": np.array([1])}, "born of type int64, expected an array of bool"),
        ({"response": None}, "response of type NoneType, expected an array of float"),
        ({"ended": np.array(["lost"])}, "ended of type <U4, expected an array of whole numbers"),
    ],
)
def test_a_step_with_arrays_of_other_types_is_refused(changes, message):
    with pytest.raises(TrackerError, match=message):
        Recorder().add(0, replace(step([(50, 1)], [7], [True]), **changes), gradient_rad=lambda uv: uv[:, 0])


def test_what_is_no_step_is_refused():
    with pytest.raises(TrackerError, match="a value of type NoneType, expected a Step"):
        Recorder().add(0, None, gradient_rad=lambda uv: uv[:, 0])
