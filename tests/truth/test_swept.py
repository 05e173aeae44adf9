"""Depth from the images of other frames: exact worlds whose depth is hidden, its error, and where there is none."""

from dataclasses import dataclass, field, replace
from itertools import pairwise

import cv2
import numpy as np
import polars as pl
import pytest
from tests.lean import only_topics, with_models

import tracknoise
from tracknoise.exceptions import NothingToMeasureError
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import sample
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import SecondCamera
from tracknoise.sequences.views import View
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.plane_sweep import PlaneSweep
from tracknoise.truth.sweep_views import OFFSETS
from tracknoise.truth.truth_registry import make_truth
from tracknoise.truth.uncertainty import TruthDerivatives, anchored_points
from tracknoise.truth.visibility import SequenceGeometry

SIZE = {"width": 240, "height": 180, "frames": 24}
LOOKS = {
    "pinhole": {},
    "distorted": {"lens": "radtan", "distortion": (-0.2, 0.05, 0.001, -0.002)},
    "rolling": {"imaging": {"readout_s": 0.02, "rate_hz": 30.0}},
}


@dataclass(frozen=True, slots=True, eq=False)
class Bare(View):
    """A sequence without depth and surface, which counts how often each image is read."""

    reads: list[int] = field(default_factory=list)

    @property
    def truths(self):
        return ("swept", "triangulated")

    @property
    def surface(self):
        return None

    def depth(self, index):
        raise AssertionError("the depth is hidden")

    def image(self, index):
        self.reads.append(index)
        return self.sequence.image(index)


@pytest.fixture(scope="module", params=list(LOOKS))
def exact(request):
    return tracknoise.open_sequence("simulated", motions=["sideways"], seed=3, **SIZE, **LOOKS[request.param])


@pytest.fixture(scope="module")
def recorded():
    return tracknoise.open_sequence("simulated", motions=["sideways"], seed=3, **SIZE)


def corners(sequence, index, count=150):
    """Some corners, not beside the border, between pixels."""
    found = cv2.FastFeatureDetector_create(10).detect(sequence.image(index))
    uv = np.array([one.pt for one in found if 12 < one.pt[0] < 228 and 12 < one.pt[1] < 168])
    random = np.random.default_rng(0)
    return random.permutation(uv)[:count] + random.uniform(-0.4, 0.4, (count, 2))


def test_depths_are_those_of_the_surface_and_so_are_their_errors(exact):
    hidden = Bare(exact)
    uv = corners(exact, 7)
    geometry = SequenceGeometry(hidden)
    found = PlaneSweep(geometry).found(7, uv)
    points, hit = exact.cast(7, uv)
    depth_m = geometry.to_camera(7, uv, points)[:, 2]
    known = np.isfinite(found.inverse_depth) & hit
    error = found.inverse_depth * depth_m - 1.0
    by_map = sample(exact.depth(7), uv, exact.camera)
    assert np.mean(known) > 0.9 * np.mean(by_map.valid & ~by_map.edge)
    assert abs(np.median(error[known])) < 0.004
    assert np.median(np.abs(error[known])) < 0.02
    ratio = np.abs(error / depth_m / found.sigma)[known]
    assert 0.1 < np.median(ratio) < 1.5
    assert np.mean(ratio < 3.0) > 0.85


def test_what_a_track_does_later_changes_nothing(recorded):
    hidden, uv = Bare(recorded), corners(recorded, 4, 30)
    tracks, born = np.arange(30, dtype=np.uint32), np.ones(30, bool)
    true = []
    for drift in (0.0, 5.0):
        session = make_truth(hidden).start()
        session.observe(4, tracks, uv, born)
        session.observe(5, tracks, uv + drift, ~born)
        true.append(session.resolve())
    np.testing.assert_array_equal(true[0].uv, true[1].uv)
    known = np.isfinite(true[0].depth_m)
    assert known.any()
    np.testing.assert_array_equal(true[0].uv[:30][known], uv[known])
    assert np.isfinite(true[0].uv[30:]).any()


def test_trackers_share_depths_and_images(recorded):
    hidden, uv = Bare(recorded), corners(recorded, 4, 20)
    truth = make_truth(hidden)
    one, other = truth.anchor(4, uv), truth.anchor(4, uv[::-1])
    np.testing.assert_array_equal(one[0], other[0][::-1])
    assert len(hidden.reads) == len(set(hidden.reads)) <= len(recorded)


