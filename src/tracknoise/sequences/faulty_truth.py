"""Stated cameras, poses and depth maps with faults, from correct ones."""

from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import SettingsError
from tracknoise.geometry.accuracy import DepthAccuracy
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.fisheye import EquidistantCamera
from tracknoise.geometry.interpolation import PosePath
from tracknoise.geometry.intrinsics import Intrinsics
from tracknoise.sequences.fault_options import DepthFaults, Faults, Mounting, PoseNoise
from tracknoise.sequences.sequence import Sequence

_NOISE_PX = 2.0
"""Depth noise is white noise blurred by this sigma, px: as that of stereo and structured light, it hardly changes
between neighbouring pixels, so that interpolation does not make it smaller."""
_NO_DISTORTION = (0.0, 0.0, 0.0, 0.0)


@runtime_checkable
class DepthAtAnyTime(Protocol):
    """A sequence that has depth between its frames."""

    def depth_at(self, frame: float) -> DepthMap:
        """Depth at a time in frames."""
        ...


def stated_camera(camera: CameraModel, faults: Faults) -> CameraModel:
    """The camera with the wrong focal length, principal point and distortion.

    Raises
    ------
    SettingsError
        If the camera has no such parameter.
    """
    du, dv = faults.principal_point_px
    if not (faults.focal or faults.k1 or du or dv):
        return camera
    if not isinstance(camera, Intrinsics):
        raise SettingsError(f"faults: found a camera {type(camera).__name__}, expected one with a focal length")
    ratio = 1.0 + faults.focal
    wrong = replace(camera, fx=camera.fx * ratio, fy=camera.fy * ratio, cx=camera.cx + du, cy=camera.cy + dv)
    return _distorted(wrong, faults.k1) if faults.k1 else wrong


def _distorted(camera: Intrinsics, k1: float) -> Intrinsics:
    """The camera with another first coefficient."""
    if isinstance(camera, EquidistantCamera):
        first, k2, k3, k4 = camera.distortion
        return replace(camera, distortion=(first + k1, k2, k3, k4))
    if isinstance(camera, Camera):
        first, *others = camera.distortion or _NO_DISTORTION
        return replace(camera, distortion=(first + k1, *others))
    raise SettingsError(f"faults.k1 = {k1}: found a {type(camera).__name__}, expected a radtan or equidistant lens")


def stated_poses(sequence: Sequence, faults: Faults, rng: np.random.Generator) -> NDArray[np.float64]:
    """(n, 4, 4) float64: poses with the wrong clock, of the wrong sensor, and with noise, in this order.

    Parameters
    ----------
    sequence
        With correct poses.
    faults
        What is wrong.
    rng
        Of the noise. The noise of a frame does not depend on the number of frames.

    Raises
    ------
    SettingsError
        If a clock offset is in seconds and the sequence has no times, or there is only one frame.
    """
    poses = _at_other_times(sequence, faults) @ _camera_from_sensor(faults.mounting)
    return poses @ _noise(len(sequence), faults.poses, rng)


def _at_other_times(sequence: Sequence, faults: Faults) -> NDArray[np.float64]:
    """Poses of the times of frames less the clock offset."""
    poses, offset = sequence.world_from_camera, faults.clock_s or faults.clock_frames
    if not offset:
        return poses
    times = sequence.timestamps_s if faults.clock_s else np.arange(len(sequence), dtype=np.float64)
    if times is None:
        raise SettingsError(f"faults.clock_s = {offset}: {sequence.source} has no times, expected clock_frames")
    if len(times) == 1:
        raise SettingsError(f"faults: found a clock offset and a single frame in {sequence.source}, expected several")
    return PosePath(times, poses).at(times - offset)


def _camera_from_sensor(mounting: Mounting) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(mounting.rotation_deg, degrees=True).as_matrix()
    pose[:3, 3] = mounting.position_m
    return pose


def _noise(count: int, noise: PoseNoise, rng: np.random.Generator) -> NDArray[np.float64]:
    """(n, 4, 4) float64: small motions in the frame of the camera."""
    chance = rng.standard_normal((count, 4, 3))
    walk = np.cumsum(chance[:, 2:], axis=0)
    turned_deg = noise.rotation_deg * chance[:, 0] + noise.rotation_walk_deg * walk[:, 0]
    motions = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
    motions[:, :3, :3] = Rotation.from_rotvec(turned_deg, degrees=True).as_matrix()
    motions[:, :3, 3] = noise.position_m * chance[:, 1] + noise.position_walk_m * walk[:, 1]
    return motions


def require_lag(sequence: Sequence, lag_frames: float) -> None:
    """Check that a sequence has depth this many frames earlier.

    Raises
    ------
    SettingsError
        If that lies between frames and the sequence has depth of its frames only.
    """
    if lag_frames != int(lag_frames) and not isinstance(sequence, DepthAtAnyTime):
        raise SettingsError(f"faults.depth.lag_frames = {lag_frames}: expected a whole number of frames")


def depth_with_lag(sequence: Sequence, index: int, lag_frames: float) -> DepthMap | None:
    """Depth of a time some frames earlier; None before the first frame, unless the sequence has depth at any time."""
    if lag_frames and isinstance(sequence, DepthAtAnyTime):
        return sequence.depth_at(index - lag_frames)
    earlier = index - int(lag_frames)
    return sequence.depth(earlier) if earlier >= 0 else None


def stated_depth(depth: DepthMap, faults: DepthFaults, rng: np.random.Generator) -> DepthMap:
    """The depth map with wrong scale and offset, noise and rounding, in this order, within the range of the sensor.

    Depths that are not positive afterwards, or out of range, are not valid. The accuracy of the map includes noise and
    rounding, so that these do not make visible points count as occluded.
    """
    true_m = np.where(depth.valid, depth.depth_m, 1.0).astype(np.float64)
    stated = (true_m - faults.offset_m) / faults.scale
    sigma_m = faults.noise.sigma_m(stated)
    if np.any(sigma_m):
        stated = stated + sigma_m * _smooth_noise(stated.shape, rng)
    if faults.step_m:
        stated = np.rint(stated / faults.step_m) * faults.step_m
    valid = depth.valid & (stated > 0.0) & (stated >= faults.nearest_m)
    if faults.farthest_m:
        valid &= stated <= faults.farthest_m
    return replace(depth, depth_m=stated, valid=valid, accuracy=_accuracy(depth.accuracy, faults))


def _smooth_noise(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float64]:
    """Noise of standard deviation 1 that is correlated over a few pixels."""
    white = rng.standard_normal(shape)
    impulse = np.zeros(shape)
    impulse[0, 0] = 1.0
    response = np.linalg.norm(gaussian_filter(impulse, _NOISE_PX, mode="wrap"))
    return np.asarray(gaussian_filter(white, _NOISE_PX, mode="wrap") / response, dtype=np.float64)


def _accuracy(given: DepthAccuracy, faults: DepthFaults) -> DepthAccuracy:
    """Accuracy of the map with noise, and with the error of rounding, which is uniform."""
    constant = float(np.linalg.norm([given.constant_m, faults.noise_m, faults.step_m / np.sqrt(12.0)]))
    quadratic = float(np.hypot(given.quadratic_per_m, faults.noise_quadratic_per_m))
    return DepthAccuracy(constant, given.relative, quadratic)
