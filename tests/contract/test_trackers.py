"""What every registered tracker must do."""

import pickle
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import polars as pl
import pytest
from tests.trackers.networks import keypoint_network, match_network, require_onnx

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.stereo_pair import StereoPair
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import QUALITY_NAME, TrackEnd, TruthStatus
from tracknoise.trackers.tracker import Frame, SequenceContext, Step, TrackerSettings
from tracknoise.trackers.tracker_registry import TRACKERS, make_tracker

FOLLOW_POINTS = Path(__file__).parents[1] / "foreign" / "follow_points.py"
SIZE = (200, 160)
FRAMES = 8
BESIDE = np.eye(4)
BESIDE[0, 3] = 0.1


class Still:
    """True positions that never move."""

    def anchor(self, index: int, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.column_stack([uv, np.ones(len(uv))]), np.full(len(uv), TruthStatus.valid, dtype=np.int8)

    def project(self, index: int, points_world: np.ndarray) -> np.ndarray:
        return points_world[:, :2].copy()


VARIANTS: dict[str, tuple[str, dict[str, object]]] = {
    "lucas-kanade of key frames": ("lucas-kanade", {"template": "keyframe", "min_ncc": 0.5, "backward_px": 1.0}),
    "lucas-kanade topped up in key frames": (
        "lucas-kanade",
        {"order": "rejection-first", "detect_at": "keyframes", "reject_at": "keyframes", "keyframe_every": 3},
    ),
    "lucas-kanade along rays": ("lucas-kanade", {"start_at": "rotation", "rejection": {"model": "two-point"}}),
    "patch of the previous frame": ("patch", {"template": "previous", "warp": "se2", "brightness": "gain"}),
    "patch of few matches": ("patch", {"detection": {"spacing": "anms"}, "rejection": {"model": "five-point"}}),
    "correspondence of akaze": (
        "correspondence",
        {
            "detection": {"detector": "akaze"},
            "descriptor": "akaze",
            "grid_statistics": True,
            "rejection": {"model": "seven-point"},
        },
    ),
    "features along epipolar lines": ("second-view", {"search": "line"}),
    "features of the last second image": ("second-view", {"search": "last"}),
    "patches of the last second image": ("second-view", {"search": "last", "method": "patch"}),
    "features by descriptors in a second image": ("second-view", {"search": "descriptor"}),
    "correspondence of networks": ("correspondence", {"descriptor": "network", "rejection": {"model": "none"}}),
}
"""Trackers whose options take other ways through the code than the defaults do."""


@pytest.fixture(scope="module", params=[*TRACKERS.names(), *VARIANTS])
def settings(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> TrackerSettings:
    """Each tracker with settings under which tracks end early."""
    tmp_path = tmp_path_factory.mktemp("tracker")
    options: dict[str, dict[str, object]] = {
        "lucas-kanade": {"min_features": 80, "max_features": 100},
        "correspondence": {"max_features": 100, "max_missed_frames": 1},
        "patch": {"min_features": 80, "max_features": 100, "min_ncc": 0.5},
        "oracle": {"outlier_rate": 0.1, "loss_rate": 0.1},
        "external": {"command": (sys.executable,), "script": FOLLOW_POINTS, "every": 3},
        "imported": {"path": _track_file(tmp_path / "tracks.csv")},
    }
    kind, others = VARIANTS.get(request.param, (request.param, {}))
    if others.get("descriptor") == "network":
        require_onnx()
        found, matched = (str(tmp_path / f"{name}.onnx") for name in ("keypoints", "matches"))
        keypoint_network(Path(found))
        match_network(Path(matched))
        others = others | {"detection": {"network": found}, "matcher": matched}
    return (
        make_tracker(kind, options.get(kind, {}) | others) if others else TRACKERS.load(kind)(**options.get(kind, {}))
    )


def _track_file(path: Path) -> str:
    rng = np.random.default_rng(0)
    track, frame = np.nonzero(rng.random((40, FRAMES)) < 0.8)
    u_px, v_px = rng.uniform(10, 150, (2, len(track)))
    sure = np.where(rng.random(len(track)) < 0.9, rng.random(len(track)), np.nan)
    table = pl.DataFrame({"track": track, "frame": frame, "u_px": u_px, "v_px": v_px, "quality_sure": sure})
    table.fill_nan(None).write_csv(path)
    return str(path)


def start(settings: TrackerSettings, size: tuple[int, int] = SIZE, speed: int = 1) -> Callable[[Frame], Step]:
    shown = images() if size == SIZE else [np.zeros(size[::-1], np.uint8)] * FRAMES
    sequence = SequenceId("data", "scene")
    ahead = {"images": lambda: iter(shown[::speed])}
    camera = Camera(width=size[0], height=size[1], fx=150.0, fy=150.0, cx=(size[0] - 1) / 2, cy=(size[1] - 1) / 2)
    ahead |= {"camera_at": lambda index: camera, "rotation_at": lambda index: np.eye(3)}
    ahead |= {"pair": StereoPair(camera, camera, BESIDE)}
    return settings.start(SequenceContext(sequence, size, FRAMES, speed, 0, Still(), **ahead)).step


def frame_of(index: int, image: np.ndarray) -> Frame:
    """A frame whose second camera shows the same 4 px farther to the left."""
    return Frame(index, image, lambda: np.roll(image, -4, axis=1))


def images() -> list[np.ndarray]:
    """A texture that slides, jumps, goes black and returns."""
    rng = np.random.default_rng(0)
    noise = cv2.GaussianBlur(rng.normal(size=(260, 300)), (0, 0), 1.5)
    texture = np.clip(128 + 500 * noise / np.ptp(noise), 0, 255).astype(np.uint8)
    corners = [(2 * k, k) for k in range(FRAMES)]
    corners[4] = (90, 60)
    shown = [texture[y : y + SIZE[1], x : x + SIZE[0]].copy() for x, y in corners]
    shown[5] = np.zeros_like(shown[5])
    return shown


def run(settings: TrackerSettings, speed: int = 1) -> list[Step]:
    step = start(settings, speed=speed)
    return [step(frame_of(k, image)) for k, image in enumerate(images()) if k % speed == 0]


@pytest.fixture(scope="module")
def seen(settings: TrackerSettings) -> Callable[[int], list[Step]]:
    """What a tracker reports at a speed, which the tests look at and leave as it is."""
    return cache(lambda speed: run(settings, speed))


def as_bytes(steps: list[Step]) -> list[bytes]:
    return [
        pickle.dumps((s.ids, s.uv, s.born, s.response, s.ended_ids, s.ended, s.matched, s.alive, s.quality))
        for s in steps
    ]


def test_settings_pickle_and_hash(settings):
    copy = pickle.loads(pickle.dumps(settings))
    assert copy == settings
    assert hash(copy) == hash(settings)


@pytest.mark.parametrize("speed", [1, 3])
def test_the_report_has_the_types_and_shapes_it_promises(seen, speed):
    for step in seen(speed):
        n, m = len(step.ids), len(step.ended_ids)
        assert (step.ids.dtype, step.ids.shape) == (np.int64, (n,))
        assert (step.uv.dtype, step.uv.shape) == (np.float64, (n, 2))
        assert (step.born.dtype, step.born.shape) == (np.bool_, (n,))
        assert (step.response.dtype, step.response.shape) == (np.float32, (n,))
        assert (step.ended_ids.dtype, step.ended_ids.shape) == (np.int64, (m,))
        assert (step.ended.dtype, step.ended.shape) == (np.int8, (m,))
        assert np.isfinite(step.uv).all()


def test_quality_is_one_number_per_observation_and_finite_where_known(settings, seen):
    learned = getattr(settings, "matcher", None) is not None
    expected = {
        "lucas-kanade": {"lk_residual", "lk_min_eigenvalue"},
        "correspondence": {"match_score"} if learned else {"descriptor_distance", "descriptor_ratio"},
        "imported": {"sure"},
        "patch": {"patch_residual", "patch_ncc"},
    }
    steps = seen(1)
    for step in steps:
        assert set(step.quality) == expected.get(settings.kind, set(step.quality))
        for name, values in step.quality.items():
            assert re.fullmatch(QUALITY_NAME, name)
            assert (values.dtype, values.shape) == (np.float32, (len(step.ids),))
            assert not np.isinf(values).any()
    for name in expected.get(settings.kind, ()):
        assert any(np.isfinite(step.quality[name]).any() for step in steps)


@pytest.mark.parametrize("speed", [1, 3])
def test_every_feature_is_reported_missed_or_ended_exactly_once(settings, seen, speed):
    may_miss = getattr(settings, "max_missed_frames", 0) > 0
    alive: set[int] = set()
    used: set[int] = set()
    for step in seen(speed):
        ids, ended, born = set(step.ids.tolist()), set(step.ended_ids.tolist()), set(step.ids[step.born].tolist())
        assert len(ids) == len(step.ids)
        assert len(ended) == len(step.ended_ids)
        assert step.offered == len(alive)
        assert not born & used
        assert ended <= alive
        assert ids - born <= alive - ended
        missed = alive - ended - ids
        assert may_miss or not missed
        assert step.outliers == np.count_nonzero(step.ended == TrackEnd.outlier)
        assert step.outliers <= step.matched <= step.offered
        assert step.alive == len(ids) + len(missed)
        assert not np.any(step.ended == TrackEnd.sequence_end)
        alive, used = (alive - ended) | born, used | born
    assert len(used) > 20


def test_it_is_repeatable_whatever_the_count_of_threads(settings, seen):
    before = cv2.getNumThreads()
    runs = [as_bytes(seen(1))]
    try:
        for threads in (1, 2):
            cv2.setNumThreads(threads)
            runs.append(as_bytes(run(settings)))
    finally:
        cv2.setNumThreads(before)
    assert runs[0] == runs[1] == runs[2]


def test_trackers_at_work_do_not_disturb_each_other_on_shared_frames(settings, seen):
    alone = as_bytes(seen(1))
    first, second = start(settings), start(settings)
    shared = [frame_of(k, image) for k, image in enumerate(images())]
    both = [(first(frame), second(frame)) for frame in shared]
    assert as_bytes([pair[0] for pair in both]) == as_bytes([pair[1] for pair in both]) == alone
    assert all((frame.image == image).all() for frame, image in zip(shared, images(), strict=True))


@pytest.mark.parametrize("black", [True, False])
def test_tiny_and_black_images_do_no_harm(settings, black):
    scaled = {"raster": (160.0, 160.0)} if settings.kind == "imported" else {}
    for size in ((1, 1), (5, 9), (16, 16), (17, 40)):
        step, shape = start(replace(settings, **scaled), size=size), size[::-1]
        for index in range(3):
            noise = np.random.default_rng(index).integers(0, 255, shape).astype(np.uint8)
            report = step(frame_of(index, np.zeros(shape, np.uint8) if black else noise))
            if settings.kind in ("lucas-kanade", "correspondence", "patch") and black:
                assert report.alive == report.offered == 0, size
            if settings.kind in ("lucas-kanade", "oracle", "patch") and min(size) <= 16:
                assert report.alive == 0, size


def test_one_frame_is_enough(settings):
    step = start(settings)(frame_of(0, images()[0]))
    assert step.offered == step.matched == step.outliers == len(step.ended_ids) == 0
    assert step.born.all()
    assert step.new == step.alive > 0