def test_the_error_of_each_depth_is_in_the_floor(recorded):
    """It moves a true position as far as a depth does that is wrong by one standard deviation."""
    found = tracknoise.measure(
        Bare(recorded), tracknoise.LucasKanade(min_features=40, max_features=60), truth="swept", max_frames=8
    )
    hidden, uv = Bare(recorded), corners(recorded, 0, 40)
    session = make_truth(hidden).start()
    tracks, born = np.arange(40, dtype=np.uint32), np.ones(40, bool)
    session.observe(0, tracks, uv, born)
    session.observe(6, tracks, uv, ~born)
    true = session.resolve()
    geometry, sigma_m = SequenceGeometry(hidden), 1e-3 * true.depth_sigma_m
    moved = []
    for depth_m in (true.depth_m, true.depth_m + sigma_m):
        points = geometry.camera_at(0).unproject(uv, np.where(np.isfinite(depth_m), depth_m, 1.0))
        moved.append(geometry.project(6, geometry.to_world(0, uv, points)))
    frame, track = np.repeat([0, 6], 40), np.tile(np.arange(40), 2)
    rows, points = anchored_points(hidden, frame, track, true, key_frame=None)
    derivative = TruthDerivatives(hidden).sensitivity(points).depth * points.depth_sigma_m[:, None] * 1e-3
    later = points.frame == 6
    np.testing.assert_allclose(derivative[later], (moved[1] - moved[0])[track[rows][later]], rtol=1e-2, atol=1e-9)
    assert set(found.floors["source"]) >= {"depth"}
    seen = found.observations.filter(pl.col("age") > 0, truth="valid")
    assert seen["cov_true_uu"].null_count() == 0
    assert seen["cov_true_uu"].min() > 0.0


def still(sequence, **changes):
    """What a folder without depth would be."""
    return RecordedSequence(
        id=sequence.id,
        source="a recording",
        camera=sequence.camera,
        world_from_camera=changes.pop("poses", sequence.world_from_camera),
        images=changes.pop("images", sequence.image),
    )


NEAR_M, FAR_M, STEP_M, BOX = 2.0, 4.0, 0.08, (90, 70, 150, 110)


def two_planes():
    """A textured wall, and a square before it, seen by a camera that moves to the right: 4 and 8 px a frame."""
    random, focal_px = np.random.default_rng(2), 200.0
    wall, square = (cv2.GaussianBlur(random.uniform(0, 255, (180, 480)), (0, 0), 1.5) for _ in range(2))
    wall, square = (np.clip(128 + 4 * (one - one.mean()), 0, 255) for one in (wall, square))
    left, top, right, bottom = BOX
    images = []
    for frame in range(9):
        far, near = (round(focal_px * STEP_M / depth * (frame - 4)) for depth in (FAR_M, NEAR_M))
        image = wall[:, 120 + far : 360 + far].copy()
        image[top:bottom, left - near : right - near] = square[top:bottom, left:right]
        images.append(image.astype(np.uint8))
    poses = np.tile(np.eye(4), (9, 1, 1))
    poses[:, 0, 3] = STEP_M * (np.arange(9) - 4)
    return RecordedSequence(
        id=SequenceId("made", "two planes"),
        source="two planes",
        camera=Camera(width=240, height=180, fx=focal_px, fy=focal_px, cx=119.5, cy=89.5),
        world_from_camera=poses,
        images=images.__getitem__,
    )


def test_next_to_a_depth_edge_there_is_no_depth_as_with_a_depth_map():
    """There a patch shows two surfaces, and is found at the depth of one, whichever the point is on."""
    left, top, right, bottom = BOX
    v = np.arange(top + 10.0, bottom - 10.0, 2.0)
    truth = make_truth(two_planes())
    for u in (left - 2.0, left + 2.0, right - 3.0, right + 2.0):
        _, status = truth.anchor(4, np.column_stack([np.full(len(v), u), v]))
        assert np.mean(status == TruthStatus.edge) >= 0.6
    for u, depth_m in ((left - 30.0, FAR_M), (left + 30.0, NEAR_M)):
        points, status = truth.anchor(4, np.column_stack([np.full(len(v), u), v]))
        assert np.mean(status == TruthStatus.valid) > 0.9
        np.testing.assert_allclose(points[status == TruthStatus.valid, 2], depth_m, rtol=0.02)


def test_a_recording_without_depth_has_errors_and_a_sigma_to_set(recorded):
    """As with depth, and unlike where points are fitted to the tracks."""
    settings = tracknoise.LucasKanade(min_features=300, max_features=400)
    by_depth = tracknoise.measure(recorded, settings)
    without = tracknoise.measure(still(recorded), settings)
    assert without.truth == "swept"
    with with_models(), only_topics():
        runs = [tracknoise.analyse(one) for one in (by_depth, without)]
    sigmas = [run.sigma("openvins")["lucas-kanade"].sigma_px for run in runs]
    assert sigmas[1] == pytest.approx(sigmas[0], rel=0.15)


BASELINE_M = 0.15


def beside(sequence, *, lens):
    """A camera 0.15 m to the right, slightly turned and behind, with its own intrinsics and lens."""
    turn, _ = cv2.Rodrigues(np.array([0.01, 0.02, -0.03]))
    first_from_second = np.eye(4)
    first_from_second[:3] = np.column_stack([turn, (BASELINE_M, 0.01, -0.02)])
    shown = tracknoise.open_sequence("simulated", motions=["sideways"], seed=3, **SIZE, hfov_deg=70.0, **lens)
    seen = replace(shown, world_from_camera=sequence.world_from_camera @ first_from_second)
    return SecondCamera(seen.camera, first_from_second, seen.image)


