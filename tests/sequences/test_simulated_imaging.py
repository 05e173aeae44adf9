"""Rendered effects against ray casting: each row of a rolled image is seen from the pose of its own time."""

import pickle

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.geometry.cameras import EquidistantCamera
from tracknoise.geometry.pose import PosePath, invert, transform
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.reader_registry import make_reader, open_sequence
from tracknoise.sequences.sequence import Sequence, shutter_of
from tracknoise.sequences.simulated import SimulatedSequence

RATE_HZ, READOUT_S, WIDTH, HEIGHT = 30.0, 0.03, 160, 120
ROLLED = {"rate_hz": RATE_HZ, "readout_s": READOUT_S}


def opened(motion: str = "arvr", frames: int = 12, **options: object) -> SimulatedSequence:
    small = {"motions": [motion], "frames": frames, "width": WIDTH, "height": HEIGHT, "noise_sigma": 0.0}
    sequence = open_sequence("simulated", **{**small, **options})
    assert isinstance(sequence, SimulatedSequence)
    return sequence


@pytest.fixture(scope="module")
def rolled() -> SimulatedSequence:
    return opened(imaging=ROLLED)


@pytest.fixture(scope="module")
def plain() -> SimulatedSequence:
    return opened()


def places(count: int = 300) -> np.ndarray:
    return np.random.default_rng(0).uniform(4.0, (WIDTH - 5, HEIGHT - 5), (count, 2))


def poses_at(sequence: Sequence, frames: np.ndarray) -> np.ndarray:
    return PosePath(np.arange(len(sequence), dtype=np.float64), sequence.world_from_camera).at(frames)


def row_times(index: int, v: np.ndarray) -> np.ndarray:
    """Times of rows, in frames, from the definition."""
    return index + RATE_HZ * READOUT_S * ((v + 0.5) / HEIGHT - 0.5)


def seen_at(sequence: SimulatedSequence, index: int, points: np.ndarray) -> np.ndarray:
    """Where points appear in a rolled image: the row fits the time of the pose (fixed-point iteration)."""
    v = np.full(len(points), (HEIGHT - 1) / 2)
    for _ in range(20):
        camera_from_world = invert(poses_at(sequence, row_times(index, v)))
        local = np.einsum("nij,nj->ni", camera_from_world[:, :3, :3], points) + camera_from_world[:, :3, 3]
        uv = sequence.camera.project(local)
        v = uv[:, 1]
    return uv


def test_timestamps_and_shutter_are_stated(rolled: SimulatedSequence, plain: SimulatedSequence) -> None:
    np.testing.assert_allclose(rolled.timestamps_s, np.arange(12) / 30.0)
    assert shutter_of(rolled) == RollingShutter(READOUT_S)
    assert plain.timestamps_s is None
    assert shutter_of(plain) is None


def test_a_row_of_a_rolled_image_is_that_of_an_image_at_its_time(rolled: SimulatedSequence) -> None:
    image = rolled.image(5)
    for row in (0, 30, 119):
        (pose,) = poses_at(rolled, row_times(5, np.array([float(row)])))
        whole = rolled.world.irradiance(rolled._optics, [pose])
        np.testing.assert_array_equal(image[row], np.clip(np.rint(whole[row] * 255.0), 0, 255))


def test_cast_points_of_a_rolled_image_project_back_with_their_rows(rolled: SimulatedSequence) -> None:
    uv = places()
    points, hit = rolled.cast(4, uv)
    assert hit.all()
    assert np.abs(seen_at(rolled, 4, points) - uv).max() < 1e-9
    still = rolled.camera.project(transform(invert(rolled.world_from_camera[4]), points))
    assert np.median(np.abs(still - uv)[:, 0]) > 0.02  # with the pose of the frame they would not


