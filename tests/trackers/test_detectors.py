import cv2
import numpy as np
import pytest

from tracknoise.trackers.correspondence import Correspondence, Descriptor, describe
from tracknoise.trackers.detection import Detection, Detector, keypoints
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.trackers.matching import mutual_nearest
from tracknoise.trackers.rejection import Rejection
from tracknoise.trackers.tracker import Frame
from tracknoise.trackers.tracker_registry import make_tracker

EVERY = list(Detector)
DESCRIPTORS = [one for one in Descriptor if one is not Descriptor.network]
FEW = {one: {"threshold": 40} for one in (Detector.agast, Detector.fast, Detector.orb)}
"""Settings of detectors that would find thousands of keypoints, whose matches take a second."""
PAIRS = [(detector, descriptor) for detector in EVERY for descriptor in DESCRIPTORS]


@pytest.mark.parametrize("detector", EVERY)
def test_every_detector_finds_keypoints_strongest_first(sideways, detector):
    points = keypoints(Frame(0, sideways[0].image), Detection(detector=detector))
    assert len(points.uv) > 50
    assert (np.diff(points.response) <= 0).all()
    width, height = sideways[0].size
    assert ((points.uv >= 0) & (points.uv <= (width - 1, height - 1))).all()


def test_detectors_do_not_share_keypoints(sideways):
    frame = Frame(0, sideways[0].image)
    found = [keypoints(frame, Detection(detector=detector)).uv.tolist() for detector in EVERY]
    assert all(a != b for place, a in enumerate(found) for b in found[place + 1 :])


@pytest.mark.parametrize(
    ("detector", "stricter"),
    [
        (Detector.agast, {"threshold": 40}),
        (Detector.fast, {"threshold": 40}),
        (Detector.fast, {"min_response": 40.0}),
        (Detector.gftt, {"quality": 0.3}),
        (Detector.orb, {"threshold": 40}),
        (Detector.sift, {"contrast": 0.1}),
    ],
)
def test_stricter_thresholds_leave_fewer_keypoints(sideways, detector, stricter):
    frame = Frame(0, sideways[0].image)
    every, some = (keypoints(frame, Detection(detector=detector, **options)) for options in ({}, stricter))
    assert 0 < len(some.uv) < len(every.uv)


def test_keypoints_of_gftt_and_sift_need_no_score_in_gray_values(sideways):
    frame = Frame(0, sideways[0].image)
    for detector in (Detector.gftt, Detector.sift):
        points = keypoints(frame, Detection(detector=detector, min_response=100.0))
        assert len(points.uv) > 50
        assert points.response.max() < 1


@pytest.mark.parametrize("centre", [(31.0, 27.0), (40.0, 33.0)])
def test_sift_finds_a_blob_at_its_centre_without_bias(centre):
    v, u = np.mgrid[:64, :80]
    image = (40 + 180 * np.exp(-((u - centre[0]) ** 2 + (v - centre[1]) ** 2) / 18)).round().astype(np.uint8)
    points = keypoints(Frame(0, image), Detection(detector=Detector.sift))
    nearest = points.uv[np.linalg.norm(points.uv - centre, axis=1).argmin()]
    assert np.abs(nearest - centre).max() < 0.05


@pytest.mark.parametrize("shape", [(1, 1), (6, 6), (7, 7), (16, 16), (40, 9)])
def test_tiny_images_do_not_fail(shape):
    image = np.random.default_rng(0).integers(0, 255, shape).astype(np.uint8)
    for detector, descriptor in PAIRS:
        described = describe(Frame(0, image), Detection(detector=detector), descriptor)
        assert described.descriptors.shape == (len(described.uv), descriptor.size), (detector, descriptor)


@pytest.mark.parametrize(("detector", "descriptor"), PAIRS)
def test_matches_of_every_descriptor_follow_the_image(sideways, detector, descriptor):
    detection = Detection(detector=detector, **FEW.get(detector, {}))
    before, after = (
        describe(Frame(frame.index, frame.image[:180, :240].copy()), detection, descriptor) for frame in sideways[:2]
    )
    assert (np.diff(before.response) <= 0).all()
    matches = mutual_nearest(before.descriptors, after.descriptors)
    moved = after.uv[matches.train_rows] - before.uv[matches.query_rows]
    assert len(moved) > 40
    assert np.median(np.abs(moved - (3, -2)).max(axis=1)) < 0.5