def stopped(sequence):
    """The sequence with a camera that stays at its first pose."""
    return replace(sequence, world_from_camera=np.repeat(sequence.world_from_camera[:1], len(sequence), axis=0))


@pytest.mark.parametrize("lens", [{}, LOOKS["distorted"]], ids=["pinhole", "distorted"])
def test_a_second_camera_gives_depths_where_the_first_stands_still(recorded, lens):
    there = stopped(recorded)
    pair = replace(still(there), second=beside(there, lens=lens))
    uv = corners(there, 7)
    points, hit = there.cast(7, uv)
    depth_m = SequenceGeometry(there).to_camera(7, uv, points)[:, 2]
    found = PlaneSweep(SequenceGeometry(pair)).found(7, uv)
    known = np.isfinite(found.inverse_depth) & hit
    error = (found.inverse_depth * depth_m - 1.0)[known]
    assert np.mean(known) > 0.5
    assert abs(np.median(error)) < 0.01
    assert np.median(np.abs(error)) < 0.03
    ratio = np.abs(error / depth_m[known] / found.sigma[known])
    assert 0.1 < np.median(ratio) < 1.5
    assert np.mean(ratio < 3.0) > 0.85


def test_frames_without_an_image_of_the_second_camera_have_depths_from_others(recorded):
    second = beside(recorded, lens={})
    pair = replace(still(recorded), second=replace(second, images=lambda _: None))
    uv = corners(recorded, 7, 30)
    alone, found = (PlaneSweep(SequenceGeometry(one)).found(7, uv) for one in (still(recorded), pair))
    np.testing.assert_array_equal(found.inverse_depth, alone.inverse_depth)


@pytest.mark.parametrize("unit", [1.0, 3.0])
def test_a_second_camera_takes_no_part_where_poses_are_in_another_unit_than_its_distance(recorded, unit):
    poses = recorded.world_from_camera.copy()
    poses[:, :3, 3] *= unit
    alone = still(recorded, poses=poses)
    uv = corners(recorded, 7, 40)
    truths = [make_truth(one) for one in (alone, replace(alone, second=beside(recorded, lens={})))]
    depths_m = [truth.anchor(7, uv)[0][:, 2] for truth in truths]
    assert np.array_equal(*depths_m, equal_nan=True) == (unit != 1.0)
    assert truths[0].notes == ()
    assert bool(truths[1].notes) == (unit != 1.0)
    if unit != 1.0:
        assert "depths by the poses are 3 times those by the second camera" in truths[1].notes[0]


def rotating(sequence):
    poses = sequence.world_from_camera.copy()
    poses[:, :3, 3] = poses[0, :3, 3]
    return still(sequence, poses=poses)


def repeated(sequence):
    return still(
        sequence,
        poses=np.repeat(sequence.world_from_camera[:1], len(sequence), axis=0),
        images=lambda _: sequence.image(0),
    )


def plain(sequence):
    return still(sequence, images=lambda _: np.full((180, 240), 90, np.uint8))


@pytest.mark.parametrize("made", [rotating, repeated, plain])
def test_without_parallax_or_texture_nothing_has_a_depth(made, recorded):
    sequence = made(recorded)
    truth = make_truth(sequence)
    points, status = truth.anchor(5, corners(recorded, 5, 40))
    assert (status == TruthStatus.no_depth).all()
    assert np.isnan(points).all()
    assert np.isnan(truth.depth_sigma(5, corners(recorded, 5, 40))).all()


def test_a_recording_in_which_nothing_has_a_depth_is_refused_in_one_line(recorded):
    with pytest.raises(
        NothingToMeasureError, match=r"no depth from the images of other frames.*'triangulated'"
    ) as caught:
        tracknoise.measure(rotating(recorded), tracknoise.LucasKanade(min_features=40, max_features=60), max_frames=4)
    assert "poses at most 0 m apart" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_frames_are_chosen_by_baseline(recorded):
    """Also where the camera stands still for a while, and frames without a pose take no part."""
    poses = recorded.world_from_camera.copy()
    poses[5:9] = poses[5]
    poses[10] = np.nan
    sweep = PlaneSweep(SequenceGeometry(still(recorded, poses=poses)))
    rungs = sweep.rungs(6)
    frames = [frame for rung in rungs for frame in rung]
    assert frames
    assert not {5, 7, 8, 10} & set(frames)
    assert {abs(frame - 6) for frame in frames} <= set(OFFSETS)
    lengths = [[np.linalg.norm(poses[frame, :3, 3] - poses[6, :3, 3]) for frame in rung] for rung in rungs]
    assert all(max(one) <= 2.0 * min(one) for one in lengths)
    assert all(max(one) <= min(two) for one, two in pairwise(lengths))
