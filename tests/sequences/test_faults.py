"""What faults do to the stated truth, computed by hand. Images must stay as they are."""

import pickle
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import SettingsError
from tracknoise.geometry.cameras import Camera, CameraModel, DoubleSphereCamera, EquidistantCamera
from tracknoise.geometry.depth import DepthMap, sample
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.faults import DepthFaults, Faults, Mounting, PoseNoise, with_faults
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import Sequence, shutter_of
from tracknoise.sequences.views import View, view
from tracknoise.tables.identity import Direction, SequenceId

CAMERA = Camera(64, 48, 60.0, 61.0, 31.0, 24.0)


def recorded(count: int = 5, *, camera: CameraModel = CAMERA, rate_hz: float | None = 10.0) -> RecordedSequence:
    """1 m to the right and 10 degrees about z per frame; depth 2 m plus the number of the frame."""
    poses = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    poses[:, 0, 3] = range(count)
    poses[:, :3, :3] = Rotation.from_euler("z", 10.0 * np.arange(count)[:, None], degrees=True).as_matrix()
    return RecordedSequence(
        id=SequenceId("made", "up"),
        source="memory",
        camera=camera,
        world_from_camera=poses,
        images=lambda index: np.full((48, 64), index, np.uint8),
        depths=lambda index: DepthMap(np.full((48, 64), 2.0 + index), np.ones((48, 64), np.bool_)),
        timestamps_s=None if rate_hz is None else np.arange(count) / rate_hz,
    )