@pytest.mark.parametrize("descriptor", [one for one in DESCRIPTORS if one is not Descriptor.sift])
def test_matches_of_bits_are_those_of_the_hamming_distance(sideways, descriptor):
    before, after = (describe(frame, Detection(), descriptor).descriptors for frame in sideways[:2])
    assert set(np.unique(before)) == {0.0, 1.0}
    packed = [np.packbits(bits.astype(np.uint8), axis=1) for bits in (before, after)]
    expected = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(*packed)
    found = mutual_nearest(before, after)
    assert sorted((one.queryIdx, one.trainIdx) for one in expected) == list(
        zip(found.query_rows.tolist(), found.train_rows.tolist(), strict=True)
    )
    distances = {one.queryIdx: one.distance for one in expected}
    np.testing.assert_allclose(
        found.quality["descriptor_distance"] ** 2, [distances[row] for row in found.query_rows.tolist()], rtol=1e-6
    )


def test_the_default_keypoints_are_described_exactly_as_they_were_detected(sideways):
    frame = Frame(0, sideways[0].image)
    points = keypoints(frame, Detection())
    _, expected = cv2.SIFT.create().compute(frame.image, [points.raw[row] for row in points.order.tolist()])
    assert (describe(frame, Detection()).descriptors == expected).all()


def test_sift_describes_its_own_keypoints_with_their_size_and_direction(sideways):
    frame = Frame(0, sideways[0].image)
    points = keypoints(frame, Detection(detector=Detector.sift))
    raw = [points.raw[row] for row in points.order.tolist()]
    whole = cv2.SIFT.create(contrastThreshold=Detection().contrast, enable_precise_upscale=True)
    detected, described = whole.detectAndCompute(frame.image, None)
    expected = described[np.argsort([-one.response for one in detected], kind="stable")]
    found = describe(frame, Detection(detector=Detector.sift)).descriptors
    assert (found == expected).all()
    upright = [cv2.KeyPoint(*one.pt, 7.0) for one in raw]
    assert (cv2.SIFT.create().compute(frame.image, upright)[1] != expected).any()


@pytest.mark.parametrize("detector", EVERY)
def test_both_trackers_follow_the_image_with_every_detector(sideways, setting, detector):
    for kind in (LucasKanade, Correspondence):
        settings = kind(detection=Detection(detector=detector, **FEW.get(detector, {})), rejection=Rejection(seed=1))
        tracker = settings.start(setting())
        steps = [tracker.step(Frame(frame.index, frame.image)) for frame in sideways[:3]]
        start = dict(zip(steps[0].ids.tolist(), steps[0].uv, strict=True))
        old = np.isin(steps[2].ids, steps[0].ids)
        moved = steps[2].uv[old] - [start[i] for i in steps[2].ids[old].tolist()]
        assert old.sum() > 20
        assert np.median(np.abs(moved - (6, -4)).max(axis=1)) < 0.3


def test_a_blank_image_has_no_matches_with_any_descriptor(sideways, setting):
    blank = np.zeros_like(sideways[0].image)
    for descriptor in DESCRIPTORS:
        tracker = Correspondence(descriptor=descriptor).start(setting())
        tracker.step(sideways[0])
        step = tracker.step(Frame(1, blank))
        assert step.matched == 0


def test_experiment_files_name_detector_and_descriptor():
    made = make_tracker("correspondence", {"detection": {"detector": "gftt"}, "descriptor": "brisk"})
    assert made == Correspondence(detection=Detection(detector=Detector.gftt), descriptor=Descriptor.brisk)


def test_an_unknown_descriptor_is_refused_by_name():
    with pytest.raises(ValueError, match="descriptor is 'surf', expected one of sift, orb, brisk"):
        Correspondence(descriptor="surf")


ON_REAL_IMAGES = [
    *(LucasKanade(detection=Detection(detector=one)) for one in EVERY),
    *(Correspondence(detection=Detection(detector=one)) for one in EVERY),
    *(Correspondence(descriptor=one) for one in DESCRIPTORS),
]
"""Every detector and every descriptor. All pairs of them follow the image of a simulated world above."""


@pytest.mark.parametrize("settings", ON_REAL_IMAGES)
def test_every_detector_and_descriptor_works_on_real_images(sevenscenes_frames, setting, settings):
    tracker = settings.start(setting(size=sevenscenes_frames[0].size))
    steps = [tracker.step(frame) for frame in sevenscenes_frames]
    followed = np.isin(steps[-1].ids, steps[0].ids)
    assert followed.sum() > 25
    assert np.isfinite(steps[-1].uv).all()


@pytest.fixture(scope="module")
def sevenscenes_frames(sample):
    paths = sorted((sample("sevenscenes") / "seq-01").glob("*.color.jpg"))[:3]
    return [Frame(k, cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)) for k, path in enumerate(paths)]
