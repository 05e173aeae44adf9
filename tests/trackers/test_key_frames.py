"""What trackers do in key frames only: new features, rejection of outliers, templates."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from tests.trackers.conftest import textured

from tracknoise.exceptions import SettingsError
from tracknoise.trackers.aligned_patches import AlignedPatches
from tracknoise.trackers.correspondence import Correspondence
from tracknoise.trackers.dense_flow import DenseFlow
from tracknoise.trackers.features import Features
from tracknoise.trackers.following import Order
from tracknoise.trackers.function import Function
from tracknoise.trackers.key_frames import KeyFrames, Occasion, Renewal, Template
from tracknoise.trackers.lucas_kanade import LucasKanade, LucasKanadeTracker
from tracknoise.trackers.rejection import Model, ReferencePosition, Rejection
from tracknoise.trackers.tracker import Frame, Step
from tracknoise.trackers.tracker_registry import make_tracker

SIZE = (320, 240)
KINDS = [LucasKanade, AlignedPatches, DenseFlow]
BY_TIME = {"keyframe_share": 1e-6, "keyframe_every": 3}
EVERY_STEP = {"min_features": 120, "max_features": 120, **BY_TIME}
STRICT = Rejection(threshold_px=0.01)
"""Noise alone makes outliers."""


@pytest.fixture(scope="module")
def noisy() -> list[Frame]:
    """A texture that slides by (11, 4) px a frame, so that features leave the image, with noise."""
    texture, rng = textured(560, 400), np.random.default_rng(1)
    shown = [texture[10 + 4 * k :, 10 + 11 * k :][: SIZE[1], : SIZE[0]] for k in range(10)]
    return [
        Frame(k, np.clip(one + rng.normal(0, 3, one.shape), 0, 255).astype(np.uint8)) for k, one in enumerate(shown)
    ]


def run(settings, frames: list[Frame], context) -> list[Step]:
    tracker = settings.start(context)
    return [tracker.step(frame) for frame in frames]


def frames_with(counts: list[int]) -> list[int]:
    return np.flatnonzero(counts).tolist()


def features(ids: Sequence[int]) -> Features:
    """Features whose positions are their ids."""
    found = Features.begin(0, np.repeat(np.array(ids, dtype=np.float64), 2).reshape(-1, 2))
    return replace(found, ids=np.array(ids, dtype=np.int64))


def test_a_key_frame_is_due_once_few_features_of_the_last_are_left_or_it_is_old():
    by_share, by_time = KeyFrames(0.5), KeyFrames(1e-6, every=4)
    alive = [range(0), range(4), range(1, 5), range(2, 6), range(3, 7), range(3, 7)]
    due = {}
    for name, frames in (("share", by_share), ("time", by_time)):
        due[name] = []
        for number, ids in enumerate(alive):
            index = 2 * number
            old = np.array([i for i in ids if number > 0 and i in alive[number - 1]], dtype=np.int64)
            if frames.decide(index, old):
                due[name].append(index)
            frames.complete(index, features(ids))
    assert due["share"] == [0, 2, 8]  # without features, the next image is one too
    assert due["time"] == [0, 2, 6, 10]


def test_all_templates_are_renewed_in_a_key_frame():
    frames = KeyFrames(0.5)
    renewal = Renewal(Template.keyframe, frames)
    rows = []
    for index, (old, ids) in enumerate(
        [([], [0, 1, 2, 3]), ([1, 2, 3], [1, 2, 3, 4]), ([3, 4], [3, 4, 5]), ([4, 5], [4, 5])]
    ):
        frames.decide(index, np.array(old, dtype=np.int64))
        frames.complete(index, features(ids))
        rows.append(renewal.rows(np.array(ids), index).tolist())
    assert rows == [[-1] * 4, [1, 2, 3, -1], [-1] * 3, [1, 2]]


@pytest.mark.parametrize("kind", KINDS)
def test_new_features_are_detected_in_key_frames_only(noisy, setting, kind):
    settings = kind(rejection=Rejection(model=Model.none), **EVERY_STEP)
    always = run(settings, noisy, setting(SIZE))
    seldom = run(replace(settings, detect_at="keyframes"), noisy, setting(SIZE))
    assert frames_with([step.new for step in always]) == list(range(10))
    assert frames_with([step.new for step in seldom]) == [0, 3, 6, 9]
    assert seldom[3].alive == 120


@pytest.mark.parametrize("kind", KINDS)
def test_outliers_are_rejected_in_key_frames_only(noisy, setting, kind):
    settings = kind(rejection=STRICT, **EVERY_STEP)
    always = run(settings, noisy, setting(SIZE))
    seldom = run(replace(settings, reject_at="keyframes"), noisy, setting(SIZE))
    assert frames_with([step.outliers for step in always]) == list(range(1, 10))
    assert frames_with([step.outliers for step in seldom]) == [3, 6, 9]


@pytest.mark.parametrize("order", Order)
@pytest.mark.parametrize("by", [{"keyframe_share": 0.85}, BY_TIME])
def test_detection_rejection_and_templates_have_the_same_key_frames(noisy, setting, order, by):
    """Where features are detected in the previous image, those of a key frame are reported one step later."""
    asked: list[int] = []

    def inliers(source, target, frame):
        asked.append(frame)
        return np.ones(len(source), dtype=np.bool_)

    options = {"min_features": 120, "max_features": 120, "order": order, "detect_at": "keyframes", **by}
    settings = LucasKanade(reject_at="keyframes", template="keyframe", **options)
    tracker = LucasKanadeTracker(settings, inliers)
    steps = [tracker.step(frame) for frame in noisy]
    late = 1 if order is Order.detection_first else 0
    born = frames_with([step.new for step in steps[1:]])
    assert [frame + late for frame in asked if 0 < frame < 10 - late] == [frame + 1 for frame in born][late:]
    assert 3 <= len(asked) <= 5
    first = LucasKanadeTracker(replace(settings, template="first"), inliers)
    same = [step.uv.tolist() == first.step(frame).uv.tolist() for step, frame in zip(steps, noisy, strict=True)]
    assert same.index(False) == asked[1] + 1  # followed from the second key frame, with its templates


@pytest.mark.parametrize("order", Order)
@pytest.mark.parametrize("reject_at", Occasion)
def test_positions_in_the_last_key_frame_can_be_compared(noisy, setting, order, reject_at):
    """Features move by (-11, -4) px a frame. Those that began since the key frame are not compared."""
    asked = {}

    def inliers(source, target, frame):
        asked[frame] = source, target
        return np.zeros(len(source), dtype=np.bool_) if frame == 9 else np.ones(len(source), dtype=np.bool_)

    options = {"min_features": 120, "max_features": 120, "order": order, "reject_at": reject_at, **BY_TIME}
    settings = LucasKanade(rejection=Rejection(reference=ReferencePosition.keyframe), **options)
    tracker = LucasKanadeTracker(settings, inliers)
    steps = [tracker.step(frame) for frame in noisy]
    compared = {frame: pair for frame, pair in asked.items() if len(pair[0])}
    expected = range(1, 10) if reject_at is Occasion.every_frame else (3, 6, 9)
    assert sorted(compared) == [*expected]
    for frame, (source, target) in compared.items():
        since = (frame - 1) % 3 + 1
        assert np.abs(np.median(target - source, axis=0) - since * np.array([-11, -4])).max() < 0.1
    assert steps[9].outliers == len(compared[9][0]) < steps[9].matched


def test_key_frames_are_so_many_frames_of_the_nominal_sequence_apart(noisy, setting):
    settings = LucasKanade(detect_at="keyframes", **EVERY_STEP | {"keyframe_every": 4})
    steps = run(settings, noisy[::2], setting(SIZE, speed=2))
    assert frames_with([step.new for step in steps]) == [0, 2, 4]


def test_a_function_can_be_topped_up_in_key_frames(noisy, setting):
    def slide(previous, image, points):
        return points - (11, 4), np.ones(len(points), dtype=bool)

    steps = run(Function(slide, detect_at="keyframes", **EVERY_STEP), noisy, setting(SIZE))
    assert frames_with([step.new for step in steps]) == [0, 3, 6, 9]


def test_after_a_black_image_features_are_detected_at_once(noisy, setting):
    frames = [*noisy[:4], Frame(4, np.zeros(SIZE[::-1], np.uint8)), *noisy[5:7]]
    settings = LucasKanade(min_ncc=0.5, detect_at="keyframes", **EVERY_STEP | {"keyframe_every": 100})
    steps = run(settings, frames, setting(SIZE))
    assert frames_with([step.new for step in steps]) == [0, 5]


def test_settings_of_key_frames_have_names_and_bounds():
    made = make_tracker("dense-flow", {"detect_at": "keyframes", "keyframe_every": 2})
    assert (made.detect_at, made.reject_at) == (Occasion.keyframes, Occasion.every_frame)
    for options, message in (
        ({"detect_at": "often"}, "detect_at"),
        ({"reject_at": "never"}, "reject_at"),
        ({"keyframe_every": 0}, "keyframe_every is 0, expected a number not below 1"),
    ):
        for kind in ("lucas-kanade", "patch", "dense-flow"):
            with pytest.raises(SettingsError, match=message):
                make_tracker(kind, options)
    with pytest.raises(ValueError, match=r"rejection.reference is 'keyframe', expected previous or first"):
        Correspondence(rejection=Rejection(reference="keyframe"))
