import cv2
import numpy as np
import pytest

from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.detection import Detection
from tracknoise.trackers.lucas_kanade import LucasKanade, LucasKanadeTracker
from tracknoise.trackers.rejection import Model, ReferencePosition, Rejection
from tracknoise.trackers.tracker import Frame

FEW = {"min_features": 100, "max_features": 120}


def test_features_follow_the_image(sideways, setting):
    tracker = LucasKanade(**FEW).start(setting())
    first, *later = [tracker.step(frame) for frame in sideways]
    assert first.new == len(first.ids) == 120
    assert first.offered == 0
    start = dict(zip(first.ids.tolist(), first.uv, strict=True))
    for age, step in enumerate(later, 1):
        old = step.ids < 120
        moved = step.uv[old] - [start[i] for i in step.ids[old].tolist()]
        assert old.sum() > 90 - 3 * age
        assert np.abs(moved - (3 * age, -2 * age)).max() < 0.1


def test_the_strongest_keypoints_begin_features_and_are_not_near_each_other(sideways, setting):
    step = LucasKanade().start(setting()).step(sideways[0])
    assert (np.diff(step.response) <= 0).all()
    apart = np.abs(step.uv[:, None] - step.uv[None]).max(axis=2) + 100 * np.eye(len(step.uv))
    assert apart.min() >= 8
    assert (step.uv >= 8).all()
    assert (step.uv < np.array([320, 240]) - 8).all()


def test_detection_waits_until_fewer_than_the_minimum_are_left(sideways, setting):
    tracker = LucasKanade(min_features=1, max_features=120).start(setting())
    steps = [tracker.step(frame) for frame in sideways]
    assert [step.new for step in steps] == [120, 0, 0, 0, 0, 0]
    eager = LucasKanade(min_features=120, max_features=120).start(setting())
    steps = [eager.step(frame) for frame in sideways]
    assert all(step.alive == 120 for step in steps)
    assert sum(step.new for step in steps) > 120


def test_a_step_farther_than_allowed_is_displaced(sideways, setting):
    settings = LucasKanade(**FEW, max_displacement_px=3.5)  # the image moves by sqrt(13) px
    tracker = settings.start(setting())
    first, second = tracker.step(sideways[0]), tracker.step(sideways[1])
    ends = dict(zip(second.ended_ids.tolist(), second.ended.tolist(), strict=True))
    assert list(ends.values()).count(TrackEnd.displaced) > 110
    assert second.offered == len(first.ids)
    assert second.matched >= 110


def test_features_that_reach_the_margin_are_masked(sideways, setting):
    tracker = LucasKanade(detection=Detection(margin_px=40), **FEW).start(setting())
    first, second = tracker.step(sideways[0]), tracker.step(sideways[1])
    reached = first.uv + np.array([3, -2])
    leaves = first.ids[(reached[:, 0] > 280.1) | (reached[:, 1] < 39.9)]
    masked = second.ended_ids[second.ended == TrackEnd.masked]
    assert len(leaves) > 0
    assert np.isin(leaves, masked).all()


def test_of_two_features_that_meet_the_older_stays(setting):
    rng = np.random.default_rng(0)
    patch = rng.integers(0, 255, (9, 9)).astype(np.uint8)
    images = []
    for gap in (24, 21, 18, 15, 12, 9, 6):
        image = np.full((120, 120), 128, np.uint8)
        image[56:65, 40:49] = patch
        image[56:65, 40 + gap : 49 + gap] = patch.T
        images.append(cv2.GaussianBlur(image, (0, 0), 1))
    tracker = LucasKanade(rejection=Rejection(model=Model.none), min_features=1, max_features=2).start(
        setting(size=(120, 120))
    )
    steps = [tracker.step(Frame(k, image)) for k, image in enumerate(images)]
    ended = [(int(i), int(e)) for step in steps for i, e in zip(step.ended_ids, step.ended, strict=True)]
    assert (1, TrackEnd.masked) in ended
    assert 0 in steps[-1].ids


