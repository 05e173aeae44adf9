import numpy as np
import pytest

from tracknoise.trackers.correspondence import describe
from tracknoise.trackers.detection import Detection, keypoints
from tracknoise.trackers.tracker import Frame


def test_keypoints_are_sorted_strongest_first_and_computed_once(sideways):
    frame = Frame(0, sideways[0].image)
    points = keypoints(frame, Detection())
    assert len(points.uv) > 300
    assert (np.diff(points.response) <= 0).all()
    assert keypoints(frame, Detection(square_px=3, margin_px=0)) is points
    assert keypoints(frame, Detection(threshold=40)) is not points


def test_equally_strong_keypoints_stay_in_the_order_of_detection(sideways):
    points = keypoints(Frame(0, sideways[0].image), Detection())
    tied = np.diff(points.response) == 0
    assert tied.any()
    assert (np.diff(points.order)[tied] > 0).all()


def test_weak_responses_are_refused(sideways):
    frame = Frame(0, sideways[0].image)
    strong = keypoints(frame, Detection(min_response=30))
    assert 0 < len(strong.uv) < len(keypoints(frame, Detection()).uv)
    assert strong.response.min() >= 30


def test_a_dot_is_found_at_the_centre_of_its_pixel():
    image = np.zeros((60, 60), np.uint8)
    image[30, 25] = 200
    assert keypoints(Frame(0, image), Detection()).uv.tolist() == [[25.0, 30.0]]


@pytest.mark.parametrize("shape", [(1, 1), (3, 50), (6, 6), (7, 7), (16, 16)])
def test_tiny_images_have_keypoints_and_descriptors_without_failing(shape):
    image = np.random.default_rng(0).integers(0, 255, shape).astype(np.uint8)
    described = describe(Frame(0, image), Detection())
    assert described.descriptors.shape == (len(described.uv), 128)


def test_descriptors_belong_to_the_keypoints_in_order(sideways):
    frame = Frame(0, sideways[0].image)
    points, described = keypoints(frame, Detection()), describe(frame, Detection())
    assert described.uv.tolist() == points.uv.tolist()
    assert described.response.tolist() == points.response.tolist()
    assert (described.descriptors == np.round(described.descriptors)).all()
    assert describe(frame, Detection()) is described


@pytest.mark.parametrize("wrong", [{"threshold": 0}, {"square_px": 4}, {"margin_px": -1}, {"min_response": np.nan}])
def test_impossible_settings_are_refused_by_name(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Detection(**wrong)


@pytest.mark.parametrize("wrong", [{"quality": 0.0}, {"contrast": 1.0}, {"detector": "harris"}])
def test_impossible_detectors_are_refused_by_name(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Detection(**wrong)
