import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera
from tracknoise.simulation.imaging import AutoExposure, CameraPath, Imaging

CAMERA = Camera(8, 4, 10.0, 10.0, 3.5, 1.5)


def moving() -> np.ndarray:
    """1 m to the right and 10 degrees about y from frame to frame."""
    poses = np.broadcast_to(np.eye(4), (3, 4, 4)).copy()
    poses[:, 0, 3] = range(3)
    poses[:, :3, :3] = Rotation.from_euler("y", [[0.0], [10.0], [20.0]], degrees=True).as_matrix()
    return poses


def test_a_global_shutter_has_the_pose_of_the_frame() -> None:
    path = CameraPath(moving(), Imaging())
    np.testing.assert_array_equal(path.of_rows(1, CAMERA), moving()[1])
    assert len(list(path.during_exposure(1, CAMERA))) == 1


def test_each_row_has_the_pose_of_its_time() -> None:
    path = CameraPath(moving(), Imaging(rate_hz=10.0, readout_s=0.08))
    rows = path.of_rows(1, CAMERA)
    times = 1 + 0.8 * np.array([-3, -1, 1, 3]) / 8  # frames: the centres of four rows of equal time
    np.testing.assert_allclose(rows[:, 0, 3], times, rtol=0, atol=1e-12)
    angles = Rotation.from_matrix(rows[:, :3, :3]).as_euler("yxz", degrees=True)[:, 0]
    np.testing.assert_allclose(angles, 10.0 * times, rtol=0, atol=1e-9)


def test_with_negative_readout_the_last_row_comes_first() -> None:
    forward, backward = (CameraPath(moving(), Imaging(rate_hz=10.0, readout_s=time)) for time in (0.08, -0.08))
    np.testing.assert_allclose(forward.of_rows(1, CAMERA)[::-1], backward.of_rows(1, CAMERA), rtol=0, atol=1e-12)


def test_pixels_between_rows_have_times_between_them() -> None:
    path = CameraPath(moving(), Imaging(rate_hz=10.0, readout_s=0.08))
    poses = path.of_pixels(1, CAMERA, np.array([[0.0, 1.5], [7.0, 1.5], [3.0, 3.5]]))
    np.testing.assert_allclose(poses[:, 0, 3], [1.0, 1.0, 1.4], rtol=0, atol=1e-12)


def test_times_of_an_exposure_are_spread_evenly_around_the_frame() -> None:
    path = CameraPath(moving(), Imaging(rate_hz=10.0, exposure_s=0.04, exposure_renders=4))
    found = [pose[0, 3] for pose in path.during_exposure(1, CAMERA)]
    np.testing.assert_allclose(found, [0.85, 0.95, 1.05, 1.15], rtol=0, atol=1e-12)


def test_before_the_first_frame_the_motion_continues() -> None:
    path = CameraPath(moving(), Imaging())
    assert path.of_rows(-0.5, CAMERA)[0, 3] == pytest.approx(-0.5)


def test_brightness_changes_at_a_switch_and_returns_when_the_gain_has_followed() -> None:
    exposure = AutoExposure(light_step=2.0, period_frames=4, delay_frames=2)
    found = [exposure.brightness(index) for index in range(12)]
    assert found == [1, 1, 1, 1, 2, 2, 1, 1, 0.5, 0.5, 1, 1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"readout_s": 0.01}, "readout_s is 0.01, expected 0, or a rate_hz"),
        ({"readout_s": 0.2, "rate_hz": 10.0}, "readout_s is 0.2, expected at most the time between two frames"),
        ({"exposure_s": -0.1, "rate_hz": 10.0}, "exposure_s is -0.1"),
        ({"readout_s": float("nan"), "rate_hz": 10.0}, "readout_s is nan"),
        ({"vignetting": 1.5}, "vignetting is 1.5"),
        ({"jpeg_quality": 101}, "jpeg_quality is 101"),
        ({"exposure_renders": 0}, "exposure_renders is 0"),
        ({"prnu": -0.1}, "prnu is -0.1"),
    ],
)
def test_impossible_settings_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Imaging(**options)


def test_a_gain_that_follows_after_the_next_switch_is_refused() -> None:
    with pytest.raises(ValueError, match="delay_frames is 5"):
        AutoExposure(light_step=2.0, period_frames=4, delay_frames=5)