def test_depth_of_a_rolled_image_is_along_z_of_each_row(rolled: SimulatedSequence) -> None:
    v, u = np.indices((HEIGHT, WIDTH), dtype=np.float64)
    uv = np.stack([u.ravel(), v.ravel()], axis=-1)
    points, hit = rolled.cast(3, uv)
    camera_from_world = invert(poses_at(rolled, row_times(3, uv[:, 1])))
    z = np.einsum("nj,nj->n", camera_from_world[:, 2, :3], points) + camera_from_world[:, 2, 3]
    depth = rolled.depth(3)
    np.testing.assert_array_equal(depth.valid.ravel(), hit)
    np.testing.assert_allclose(depth.depth_m.ravel()[hit], z[hit], rtol=1e-12)


def test_features_of_rolled_images_move_as_the_rows_say() -> None:
    """Lucas-Kanade knows nothing of rows."""
    sequence = opened("fixating", imaging=ROLLED, width=WIDTH, height=HEIGHT)
    start, end = sequence.image(2), sequence.image(5)
    corners = cv2.goodFeaturesToTrack(start, 150, 0.02, 5).astype(np.float32)
    found, status, _ = cv2.calcOpticalFlowPyrLK(start, end, corners, None, winSize=(15, 15), maxLevel=3)
    tracked = status.ravel() == 1
    uv = corners[tracked, 0].astype(np.float64)
    points, _ = sequence.cast(2, uv)
    error = found[tracked, 0] - seen_at(sequence, 5, points)
    assert np.abs(np.median(error, axis=0)).max() < 0.05
    assert np.median(np.abs(error)) < 0.15


def test_a_rolled_image_of_a_still_camera_is_that_of_a_global_shutter(plain: SimulatedSequence) -> None:
    optics, pose = plain._optics, plain.world_from_camera[0]
    rows = np.broadcast_to(pose, (HEIGHT, 4, 4))
    np.testing.assert_allclose(
        plain.world.irradiance(optics, [rows]), plain.world.irradiance(optics, [pose]), rtol=0, atol=1e-6
    )


@pytest.mark.parametrize("imaging", [{}, {"rate_hz": 30.0}, {"rate_hz": 30.0, "exposure_renders": 3}])
def test_effects_of_size_zero_change_nothing(plain: SimulatedSequence, imaging: dict[str, float]) -> None:
    np.testing.assert_array_equal(opened(imaging=imaging).image(1), plain.image(1))


def test_blur_is_the_mean_of_images_over_the_exposure(plain: SimulatedSequence) -> None:
    blurred = opened(imaging={"rate_hz": RATE_HZ, "exposure_s": 0.03, "exposure_renders": 3})
    poses = poses_at(blurred, 6 + 0.9 * np.array([-1.0, 0.0, 1.0]) / 3)
    mean = np.mean([plain.world.irradiance(plain._optics, [pose]) for pose in poses], axis=0) * 255.0
    assert np.abs(blurred.image(6) - mean).max() <= 0.5 + 1e-3
    assert np.any(blurred.image(6) != plain.image(6))
    np.testing.assert_array_equal(blurred.depth(6).depth_m, plain.depth(6).depth_m)


def test_effects_do_not_depend_on_the_order_of_frames_or_the_process() -> None:
    effects = {
        **ROLLED,
        "auto_exposure": {"light_step": 1.4, "period_frames": 1, "delay_frames": 1},
        "photon_gain": 0.1,
        "prnu": 0.02,
        "dsnu": 1.0,
        "jpeg_quality": 90,
    }
    first = opened(frames=3, imaging=effects, noise_sigma=2.0)
    shown = [first.image(index) for index in (0, 1, 2)]
    copy: SimulatedSequence = pickle.loads(pickle.dumps(first))
    for index in (2, 0, 1):
        np.testing.assert_array_equal(copy.image(index), shown[index])


def test_the_second_camera_has_the_shutter_too() -> None:
    sequence = opened("sideways", frames=4, imaging=ROLLED, baseline_m=0.2)
    second = sequence.second.images(2)
    moved = poses_at(sequence, row_times(2, np.array([10.0])))[0]
    moved[:3, 3] += 0.2 * moved[:3, 0]
    whole = sequence.world.irradiance(sequence._optics, [moved])
    np.testing.assert_array_equal(second[10], np.clip(np.rint(whole[10] * 255.0), 0, 255))


