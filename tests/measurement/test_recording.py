"""A recorder fed by hand: numbering, ends, found counts and visibility."""

import numpy as np
import pytest

from tracknoise.exceptions import TrackerError
from tracknoise.measurement.recording import Recorder
from tracknoise.tables.schema import TrackEnd, TruthStatus
from tracknoise.trackers.tracker import Step


class FlatTruth:
    """Anchors every feature one metre away, but for those left of u = 10, which have no depth; u > 90 is occluded."""

    key_frame: int | None = None

    def anchor(self, index, uv):
        status = np.where(uv[:, 0] < 10, TruthStatus.no_depth, TruthStatus.valid).astype(np.int8)
        points = np.column_stack([uv, np.ones(len(uv))])
        points[status != TruthStatus.valid] = np.nan
        return points, status

    def visibility(self, index, points):
        return np.where(points[:, 0] > 90, TruthStatus.occluded, TruthStatus.valid).astype(np.int8)


def step(uv, ids, born, ended=()):
    return Step(
        ids=np.array(ids, np.int64),
        uv=np.array(uv, float).reshape(-1, 2),
        born=np.array(born, bool),
        response=np.arange(len(ids), dtype=np.float32),
        ended_ids=np.array([i for i, _ in ended], np.int64),
        ended=np.array([reason for _, reason in ended], np.int8),
        offered=0,
        matched=0,
        outliers=0,
        alive=len(ids),
    )


def add(recorder, index, one):
    """Record a step whose features have their own place for a gradient."""
    recorder.add(index, one, gradient_rad=one.uv[one.born, 0].astype(np.float32))


@pytest.fixture
def recording():
    recorder = Recorder(FlatTruth())
    add(recorder, 0, step([(50, 1), (5, 2), (95, 3)], [70, 30, 50], [True, True, True]))
    add(recorder, 2, step([(52, 1), (96, 3)], [70, 50], [False, False], [(30, TrackEnd.lost)]))
    add(recorder, 4, step([(97, 3), (20, 9)], [50, 10], [False, True], [(70, TrackEnd.outlier)]))
    return recorder.finish()


def test_tracks_are_numbered_in_the_order_of_birth_whatever_their_ids(recording):
    assert recording.track.tolist() == [0, 1, 2, 0, 2, 2, 3]
    assert recording.frame.tolist() == [0, 0, 0, 2, 2, 4, 4]
    assert recording.first_frame.tolist() == [0, 0, 0, 4]


def test_lifetime_counts_frames_found_and_survivors_end_with_the_sequence(recording):
    assert recording.found.tolist() == [2, 1, 3, 1]
    assert recording.end.tolist() == [TrackEnd.outlier, TrackEnd.lost, TrackEnd.sequence_end, TrackEnd.sequence_end]


def test_status_is_the_anchors_or_else_the_visibility_in_that_frame(recording):
    valid, no_depth, occluded = TruthStatus.valid, TruthStatus.no_depth, TruthStatus.occluded
    assert recording.visibility.tolist() == [valid, no_depth, occluded, valid, occluded, occluded, valid]


def test_responses_gradients_and_points_belong_to_their_tracks(recording):
    assert recording.response.tolist() == [0, 1, 2, 1]
    assert recording.gradient_rad.tolist() == [50, 5, 95, 20]
    assert recording.points_world[3].tolist() == [20, 9, 1]
    assert np.isnan(recording.points_world[1]).all()


def test_a_tracker_that_reports_an_unknown_feature_is_refused():
    recorder = Recorder(FlatTruth())
    add(recorder, 0, step([(50, 1)], [7], [True]))
    with pytest.raises(TrackerError, match="feature 8"):
        add(recorder, 1, step([(50, 1)], [8], [False]))


class KeyFrame(FlatTruth):
    """As `FlatTruth`, but anchors only in frame 2."""

    key_frame = 2


def test_in_a_key_frame_what_is_found_there_is_anchored_and_looked_at_again():
    recorder = Recorder(KeyFrame())
    add(recorder, 0, step([(50, 1), (60, 2), (95, 3)], [70, 30, 50], [True, True, True]))
    add(recorder, 2, step([(52, 1), (96, 3), (5, 5)], [70, 50, 90], [False, False, True], [(30, TrackEnd.lost)]))
    add(recorder, 4, step([(53, 1), (97, 3), (20, 9)], [70, 50, 10], [False, False, True], [(90, TrackEnd.lost)]))
    recording = recorder.finish()
    valid, none, hidden = TruthStatus.valid, TruthStatus.no_depth, TruthStatus.occluded
    assert recording.track.tolist() == [0, 1, 2, 0, 2, 3, 0, 2, 4]
    assert recording.visibility.tolist() == [valid, none, hidden, valid, hidden, none, valid, hidden, none]
    np.testing.assert_array_equal(np.isfinite(recording.points_world).all(axis=1), [True, False, True, False, False])
    np.testing.assert_array_equal(recording.points_world[[0, 2]], [[52, 1, 1], [96, 3, 1]])