def motion(stated: np.ndarray, given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation vectors (degrees) and translations by which stated poses differ, in the frame of the given ones."""
    between = np.linalg.inv(given) @ stated
    return Rotation.from_matrix(between[:, :3, :3]).as_rotvec(degrees=True), between[:, :3, 3]


def test_without_faults_the_sequence_is_returned() -> None:
    plain = recorded()
    assert with_faults(plain, Faults()) is plain


def test_images_and_times_stay_as_they_are_and_the_notes_say_what_is_wrong() -> None:
    plain = recorded()
    wrong = with_faults(plain, Faults(focal=0.12, depth=DepthFaults(lag_frames=1.0)))
    assert isinstance(wrong, Sequence)
    np.testing.assert_array_equal(wrong.image(3), plain.image(3))
    np.testing.assert_array_equal(wrong.timestamps_s, plain.timestamps_s)
    assert wrong.notes[-1] == "the stated truth has planted faults: focal = 0.12, depth.lag_frames = 1.0"


@pytest.mark.parametrize("faults", [Faults(clock_s=0.05), Faults(clock_frames=0.5)])
def test_the_stated_pose_at_the_time_of_a_frame_plus_the_offset_fits_its_image(faults: Faults) -> None:
    stated = with_faults(recorded(), faults).world_from_camera
    np.testing.assert_allclose(stated[:, 0, 3], np.arange(5) - 0.5, rtol=0, atol=1e-12)
    angles = Rotation.from_matrix(stated[:, :3, :3]).as_euler("zyx", degrees=True)[:, 0]
    np.testing.assert_allclose(angles, 10.0 * (np.arange(5) - 0.5), rtol=0, atol=1e-9)


def test_focal_length_principal_point_and_k1_are_changed_in_what_is_stated() -> None:
    faults = Faults(focal=0.1, principal_point_px=(3.0, -2.0), k1=0.01)
    found = with_faults(recorded(camera=Camera(64, 48, 60.0, 70.0, 31.0, 24.0)), faults).camera
    assert found == Camera(64, 48, 66.0, 77.0, 34.0, 22.0, (0.01, 0.0, 0.0, 0.0))
    brown = replace(CAMERA, distortion=(-0.25, 0.1, 0.001, 0.002, 0.03))
    assert with_faults(recorded(camera=brown), Faults(k1=0.125)).camera.distortion == (-0.125, 0.1, 0.001, 0.002, 0.03)
    fisheye = EquidistantCamera(64, 48, 30.0, 30.0, 31.5, 23.5, (0.1, 0.0, 0.0, 0.0))
    assert with_faults(recorded(camera=fisheye), Faults(k1=-0.1)).camera.distortion == (0.0, 0.0, 0.0, 0.0)


def test_each_frame_of_a_changing_camera_is_wrong() -> None:
    @dataclass(frozen=True, eq=False)
    class Zooming(View):
        def camera_at(self, index: int) -> CameraModel:
            return replace(CAMERA, fx=60.0 + index)

    wrong = with_faults(Zooming(recorded()), Faults(focal=0.1))
    assert wrong.camera_at(4).fx == pytest.approx(70.4)


def test_mounting_gives_the_poses_of_another_sensor() -> None:
    mounting = Mounting(rotation_deg=(0.0, 5.0, 0.0), position_m=(0.1, 0.0, 0.02))
    plain = recorded()
    turned, moved = motion(with_faults(plain, Faults(mounting=mounting)).world_from_camera, plain.world_from_camera)
    np.testing.assert_allclose(turned, np.tile([0.0, 5.0, 0.0], (5, 1)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(moved, np.tile([0.1, 0.0, 0.02], (5, 1)), rtol=0, atol=1e-12)


def test_white_pose_noise_has_the_stated_size_in_each_axis() -> None:
    plain = recorded(4000)
    noise = PoseNoise(rotation_deg=0.2, position_m=0.01)
    turned, moved = motion(with_faults(plain, Faults(poses=noise)).world_from_camera, plain.world_from_camera)
    np.testing.assert_allclose(turned.std(axis=0), 0.2, rtol=0.05)
    np.testing.assert_allclose(moved.std(axis=0), 0.01, rtol=0.05)
    assert abs(np.corrcoef(turned[1:, 0], turned[:-1, 0])[0, 1]) < 0.05


def test_the_error_of_a_walk_grows_with_the_root_of_the_frames_between() -> None:
    plain = recorded(4000)
    noise = PoseNoise(rotation_walk_deg=0.02, position_walk_m=0.001)
    turned, moved = motion(with_faults(plain, Faults(poses=noise)).world_from_camera, plain.world_from_camera)
    for errors, size in ((turned, 0.02), (moved, 0.001)):
        for frames in (1, 9):
            steps = errors[frames:] - errors[:-frames]
            np.testing.assert_allclose(steps.std(axis=0), size * np.sqrt(frames), rtol=0.15)


def test_pose_noise_depends_on_the_seed_but_not_on_the_number_of_frames() -> None:
    faults = Faults(poses=PoseNoise(rotation_deg=0.2, position_walk_m=0.01))
    short, long, other = (
        with_faults(recorded(count), faults, seed=seed).world_from_camera for count, seed in ((5, 0), (9, 0), (5, 1))
    )
    np.testing.assert_array_equal(short, long[:5])
    assert np.any(short != other)


def test_frames_without_a_pose_stay_without_one() -> None:
    plain = recorded()
    poses = plain.world_from_camera.copy()
    poses[2] = np.nan
    gap = replace(plain, world_from_camera=poses)
    stated = with_faults(gap, Faults(poses=PoseNoise(rotation_deg=1.0))).world_from_camera
    assert np.isnan(stated).all(axis=(1, 2)).tolist() == [False, False, True, False, False]


def test_true_depth_is_scale_times_stated_depth_plus_offset() -> None:
    stated = with_faults(recorded(), Faults(depth=DepthFaults(scale=1.25, offset_m=0.5))).depth(1)
    np.testing.assert_allclose(stated.depth_m, (3.0 - 0.5) / 1.25, rtol=1e-12)


def test_depth_noise_has_the_stated_size_even_between_pixels() -> None:
    plain, faults = recorded(12), DepthFaults(noise_m=0.003, noise_quadratic_per_m=0.001)
    wrong = with_faults(plain, Faults(depth=faults))
    uv = np.random.default_rng(0).uniform(0, [63, 47], (2000, 2))
    for index in (0, 11):
        z = 2.0 + index
        size = np.hypot(0.003, 0.001 * z * z)
        read = [sample(with_faults(plain, wrong.faults, seed=seed).depth(index), uv, plain.camera) for seed in range(9)]
        assert np.mean([found.valid for found in read]) > 0.97
        errors = np.concatenate([found.depth_m[found.valid] - z for found in read])
        assert errors.std() == pytest.approx(size, rel=0.08)
        assert wrong.depth(index).accuracy.sigma_m(np.array([z]))[0] == pytest.approx(size)
    np.testing.assert_array_equal(wrong.depth(4).depth_m, wrong.depth(4).depth_m)
    assert abs(np.corrcoef((wrong.depth(4).depth_m - 6.0).ravel(), (wrong.depth(5).depth_m - 7.0).ravel())[0, 1]) < 0.2


def test_depth_is_rounded_to_steps() -> None:
    wrong = with_faults(recorded(), Faults(depth=DepthFaults(step_m=0.3)))
    np.testing.assert_allclose(wrong.depth(0).depth_m, 2.1, rtol=1e-12)
    assert not with_faults(recorded(), Faults(depth=DepthFaults(step_m=5.0))).depth(0).valid.any()


def test_there_is_no_depth_out_of_the_range_of_the_sensor() -> None:
    kinect = with_faults(recorded(), Faults(depth=DepthFaults(nearest_m=2.5, farthest_m=4.0)))
    assert [bool(kinect.depth(index).valid.all()) for index in range(4)] == [False, True, True, False]
    assert [bool(kinect.depth(index).valid.any()) for index in range(4)] == [False, True, True, False]
    with pytest.raises(ValueError, match=r"farthest_m is 1\.0, expected 0, or more than nearest_m"):
        DepthFaults(nearest_m=2.0, farthest_m=1.0)


def test_late_depth_of_a_recording_is_that_of_an_earlier_frame() -> None:
    wrong = with_faults(recorded(), Faults(depth=DepthFaults(lag_frames=2.0)))
    assert wrong.depth(1) is None
    np.testing.assert_array_equal(wrong.depth(3).depth_m, 3.0)
    with pytest.raises(SettingsError, match=r"lag_frames = 0\.5: expected a whole number"):
        with_faults(recorded(), Faults(depth=DepthFaults(lag_frames=0.5)))


def simulated(**faults: object) -> Sequence:
    size = {"width": 48, "height": 32, "frames": 4, "motions": ["sideways"]}
    return open_sequence("simulated", **size, faults=faults, imaging={"rate_hz": 30.0, "readout_s": 0.02})


def test_late_depth_of_a_simulation_is_exact_between_frames() -> None:
    plain, half, whole = (simulated(depth={"lag_frames": lag}) for lag in (0.0, 0.5, 1.0))
    np.testing.assert_array_equal(half.depth(2).depth_m, plain.depth_at(1.5).depth_m)
    np.testing.assert_allclose(whole.depth(3).depth_m, plain.depth(2).depth_m, rtol=1e-12)
    assert half.depth(0).valid.any()


def test_a_simulation_with_faults_offers_what_a_recording_would() -> None:
    wrong, plain = simulated(clock_frames=0.5), simulated()
    assert plain.truths == ("raycast", "birth")
    assert wrong.truths == ("birth",)
    assert wrong.surface is None
    assert wrong.pose_accuracy is None
    assert wrong.depth_accuracy == plain.depth_accuracy
    assert simulated(depth={"scale": 1.1}).depth_accuracy is None
    np.testing.assert_array_equal(wrong.image(2), plain.image(2))


def test_a_hidden_shutter_is_not_stated() -> None:
    assert shutter_of(simulated(hide_shutter=True)) is None
    assert shutter_of(simulated(focal=0.1)) == RollingShutter(0.02)


def test_a_copy_in_another_process_has_the_same_faults() -> None:
    wrong = simulated(poses={"rotation_deg": 0.3}, depth={"noise_m": 0.01})
    copy: Sequence = pickle.loads(pickle.dumps(wrong))
    np.testing.assert_array_equal(copy.world_from_camera, wrong.world_from_camera)
    np.testing.assert_array_equal(copy.depth(2).depth_m, wrong.depth(2).depth_m)


def test_views_show_the_faults() -> None:
    wrong = simulated(poses={"rotation_deg": 0.3}, focal=0.1)
    shown = view(wrong, n_frames=3, direction=Direction.backward, rotation=0)
    np.testing.assert_array_equal(shown.world_from_camera, wrong.world_from_camera[2::-1])
    assert shown.camera == wrong.camera


@pytest.mark.parametrize(
    ("sequence", "faults", "message"),
    [
        (recorded(rate_hz=None), Faults(clock_s=0.1), "clock_s = 0.1: memory has no times, expected clock_frames"),
        (recorded(1), Faults(clock_frames=0.1), "a clock offset and a single frame in memory"),
        (
            recorded(camera=DoubleSphereCamera(64, 48, 30.0, 30.0, 31.5, 23.5, 0.1, 0.5)),
            Faults(k1=0.1),
            "k1 = 0.1: found a DoubleSphereCamera, expected a radtan or equidistant lens",
        ),
    ],
)
def test_faults_that_do_not_suit_a_sequence_are_refused(sequence: Sequence, faults: Faults, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        with_faults(sequence, faults)