def test_what_moves_by_itself_is_an_outlier_and_its_place_is_not_taken_again_at_once(sideways, setting):
    frames = [frame.image.copy() for frame in sideways[:2]]
    frames[1][100:150, 100:150] = frames[0][100:150, 93:143]  # a patch that slides by 7 px
    tracker = LucasKanade(min_features=400, max_features=400).start(setting())
    first, second = (tracker.step(Frame(k, image)) for k, image in enumerate(frames))
    outliers = second.ended_ids[second.ended == TrackEnd.outlier]
    assert second.outliers == len(outliers) > 0
    rejected = first.uv[np.isin(first.ids, outliers)]
    new = second.uv[second.born]
    inside = rejected[((rejected > 110) & (rejected < 130)).all(axis=1)] + (7, 0)
    assert len(inside) > 0
    assert np.abs(new[:, None] - inside[None]).max(axis=2).min() >= 6


def test_the_rejection_is_given_the_first_positions_where_asked(sideways, setting):
    seen = {}
    for reference in ReferencePosition:
        calls = []

        def inliers(source, target, frame, calls=calls):
            calls.append((source, target))
            return np.ones(len(source), dtype=bool)

        tracker = LucasKanadeTracker(LucasKanade(rejection=Rejection(reference=reference), **FEW), inliers)
        for frame in sideways[:3]:
            tracker.step(frame)
        source, target = calls[-1]
        seen[reference] = np.median(target - source, axis=0)
    assert np.abs(seen[ReferencePosition.previous] - (3, -2)).max() < 0.1
    assert np.abs(seen[ReferencePosition.first] - (6, -4)).max() < 0.1


def test_after_a_black_frame_it_begins_again(sideways, setting):
    tracker = LucasKanade(**FEW).start(setting())
    tracker.step(sideways[0])
    black = tracker.step(Frame(1, np.zeros_like(sideways[0].image)))
    assert black.alive == len(black.ids)
    assert black.offered == 120
    again = tracker.step(sideways[2])
    assert again.offered == black.alive
    assert again.new > 0
    assert again.ids[again.born].min() >= 120


def test_it_does_what_the_sequential_definition_with_opencv_alone_does(sideways, setting):
    """Gate by gate with masks that are images, and nothing rejected."""
    tracker = LucasKanade(rejection=Rejection(model=Model.none), **FEW).start(setting())
    detector = cv2.xfeatures2d.AgastFeatureDetector.create(10, True, cv2.xfeatures2d.AgastFeatureDetector_OAST_9_16)
    points = np.empty((0, 2), np.float32)
    for before, frame in zip([None, *sideways], sideways, strict=False):
        mask = np.zeros(frame.image.shape, np.uint8)
        mask[8:-8, 8:-8] = 1
        kept = []
        if len(points):
            flow = cv2.calcOpticalFlowPyrLK(
                before.image, frame.image, points, points.copy(), winSize=(15, 15), maxLevel=4,
                criteria=(3, 30, 0.01), flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
            )  # fmt: skip
            for (u, v), old, found in zip(flow[0], points, flow[1][:, 0], strict=True):
                if found and np.hypot(*((u, v) - old)) < 64 and mask[int(v), int(u)]:
                    kept.append((u, v))
                    cv2.rectangle(mask, *square(u, v), 0, -1)
        if len(kept) < 100:
            for keypoint in sorted(detector.detect(frame.image), key=lambda point: -point.response):
                u, v = keypoint.pt
                if len(kept) < 120 and mask[int(v), int(u)]:
                    kept.append((u, v))
                    cv2.rectangle(mask, *square(u, v), 0, -1)
        points = np.array(kept, dtype=np.float32)
        assert tracker.step(frame).uv.tolist() == points.tolist()


def square(u: float, v: float) -> tuple[tuple[int, int], tuple[int, int]]:
    column, row = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
    return (column - 7, row - 7), (column + 7, row + 7)


