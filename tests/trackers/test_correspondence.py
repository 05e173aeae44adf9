import numpy as np
import pytest

from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.correspondence import Correspondence, describe
from tracknoise.trackers.detection import Detection
from tracknoise.trackers.rejection import Model, Rejection
from tracknoise.trackers.tracker import Frame

NO_REJECTION = Rejection(model=Model.none)


@pytest.fixture
def black(sideways):
    return Frame(1, np.zeros_like(sideways[0].image))


def test_features_follow_the_image(sideways, setting):
    tracker = Correspondence(max_features=200).start(setting())
    steps = [tracker.step(frame) for frame in sideways[:4]]
    start = dict(zip(steps[0].ids.tolist(), steps[0].uv, strict=True))
    old = np.isin(steps[3].ids, steps[0].ids)
    moved = steps[3].uv[old] - [start[i] for i in steps[3].ids[old].tolist()]
    assert old.sum() > 100
    assert np.abs(moved - (9, -6)).max() <= 2
    assert (np.median(moved, axis=0) == (9, -6)).all()


def test_the_strongest_unmatched_keypoints_fill_up_anywhere_in_the_image(sideways, setting):
    tracker = Correspondence(rejection=NO_REJECTION, max_features=150).start(setting())
    points = [describe(frame, Detection()) for frame in sideways[:2]]
    first, second = (tracker.step(frame) for frame in sideways[:2])
    assert first.uv.tolist() == points[0].uv[:150].tolist()
    assert second.alive == 150
    continued = {tuple(uv) for uv in second.uv[~second.born].tolist()}
    free = [uv for uv in points[1].uv.tolist() if tuple(uv) not in continued]
    assert second.uv[second.born].tolist() == free[: second.new]


def test_a_match_too_far_away_is_displaced(sideways, setting):
    tracker = Correspondence(rejection=NO_REJECTION, max_features=150, max_displacement_px=3.5).start(setting())
    tracker.step(sideways[0])
    step = tracker.step(sideways[1])
    assert step.matched > 100
    assert (step.ended == TrackEnd.displaced).sum() > 0.9 * step.matched
    assert set(step.ended.tolist()) <= {TrackEnd.displaced, TrackEnd.lost}
    assert step.outliers == 0


def test_a_feature_not_found_is_lost_at_once(sideways, black, setting):
    tracker = Correspondence(max_features=150).start(setting())
    tracker.step(sideways[0])
    step = tracker.step(black)
    assert step.offered == 150
    assert (step.ended == TrackEnd.lost).sum() == 150
    assert step.alive == step.matched == 0


def test_a_missed_feature_is_sought_for_as_many_frames_as_asked(sideways, black, setting):
    tracker = Correspondence(max_features=150, max_missed_frames=2).start(setting())
    first = tracker.step(sideways[0])
    for _ in range(2):
        unseen = tracker.step(black)
        assert len(unseen.ids) == len(unseen.ended_ids) == unseen.matched == 0
        assert unseen.offered == unseen.alive == 150
    again = tracker.step(sideways[1])
    assert np.isin(again.ids[~again.born], first.ids).all()
    assert (~again.born).sum() > 100
    assert again.alive <= 150
    for _ in range(2):
        tracker.step(black)
    over = tracker.step(black)
    assert over.alive == 0
    assert (over.ended == TrackEnd.lost).all()
    assert len(over.ended_ids) == over.offered > 0


def test_the_descriptor_is_that_of_the_first_frame(sideways, setting):
    tracker = Correspondence(rejection=NO_REJECTION, max_features=100).start(setting())
    own = describe(sideways[0], Detection()).descriptors[:100]
    steps = [tracker.step(frame) for frame in sideways[:3]]
    survivors = np.flatnonzero(np.isin(np.arange(100), steps[2].ids))
    points = describe(sideways[2], Detection())
    for row in survivors[:20].tolist():
        nearest = np.argmin(((points.descriptors - own[row]) ** 2).sum(axis=1))
        assert points.uv[nearest].tolist() == steps[2].uv[steps[2].ids == row][0].tolist()


def test_what_moves_by_itself_is_an_outlier(sideways, setting):
    frames = [frame.image.copy() for frame in sideways[:2]]
    frames[1][80:160, 80:160] = frames[0][80:160, 70:150]
    tracker = Correspondence(max_features=600).start(setting())
    first, second = (tracker.step(Frame(k, image)) for k, image in enumerate(frames))
    outliers = first.uv[np.isin(first.ids, second.ended_ids[second.ended == TrackEnd.outlier])]
    assert second.outliers == len(outliers) > 5
    assert np.mean(((outliers > 65) & (outliers < 165)).all(axis=1)) > 0.5


@pytest.mark.parametrize("wrong", [{"max_displacement_px": 0.0}, {"max_features": 0}, {"max_missed_frames": -1}])
def test_impossible_settings_are_refused_by_name(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Correspondence(**wrong)


def test_quality_is_the_distance_to_the_first_descriptor_and_its_ratio_to_the_second_best(sideways, setting):
    tracker = Correspondence(rejection=NO_REJECTION, max_features=150).start(setting())
    first, second = (tracker.step(frame) for frame in sideways[:2])
    before, after = (describe(frame, Detection()) for frame in sideways[:2])
    assert np.isnan(first.quality["descriptor_distance"]).all()
    found = np.flatnonzero(~second.born)
    assert len(found) > 50
    for row in found.tolist():
        own = before.descriptors[np.flatnonzero((before.uv == first.uv[first.ids == second.ids[row]]).all(axis=1))[:1]]
        distances = np.sort(np.linalg.norm(after.descriptors - own, axis=1))
        assert second.quality["descriptor_distance"][row] == pytest.approx(distances[0], rel=1e-5)
        assert second.quality["descriptor_ratio"][row] == pytest.approx(distances[0] / distances[1], rel=1e-5)
    assert np.isnan(second.quality["descriptor_ratio"][second.born]).all()
