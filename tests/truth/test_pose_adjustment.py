"""Poses are adjusted by tracks of points whose true poses, depths and positions are known."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert, transform
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.tables.identity import SequenceId
from tracknoise.truth.pose_adjustment import PoseAdjustment, ReferenceTracks

CAMERA = Camera(320, 240, 260.0, 260.0, 159.5, 119.5)
FRAMES, LONGEST, PER_FRAME = 14, 8, 30


def moving(frames: int = FRAMES) -> np.ndarray:
    """Poses of a camera that sways and turns."""
    time = np.arange(frames) / 5.0
    poses = np.tile(np.eye(4), (frames, 1, 1))
    turned = np.column_stack([0.02 * np.sin(time), 0.04 * np.sin(0.7 * time), 0.03 * np.cos(time)])
    poses[:, :3, :3] = Rotation.from_rotvec(turned).as_matrix()
    poses[:, :3, 3] = np.column_stack([0.25 * np.sin(0.9 * time), 0.15 * np.cos(time), 0.2 * np.sin(0.5 * time)])
    return poses


def spoilt(poses: np.ndarray, seed: int = 1, degrees: float = 0.1, metres: float = 0.005) -> np.ndarray:
    """Poses with errors that every frame adds."""
    steps = np.random.default_rng(seed).standard_normal((len(poses), 6)) * np.repeat([metres, np.deg2rad(degrees)], 3)
    errors = np.tile(np.eye(4), (len(poses), 1, 1))
    moved = np.cumsum(steps, axis=0)
    errors[:, :3, :3], errors[:, :3, 3] = Rotation.from_rotvec(moved[:, 3:]).as_matrix(), moved[:, :3]
    return poses @ errors


@dataclass(frozen=True, eq=False)
class Made:
    """Tracks of exact poses."""

    poses: np.ndarray
    tracks: ReferenceTracks

    def stated(self, poses: np.ndarray, shutter: RollingShutter | None = None) -> RecordedSequence:
        """A sequence with other poses."""
        return RecordedSequence(
            id=SequenceId("made", "points"),
            source="made",
            camera=CAMERA,
            world_from_camera=poses,
            images=lambda index: np.zeros((240, 320), np.uint8),
            timestamps_s=np.arange(len(poses)) / 30.0,
            shutter=shutter,
        )


def made(noise_px: float = 0.0, seed: int = 0, *, with_depth: bool = True, moves: bool = True) -> Made:
    """Points that are born in every frame, at depths of 2 to 6 m, and seen in the frames after it."""
    rng, poses, per_frame = np.random.default_rng(seed), moving(), PER_FRAME
    if not moves:
        poses[:, :3, 3] = 0.0
    births = np.repeat(np.arange(FRAMES - 1), per_frame)
    uv = rng.uniform([20, 20], [300, 220], (len(births), 2))
    depth_m = rng.uniform(2.0, 6.0, len(births))
    points = transform(poses[births], CAMERA.unproject(uv, depth_m))
    track = np.repeat(np.arange(len(births)), np.minimum(LONGEST, FRAMES - 1 - births))
    age = np.concatenate([np.arange(1, 1 + count) for count in np.minimum(LONGEST, FRAMES - 1 - births)])
    frame = births[track] + age
    seen = CAMERA.project(transform(invert(poses[frame]), points[track])) + rng.normal(0.0, noise_px, (len(track), 2))
    unknown = np.full(len(births), np.nan)
    tracks = ReferenceTracks(
        birth=births,
        birth_uv=uv,
        depth_m=depth_m if with_depth else unknown,
        depth_sigma=np.full(len(births), 0.01) if with_depth else unknown,
        kind=np.zeros(len(births), np.intp),
        track=track,
        frame=frame,
        uv=seen,
    )
    return Made(poses, tracks)


def relative(poses: np.ndarray) -> np.ndarray:
    """Poses in the camera of the frame before."""
    return invert(poses[:-1]) @ poses[1:]


def test_exact_tracks_give_back_the_poses_that_were_spoilt():
    one = made()
    adjustment = PoseAdjustment(one.stated(spoilt(one.poses)), one.tracks)
    best = adjustment.best()
    assert np.abs(relative(best.poses) - relative(one.poses)).max() < 1e-6
    assert best.depth_m == pytest.approx(one.tracks.depth_m, rel=1e-6)
    assert np.abs(adjustment.residuals(best.poses, best.depth_m)).max() < 1e-4


def test_what_is_exact_stays():
    one = made()
    best = PoseAdjustment(one.stated(one.poses), one.tracks).best()
    assert np.abs(best.poses - one.poses).max() < 1e-9


def test_without_depth_true_positions_come_back_up_to_the_scale():
    one = made(with_depth=False)
    adjustment = PoseAdjustment(one.stated(spoilt(one.poses)), one.tracks)
    best = adjustment.best()
    turned = relative(best.poses)[:, :3, :3], relative(one.poses)[:, :3, :3]
    assert np.abs(turned[0] - turned[1]).max() < 1e-5
    moved, true = relative(best.poses)[:, :3, 3], relative(one.poses)[:, :3, 3]
    scale = np.sum(moved * true) / np.sum(true * true)
    assert scale == pytest.approx(1.0, abs=0.1)
    assert np.abs(moved - scale * true).max() < 1e-4
    assert np.nanmedian(np.abs(adjustment.residuals(best.poses, best.depth_m))) < 1e-3


def test_parallax_is_asked_for_only_without_depth():
    for with_depth, moves in ((True, True), (True, False), (False, True), (False, False)):
        one = made(noise_px=0.2, with_depth=with_depth, moves=moves)
        parallax_px = PoseAdjustment(one.stated(spoilt(one.poses, metres=2e-4)), one.tracks).parallax_px()
        assert parallax_px == np.inf if with_depth else parallax_px > 5.0 if moves else parallax_px < 2.0


def test_frames_without_a_pose_stay_without_and_the_others_come_back():
    one = made()
    stated = spoilt(one.poses)
    missing = [0, 5, 6]
    stated[missing] = np.nan
    tracks = one.tracks
    rows = ~np.isin(tracks.frame, missing) & ~np.isin(tracks.birth[tracks.track], missing)
    kept = np.isin(np.arange(len(tracks.birth)), tracks.track[rows])
    number = np.cumsum(kept) - 1
    seen = replace(tracks.chosen(kept), track=number[tracks.track[rows]], frame=tracks.frame[rows], uv=tracks.uv[rows])
    best = PoseAdjustment(one.stated(stated), seen).best()
    assert np.isnan(best.poses[missing]).all()
    known = np.setdiff1d(np.arange(FRAMES), missing)
    assert np.abs(relative(best.poses[known]) - relative(one.poses[known])).max() < 1e-6


def test_a_frame_without_tracks_stays_at_its_stated_place_between_its_neighbours():
    one = made()
    stated = spoilt(one.poses)
    tracks = one.tracks
    rows = tracks.frame != FRAMES - 1
    kept = np.isin(np.arange(len(tracks.birth)), tracks.track[rows])
    number = np.cumsum(kept) - 1
    seen = replace(tracks.chosen(kept), track=number[tracks.track[rows]], frame=tracks.frame[rows], uv=tracks.uv[rows])
    best = PoseAdjustment(one.stated(stated), seen).best()
    assert np.abs(relative(best.poses[:-1]) - relative(one.poses[:-1])).max() < 1e-6
    assert relative(best.poses)[-1] == pytest.approx(relative(stated)[-1], abs=1e-9)


def test_wrong_tracks_do_not_move_the_poses():
    one = made(noise_px=0.1)
    rng = np.random.default_rng(3)
    wrong = rng.random(len(one.tracks.birth)) < 0.15
    uv = one.tracks.uv + np.where(wrong[one.tracks.track, None], rng.normal(0.0, 15.0, one.tracks.uv.shape), 0.0)
    stated = one.stated(spoilt(one.poses))
    for tracks in (one.tracks, replace(one.tracks, uv=uv)):
        adjustment = PoseAdjustment(stated, tracks)
        left = adjustment.residuals(adjustment.best().poses, tracks.depth_m)
        exact = adjustment.residuals(one.poses, tracks.depth_m)
        assert np.sqrt(np.mean((left - exact) ** 2)) < 0.06


def test_halves_of_the_tracks_tell_the_error_of_the_poses_by_all():
    real, told = [], []
    for seed in range(8):
        one = made(noise_px=0.5, seed=seed)
        adjustment = PoseAdjustment(one.stated(spoilt(one.poses, seed)), one.tracks)
        best = adjustment.best()
        half = np.random.default_rng(seed).random(len(one.tracks.birth)) < 0.5
        by = [adjustment.residuals(poses, one.tracks.depth_m) for poses in (best.poses, one.poses)]
        halves = [adjustment.residuals(adjustment.of(best, part), one.tracks.depth_m) for part in (half, ~half)]
        real.append(np.mean((by[0] - by[1]) ** 2))
        told.append(np.mean((halves[0] - halves[1]) ** 2) / 4.0)
    assert np.mean(told) == pytest.approx(np.mean(real), rel=0.25)


def test_tracks_of_one_point_are_in_the_same_half():
    one = made(noise_px=0.5)
    tracks = one.tracks
    times, count = 3, len(tracks.birth)
    order = np.argsort(np.tile(tracks.birth, times), kind="stable")
    number = np.argsort(order)
    track = number[np.concatenate([tracks.track + count * time for time in range(times)])]
    sorting = np.argsort(track, kind="stable")
    births = {
        name: np.tile(getattr(tracks, name), (times, 1) if name == "birth_uv" else times)[order]
        for name in ("birth", "birth_uv", "depth_m", "depth_sigma", "kind")
    }
    rows = np.tile(np.arange(len(tracks.frame)), times)[sorting]
    every = ReferenceTracks(**births, track=track[sorting], frame=tracks.frame[rows], uv=tracks.uv[rows])
    adjustment = PoseAdjustment(one.stated(spoilt(one.poses)), every)
    best = adjustment.best()
    half = adjustment.half(best)
    assert 0.3 < half.mean() < 0.7
    same = half[number].reshape(times, count)
    assert np.mean((same == same[0]).all(axis=0)) > 0.95
    real = adjustment.residuals(best.poses, every.depth_m) - adjustment.residuals(one.poses, every.depth_m)
    halves = [adjustment.residuals(adjustment.of(best, part), every.depth_m) for part in (half, ~half)]
    told = (halves[0] - halves[1]) / 2.0
    assert 0.6 < np.sqrt(np.mean(told**2) / np.mean(real**2)) < 1.7


def test_poses_by_all_tracks_are_those_of_a_half_where_tracks_are_exact():
    one = made()
    adjustment = PoseAdjustment(one.stated(spoilt(one.poses)), one.tracks)
    best = adjustment.best()
    half = np.arange(len(one.tracks.birth)) % 2 == 0
    assert np.abs(relative(adjustment.of(best, half)) - relative(one.poses)).max() < 1e-6


def test_what_poses_absorb_of_displacements_is_not_left():
    one = made(noise_px=0.2)
    adjustment = PoseAdjustment(one.stated(one.poses), one.tracks)
    best = adjustment.best()
    turned = one.poses.copy()
    turned[5, :3, :3] = turned[5, :3, :3] @ Rotation.from_rotvec([0.0, 1e-4, 0.0]).as_matrix()
    moved = adjustment.residuals(turned, best.depth_m) - adjustment.residuals(one.poses, best.depth_m)
    assert np.sqrt(np.mean(adjustment.faults(best, {"one": moved})["one"].left ** 2)) < 0.02 * np.sqrt(
        np.mean(moved**2)
    )
    noise = np.random.default_rng(0).normal(0.0, 0.02, moved.shape)
    assert np.sqrt(np.mean(adjustment.faults(best, {"one": noise})["one"].left ** 2)) > 0.8 * 0.02


def test_rows_of_a_rolling_shutter_have_poses_of_their_own():
    shutter = RollingShutter(0.02)
    one = made()
    sequence = one.stated(one.poses, shutter)
    frames = PoseAdjustment(sequence, one.tracks)
    # observations as a rolling shutter makes them: the residuals by exact poses are taken off until none is left
    tracks = one.tracks
    for _ in range(6):
        frames = PoseAdjustment(sequence, tracks)
        tracks = replace(tracks, uv=tracks.uv - frames.residuals(one.poses, tracks.depth_m))
    assert np.abs(PoseAdjustment(sequence, tracks).residuals(one.poses, tracks.depth_m)).max() < 1e-6
    assert np.abs(tracks.uv - one.tracks.uv).max() > 0.5
    rng = np.random.default_rng(0)
    stated = one.poses.copy()
    stated[:, :3, 3] += rng.normal(0.0, 0.003, (FRAMES, 3))
    adjustment = PoseAdjustment(one.stated(stated, shutter), tracks)
    best = adjustment.best()
    left, given = (adjustment.residuals(poses, tracks.depth_m) for poses in (best.poses, stated))
    assert np.sqrt(np.mean(left**2)) < 0.2 * np.sqrt(np.mean(given**2))


def test_some_of_the_tracks_keep_their_observations():
    one = made()
    chosen = one.tracks.chosen(np.arange(len(one.tracks.birth)) % 3 == 1)
    assert np.array_equal(chosen.birth_uv, one.tracks.birth_uv[1::3])
    assert len(chosen.frame) == np.isin(one.tracks.track, np.arange(1, len(one.tracks.birth), 3)).sum()
    assert (chosen.frame > chosen.birth[chosen.track]).all()