@pytest.mark.parametrize(
    "wrong",
    [
        {"window_px": 2},
        {"start_at": "gyro"},
        {"template": "none"},
        {"order": "detection"},
        {"backward_px": 0.0},
        {"max_age": 0},
        {"extra_levels": -1},
        {"iterations": 0},
        {"epsilon": 0.0},
        {"max_features": 999},
        {"window_px": 1001},
        {"extra_levels": 17},
        {"max_features": 10**7},
    ],
)
def test_impossible_settings_are_refused_by_name(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        LucasKanade(**wrong)


def structure_tensor(image: np.ndarray, u: int, v: int, side: int) -> np.ndarray:
    """Mean of g g^T over a window around a pixel, with Scharr derivatives in gray values per pixel."""
    half = side // 2
    window = slice(v - half, v + half + 1), slice(u - half, u + half + 1)
    du, dv = (cv2.Scharr(image, cv2.CV_64F, *axis)[window].ravel() / 32 for axis in ((1, 0), (0, 1)))
    return np.array([[du @ du, du @ dv], [du @ dv, dv @ dv]]) / du.size


def test_the_eigenvalue_is_that_of_the_patch_in_the_previous_image(sideways, setting):
    tracker = LucasKanade(**FEW).start(setting())
    first, second = (tracker.step(frame) for frame in sideways[:2])
    assert np.isnan(first.quality["lk_min_eigenvalue"]).all()
    found = ~second.born
    start = dict(zip(first.ids.tolist(), first.uv.astype(int).tolist(), strict=True))
    image = sideways[0].image
    expected = [np.linalg.eigvalsh(structure_tensor(image, *start[i], 15))[0] for i in second.ids[found].tolist()]
    np.testing.assert_allclose(second.quality["lk_min_eigenvalue"][found], expected, rtol=1e-3)
    assert np.isnan(second.quality["lk_min_eigenvalue"][second.born]).all()


def test_the_residual_is_the_mean_difference_of_gray_values(sideways, setting):
    """An image that gets brighter by 3 and does not move has a residual of 3, less what a small shift takes off."""
    image = np.clip(sideways[0].image, 0, 250)
    tracker = LucasKanade(rejection=Rejection(model=Model.none), **FEW).start(setting())
    tracker.step(Frame(0, image))
    same, brighter = tracker.step(Frame(1, image)), tracker.step(Frame(2, image + 3))
    assert np.nanmax(same.quality["lk_residual"]) == 0
    assert 2.7 < np.nanmedian(brighter.quality["lk_residual"]) <= 3.0
    assert np.isnan(brighter.quality["lk_residual"][brighter.born]).all()


@pytest.mark.parametrize("noise", [2.0, 6.0])
def test_the_covariance_is_that_of_the_errors_that_noise_of_gray_values_makes(sideways, setting, noise):
    rng = np.random.default_rng(5)
    frames = [
        Frame(one.index, np.clip(one.image + noise * rng.standard_normal(one.image.shape), 0, 255).astype(np.uint8))
        for one in sideways[:2]
    ]
    tracker = LucasKanade(covariance=True).start(setting())
    first, second = (tracker.step(frame) for frame in frames)
    rows = np.flatnonzero(np.isin(second.ids, first.ids))
    start = first.uv[np.searchsorted(first.ids, second.ids[rows])]
    error = second.uv[rows] - start - np.array([3.0, -2.0])
    uu, uv, vv = (second.quality[f"lk_cov_{name}"][rows].astype(float) for name in ("uu", "uv", "vv"))
    near = np.hypot(*error.T) < 1.0
    squared = (vv * error[:, 0] ** 2 - 2 * uv * error[:, 0] * error[:, 1] + uu * error[:, 1] ** 2) / (uu * vv - uv**2)
    known = near & np.isfinite(squared)
    assert known.sum() > 100
    assert 0.5 * np.median(squared[known]) == pytest.approx(np.log(2.0), rel=0.5)  # chi square, two degrees of freedom
