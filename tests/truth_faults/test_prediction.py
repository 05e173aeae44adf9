"""Corrected true positions, against other code, and their derivatives against differences."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.validity.audit_worlds import CAMERA, World, make_samples, theta_of
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera, DoubleSphereCamera, EquidistantCamera, EucmCamera, FovCamera, OmniCamera
from tracknoise.geometry.pose import PosePath
from tracknoise.truth_faults.audit_samples import AuditSamples, Paths
from tracknoise.truth_faults.corrected_motion import CorrectedMotion
from tracknoise.truth_faults.corrected_positions import INTRINSIC, predict
from tracknoise.truth_faults.fault_parameters import COUNT, FAULTS, SLICES, Corrections, Parameter, columns_of

SMALL = World(n_scenes=2, n_frames=30, per_scene=60)
CAMERAS = (
    CAMERA,
    Camera(640, 480, 500.0, 505.0, 310.0, 235.0, (-0.2, 0.05, 1e-3, -5e-4)),
    Camera(640, 480, 500.0, 505.0, 310.0, 235.0, (0.3, 0.1, 1e-3, -5e-4, 0.02, 0.2, 0.05, 0.01)),
    EquidistantCamera(640, 480, 300.0, 305.0, 310.0, 235.0, (0.01, 0.002, 0.0, 0.0)),
    DoubleSphereCamera(640, 480, 300.0, 305.0, 310.0, 235.0, -0.2, 0.6),
    OmniCamera(640, 480, 650.0, 655.0, 310.0, 235.0, 1.1, (-0.2, 0.05, 1e-3, -5e-4)),
    EucmCamera(640, 480, 300.0, 305.0, 310.0, 235.0, 0.6, 1.1),
    FovCamera(640, 480, 260.0, 265.0, 310.0, 235.0, 0.9),
)
SIZE = {
    Parameter.focal_length: 0.05, Parameter.principal_point: 3.0, Parameter.k1: 0.02,
    Parameter.depth_scale: 0.05, Parameter.depth_offset: 0.02, Parameter.inverse_depth_offset: 0.02,
    Parameter.mounting_rotation: 0.02, Parameter.mounting_translation: 0.02,
    Parameter.clock_offset: 0.3, Parameter.clock_drift: 0.3, Parameter.readout: 0.3,
    Parameter.rotation_delay: 0.3, Parameter.smoothing: 0.3, Parameter.ray_depth: 0.4,
}  # fmt: skip
STEP = np.concatenate([np.full(FAULTS[one].count, SIZE[one]) for one in Parameter])


def samples(world: World = SMALL, seed: int = 0) -> AuditSamples:
    return make_samples(np.random.default_rng(seed), world, np.zeros(COUNT))


@pytest.mark.parametrize(
    ("camera", "readout"),
    [*((camera, 0.7) for camera in CAMERAS), (CAMERAS[1], 0.0), (CAMERAS[1], -0.5)],
    ids=lambda one: str(one) if isinstance(one, float) else f"{type(one).__name__}-{len(str(one))}",
)
def test_derivatives_are_those_of_differences(camera, readout) -> None:
    some = samples(replace(SMALL, camera=camera, readout=readout))
    theta = np.random.default_rng(1).normal(size=COUNT) * STEP
    if not isinstance(camera, Camera):
        theta[SLICES[Parameter.k1]] = 0.0
    derivatives = predict(some, theta).by(Parameter)
    for place in range(COUNT):
        step = np.zeros(COUNT)
        step[place] = 1e-6
        difference = (predict(some, theta + step).uv - predict(some, theta - step).uv) / 2e-6
        np.testing.assert_allclose(derivatives[:, :, place], difference, atol=1e-5, rtol=1e-6)


def test_derivatives_are_in_the_order_asked_and_the_same_beside_any_others() -> None:
    some, theta = samples(replace(SMALL, readout=0.4)), np.random.default_rng(2).normal(size=COUNT) * STEP
    every = predict(some, theta).by(Parameter)
    for parameter in Parameter:
        alone = predict(some, theta).by([parameter])
        np.testing.assert_array_equal(alone, every[:, :, SLICES[parameter]])
    asked = (Parameter.readout, Parameter.focal_length)
    np.testing.assert_array_equal(predict(some, theta).by(asked), every[:, :, columns_of(asked)])


def test_positions_without_a_shutter_need_no_derivatives(monkeypatch) -> None:
    monkeypatch.setattr(
        "tracknoise.truth_faults.corrected_positions.projection_jacobian", lambda *_: pytest.fail("nobody asked")
    )
    some = samples()
    np.testing.assert_allclose(predict(some, np.zeros(COUNT)).uv, some.stated, atol=1e-12)


def test_only_derivatives_by_the_optics_need_those_of_rays(monkeypatch) -> None:
    monkeypatch.setattr(
        "tracknoise.truth_faults.corrected_positions._rays_by_optics", lambda *_: pytest.fail("nobody asked")
    )
    others = [one for one in Parameter if SLICES[one].start >= INTRINSIC]
    assert predict(samples(), np.zeros(COUNT)).by(others).shape[2] == COUNT - INTRINSIC


def test_between_frames_poses_are_those_of_pose_path() -> None:
    paths = samples().paths
    poses = np.tile(np.eye(4), (60, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = paths.rotation, paths.position
    frame, delay = np.array([3, 10, 29, 30, 40, 59]), np.array([0.4, -0.7, 0.9, -1.2, 30.3, 2.0])
    found = paths.at(frame, delay)
    times = paths.times[frame] + delay
    one, two = (PosePath(paths.times[part], poses[part]) for part in (slice(30), slice(30, 60)))
    expected = np.concatenate([one.at(times[:3]), two.at(times[3:])])
    np.testing.assert_allclose(found.rotation, expected[:, :3, :3], atol=1e-12)
    np.testing.assert_allclose(found.position, expected[:, :3, 3], atol=1e-12)


def test_frames_beside_a_gap_in_the_poses_are_not_surrounded() -> None:
    poses = np.tile(np.eye(4), (7, 1, 1))
    poses[4] = np.nan
    paths = Paths.of(np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 0.0]), poses, np.array([0, 0, 0, 0, 0, 0, 1]))
    assert paths.surrounded.tolist() == [True, True, True, False, False, False, False]


def by_hand(some: AuditSamples, row: int, theta: dict[Parameter, np.ndarray]) -> np.ndarray:
    """One corrected position of a pinhole camera, by matrices written out, and its row by bisection over times."""
    focal = 525.0 * (1.0 + theta[Parameter.focal_length])
    centre = np.array([319.5, 239.5]) + theta[Parameter.principal_point]
    mounting = np.eye(4)
    mounting[:3, :3] = Rotation.from_rotvec(theta[Parameter.mounting_rotation]).as_matrix()
    mounting[:3, 3] = theta[Parameter.mounting_translation]
    poses = np.tile(np.eye(4), (30, 1, 1))
    own = slice(0, 30) if some.birth[row] < 30 else slice(30, 60)
    poses[:, :3, :3], poses[:, :3, 3] = some.paths.rotation[own], some.paths.position[own]
    path = PosePath(np.arange(30.0), poses)

    def pose(frame: int, v: float) -> np.ndarray:
        drift = theta[Parameter.clock_drift] * (frame - own.start - 14.5) / 14.5
        row_time = theta[Parameter.readout] * ((v + 0.5) / 480.0 - 0.5)
        time = frame - own.start + theta[Parameter.clock_offset] + drift + row_time
        return path.at(np.array([time]))[0] @ mounting

    uv = some.uv_at_birth[row]
    xy = (uv - centre) / focal
    cosine = 1.0 / np.sqrt(1.0 + xy @ xy)
    kind = theta[Parameter.ray_depth]
    straight = (1.0 + theta[Parameter.depth_scale]) * some.depth[row] + theta[Parameter.depth_offset]
    depth = (1.0 - kind + kind * cosine) / (1.0 / straight + theta[Parameter.inverse_depth_offset])
    point = np.array([*(xy * depth), depth, 1.0])
    world = pose(some.birth[row], uv[1]) @ point

    def seen(v: float) -> np.ndarray:
        there = np.linalg.inv(pose(some.now[row], v)) @ world
        return focal * there[:2] / there[2] + centre

    low, high = -2000.0, 3000.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if seen(middle)[1] > middle else (low, middle)
    return seen(middle)


def test_corrections_do_what_they_are_called() -> None:
    some = samples()
    theta = theta_of({
        Parameter.focal_length: 0.05, Parameter.principal_point: (4.0, -3.0),
        Parameter.depth_scale: 0.04, Parameter.depth_offset: 0.1, Parameter.inverse_depth_offset: 0.03,
        Parameter.mounting_rotation: (0.02, -0.03, 0.01), Parameter.mounting_translation: (0.05, 0.02, -0.04),
        Parameter.clock_offset: 0.3, Parameter.clock_drift: -0.7, Parameter.readout: 0.6, Parameter.ray_depth: 0.9,
    })  # fmt: skip
    found, numbers = predict(some, theta).uv, {one: np.squeeze(theta[SLICES[one]]) for one in Parameter}
    for row in range(0, len(found), 17):
        np.testing.assert_allclose(found[row], by_hand(some, row, numbers), atol=1e-7)


def bowed(smoothed: float = 0.0) -> np.ndarray:
    """Poses on a path whose second differences change slowly, averaged over 2 * smoothed frames squared of variance."""
    times = np.arange(40.0)
    poses = np.tile(np.eye(4), (40, 1, 1))
    fade = np.exp(-smoothed * np.array([0.2, 0.15, 0.1]) ** 2)  # of waves, by a filter whose variance is 2 * smoothed
    turn = fade * np.sin(np.outer(times, [0.2, 0.15, 0.1])) * [0.05, 0.0, 0.0]
    poses[:, :3, :3] = Rotation.from_rotvec(turn).as_matrix()
    poses[:, :3, 3] = fade * np.sin(np.outer(times, [0.2, 0.15, 0.1])) * [0.1, 0.2, 0.3]
    return poses


def test_smoothed_poses_are_sharpened_again() -> None:
    paths, c = Paths.of(np.arange(40.0), bowed(smoothed=1.5), np.zeros(40, np.intp)), 1.5
    frame, true = np.arange(5, 35), bowed()
    found = CorrectedMotion(paths, Corrections(theta_of({Parameter.smoothing: c})), frame, np.zeros(30))
    stated = np.abs(paths.position[frame] - true[frame, :3, 3]).max()
    assert np.abs(found.position - true[frame, :3, 3]).max() < 0.06 * stated
    stated = np.abs(paths.rotation[frame] - true[frame, :3, :3]).max()
    assert np.abs(found.rotation - true[frame, :3, :3]).max() < 0.06 * stated


def test_late_rotations_are_those_of_later_times_and_positions_stay() -> None:
    paths = Paths.of(np.arange(40.0), bowed(), np.zeros(40, np.intp))
    frame, corrections = np.arange(5, 35), Corrections(theta_of({Parameter.rotation_delay: (0.5, 0.5, 0.5)}))
    found = CorrectedMotion(paths, corrections, frame, np.zeros(30))
    later = paths.at(frame, np.full(30, 0.5))
    np.testing.assert_allclose(found.rotation, later.rotation, atol=1e-12)
    assert np.abs(paths.rotation[frame] - later.rotation).max() > 4e-3
    np.testing.assert_array_equal(found.position, paths.position[frame])


def test_a_corrected_inverse_depth_that_is_not_positive_has_no_position() -> None:
    some = samples()
    found = predict(some, theta_of({Parameter.inverse_depth_offset: -1.0 / 3.0})).uv
    np.testing.assert_array_equal(np.isnan(found).all(axis=1), some.depth >= 3.0)


def test_a_point_that_is_not_seen_moves_no_other() -> None:
    some, theta = samples(), theta_of({Parameter.readout: 0.5})
    depth = some.depth.copy()
    depth[7] = -1.0  # behind the camera
    found, expected = predict(replace(some, depth=depth), theta).uv, predict(some, theta).uv
    assert np.isnan(found[7]).all()
    np.testing.assert_array_equal(np.delete(found, 7, axis=0), np.delete(expected, 7, axis=0))


def test_a_stated_readout_is_the_truth_that_a_correction_adds_to() -> None:
    some = samples()
    shuttered = replace(some, readout_of=np.full(len(some.camera), 0.5))
    more, less = theta_of({Parameter.readout: 0.5}), theta_of({Parameter.readout: -0.5})
    np.testing.assert_allclose(predict(shuttered, np.zeros(COUNT)).uv, predict(some, more).uv, atol=1e-9)
    np.testing.assert_allclose(predict(shuttered, less).uv, some.stated, atol=1e-9)