@pytest.mark.parametrize("imaging", [{"rate_hz": RATE_HZ}, ROLLED])
def test_images_of_the_second_camera_may_be_late(imaging: dict[str, float]) -> None:
    """By a frame, they are those of the next frame; those of the first camera stay."""
    stated = opened(frames=4, imaging=imaging, baseline_m=0.2)
    late = opened(frames=4, imaging=imaging, baseline_m=0.2, second_delay_frames=1.0)
    np.testing.assert_array_equal(late.second.images(1), stated.second.images(2))
    np.testing.assert_array_equal(late.image(1), stated.image(1))
    half = opened(frames=4, imaging=imaging, baseline_m=0.2, second_delay_frames=0.5).second.images(1)
    assert not np.array_equal(half, stated.second.images(1))


def test_the_second_camera_may_have_another_lens() -> None:
    """A point on the surface is where the second lens shows it: with the same grey value as in the first image."""
    options = {"lens": "radtan", "distortion": [-0.1, 0.02, 0.0, 0.0], "hfov_deg": 70.0, "baseline_m": 0.2}
    of_second = {"second_lens": "equidistant", "second_distortion": [-0.02, 0.01, 0.0, 0.0], "second_hfov_deg": 100.0}
    sequence = opened("sideways", frames=3, supersampling=4, **options, **of_second)
    second = sequence.second
    assert isinstance(second.camera, EquidistantCamera)
    assert second.camera.distortion == (-0.02, 0.01, 0.0, 0.0)
    assert sequence.camera == opened("sideways", frames=3, **{**options, "baseline_m": 0.0}).camera
    narrow = opened("sideways", frames=3, **options, second_lens="pinhole", second_hfov_deg=50.0).second.camera
    assert (narrow.distortion, narrow.fx) == ((), pytest.approx(WIDTH / 2.0 / np.tan(np.deg2rad(25.0))))
    same = opened("sideways", frames=3, **options).second.camera
    assert same == sequence.camera
    uv = places()
    points, hit = sequence.cast(1, uv)
    pose = sequence.world_from_camera[1] @ second.first_from_second
    shown = second.camera.project(transform(invert(pose), points))
    inside = hit & second.camera.contains(shown)
    grey = [cv2.GaussianBlur(image, (0, 0), 1.0) for image in (sequence.image(1), second.images(1))]
    values = [
        cv2.remap(image, at[None, inside].astype(np.float32), None, cv2.INTER_LINEAR)[0].astype(float)
        for image, at in zip(grey, (uv, shown), strict=True)
    ]
    assert np.corrcoef(values)[0, 1] > 0.9


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"imaging": {"readout_s": 0.01}}, "imaging.readout_s is 0.01, expected 0, or a rate_hz"),
        ({"imaging": {"auto_exposure": {"light_step": 0}}}, "imaging.auto_exposure.light_step is 0"),
        ({"imaging": {"readout": 0.01}}, "imaging.readout: unknown setting .did you mean 'readout_s'"),
        ({"imaging": ROLLED, "frames": 1}, "frames is 1, expected at least 2"),
        ({"second_delay_frames": 1.0}, "second_delay_frames needs a baseline_m"),
        ({"second_hfov_deg": 50.0}, "second_hfov_deg needs a baseline_m"),
        ({"baseline_m": 0.1, "second_delay_frames": 1.0, "frames": 1}, "frames is 1, expected at least 2"),
        ({"baseline_m": 0.1, "second_lens": "equidistant"}, r"second_distortion is \[\], expected 4 numbers"),
        ({"baseline_m": 0.1, "second_lens": "glass"}, "unknown second_lens 'glass'"),
        ({"baseline_m": 0.1, "second_distortion": [np.nan]}, "second_distortion is .nan., expected finite numbers"),
        ({"faults": {"focal": -1.0}}, "faults.focal is -1.0, expected a number above -1"),
        ({"faults": {"clock_s": 0.1, "clock_frames": 1.0}}, "faults.clock_frames is 1.0, expected 0"),
    ],
)
def test_wrong_options_give_one_line_that_names_them(options: dict[str, object], message: str) -> None:
    with pytest.raises((SettingsError, UnknownNameError), match=message):
        make_reader("simulated", None, options)
