"""Sequences whose stated truth is wrong in a known way: the options, and the wrong cameras, poses and depths."""

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from tracknoise.checks import NotNegative, Positive, require, require_bounds, require_finite
from tracknoise.exceptions import SettingsError
from tracknoise.geometry.accuracy import DepthAccuracy, PoseAccuracy
from tracknoise.geometry.cameras import Camera, CameraModel, EquidistantCamera, Intrinsics
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import PosePath, from_rotation
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.sequence import Sequence, TruthKind, camera_at, shutter_of
from tracknoise.sequences.views import View

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseNoise:
    """Random errors of poses, in the frame of the camera: T <- T exp(xi^). All are standard deviations per axis.

    Parameters
    ----------
    rotation_deg, position_m
        White noise, independent from frame to frame: degrees, metres.
    rotation_walk_deg, position_walk_m
        Steps of a random walk: degrees and metres per frame. After k frames the error has sqrt(k) times this size.
    """

    rotation_deg: NotNegative = 0.0
    position_m: NotNegative = 0.0
    rotation_walk_deg: NotNegative = 0.0
    position_walk_m: NotNegative = 0.0

    def __post_init__(self) -> None:
        require_bounds(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mounting:
    """Stated poses are those of another sensor, which is fixed to the camera.

    Parameters
    ----------
    rotation_deg
        Rotation vector of the sensor in the frame of the camera, degrees.
    position_m
        Position of the sensor in the frame of the camera, metres.
    """

    rotation_deg: Vector = (0.0, 0.0, 0.0)
    position_m: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("rotation_deg", "position_m"):
            value = getattr(self, name)
            require(all(map(math.isfinite, value)), name, [*value], "three finite numbers")


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthFaults:
    """Errors of depth maps.

    Parameters
    ----------
    scale, offset_m
        True depth is scale times stated depth plus offset_m, metres, where no other error is set.
    noise_m, noise_quadratic_per_m
        Standard deviation of the noise, sqrt(noise_m^2 + (noise_quadratic_per_m Z^2)^2): metres, 1/m. It is independent
        from frame to frame, and correlated over a few pixels.
    step_m
        Depths are rounded to multiples of this, metres; 0 for none.
    nearest_m, farthest_m
        The range of the sensor: there is no depth outside of it, metres; 0 for no limit.
    lag_frames
        The depth map of a frame is of a time this many frames earlier. Parts of a frame need a simulated sequence.
    """

    scale: Positive = 1.0
    offset_m: float = 0.0
    noise_m: NotNegative = 0.0
    noise_quadratic_per_m: NotNegative = 0.0
    step_m: NotNegative = 0.0
    nearest_m: NotNegative = 0.0
    farthest_m: NotNegative = 0.0
    lag_frames: NotNegative = 0.0

    def __post_init__(self) -> None:
        require_bounds(self)
        require_finite("offset_m", self.offset_m)
        in_order = not self.farthest_m or self.farthest_m > self.nearest_m
        require(in_order, "farthest_m", self.farthest_m, "0, or more than nearest_m")

    @property
    def noise(self) -> DepthAccuracy:
        """The noise as an accuracy."""
        return DepthAccuracy(self.noise_m, 0.0, self.noise_quadratic_per_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """What is wrong with the stated truth of a sequence. Images stay as they are.

    Parameters
    ----------
    clock_s, clock_frames
        Clock offset tau between images and poses, in seconds or in frames: the stated pose at the time of a frame plus
        tau fits its image. Between frames poses are interpolated.
    focal
        The stated focal lengths are the true ones times 1 + focal.
    principal_point_px
        What is added to the stated principal point, px.
    k1
        What is added to the first coefficient of the stated distortion, of a radtan or equidistant lens.
    hide_shutter
        A rolling shutter is stated to be a global shutter.
    poses, mounting, depth
        Errors of poses, the sensor that they belong to, and errors of depth maps.
    """

    clock_s: float = 0.0
    clock_frames: float = 0.0
    focal: Annotated[float, Gt(-1)] = 0.0
    principal_point_px: tuple[float, float] = (0.0, 0.0)
    k1: float = 0.0
    hide_shutter: bool = False
    poses: PoseNoise = field(default_factory=PoseNoise)
    mounting: Mounting = field(default_factory=Mounting)
    depth: DepthFaults = field(default_factory=DepthFaults)

    def __post_init__(self) -> None:
        require_bounds(self)
        for name in ("clock_s", "clock_frames", "k1"):
            require_finite(name, getattr(self, name))
        require(not (self.clock_s and self.clock_frames), "clock_frames", self.clock_frames, "0, as clock_s is given")
        shift = self.principal_point_px
        require(all(map(math.isfinite, shift)), "principal_point_px", [*shift], "two finite numbers")

    @property
    def move_poses(self) -> bool:
        """Whether stated poses differ from those given."""
        clock = self.clock_s or self.clock_frames
        return bool(clock) or self.poses != PoseNoise() or self.mounting != Mounting()

    def planted(self) -> tuple[str, ...]:
        """The settings that differ from the defaults, such as ``depth.lag_frames = 1.0``."""
        return tuple(f"{name} = {value}" for name, value in _changed(self, ""))


NO_FAULTS = Faults()


def _changed(settings: object, prefix: str) -> Iterator[tuple[str, object]]:
    """Settings that differ from their defaults, with those of nested settings."""
    default = type(settings)()
    for setting in fields(settings):  # type: ignore[arg-type]
        value = getattr(settings, setting.name)
        if is_dataclass(value):
            yield from _changed(value, f"{prefix}{setting.name}.")
        elif value != getattr(default, setting.name):
            yield prefix + setting.name, [*value] if isinstance(value, tuple) else value


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
    """The camera with the wrong focal length, principal point and distortion."""
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
        first, *rest = camera.distortion or _NO_DISTORTION
        return replace(camera, distortion=(first + k1, *rest))
    raise SettingsError(f"faults.k1 = {k1}: found a {type(camera).__name__}, expected a radtan or equidistant lens")


def stated_poses(sequence: Sequence, faults: Faults, rng: np.random.Generator) -> NDArray[np.float64]:
    """(n, 4, 4) float64: poses with the wrong clock, of the wrong sensor, and with noise, in this order."""
    turn = Rotation.from_rotvec(faults.mounting.rotation_deg, degrees=True)
    camera_from_sensor = from_rotation(turn.as_matrix(), faults.mounting.position_m)
    poses = _at_other_times(sequence, faults) @ camera_from_sensor
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


def _noise(count: int, noise: PoseNoise, rng: np.random.Generator) -> NDArray[np.float64]:
    """(n, 4, 4) float64: small motions in the frame of the camera."""
    chance = rng.standard_normal((count, 4, 3))
    walk = np.cumsum(chance[:, 2:], axis=0)
    turned_deg = noise.rotation_deg * chance[:, 0] + noise.rotation_walk_deg * walk[:, 0]
    moved_m = noise.position_m * chance[:, 1] + noise.position_walk_m * walk[:, 1]
    return from_rotation(Rotation.from_rotvec(turned_deg, degrees=True).as_matrix(), moved_m)


def require_lag(sequence: Sequence, lag_frames: float) -> None:
    """Check that a sequence has depth this many frames earlier."""
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


class _Stream(IntEnum):
    """Independent streams of random numbers."""

    poses = 0
    depth = 1


def with_faults(sequence: Sequence, faults: Faults, *, seed: int = 0) -> Sequence:
    """The sequence with a stated truth that is wrong; the sequence itself without any fault.

    `sequence`: any sequence. Its truth counts as correct; `seed`: random seed of noise. The noise of a scene depends on
    its name.
    """
    if faults == NO_FAULTS:
        return sequence
    faulty = FaultySequence(sequence, faults, seed)
    _ = faulty.camera, faulty.world_from_camera  # refuse faults that do not suit it before anything is measured
    require_lag(sequence, faults.depth.lag_frames)
    return faulty


@dataclass(frozen=True, eq=False)
class FaultySequence(View):
    """A sequence with faults in its stated camera, poses, shutter and depth. Made by `with_faults`.

    Ray-cast truth is not offered: it would use the true surface. Truth from depth at birth uses what is stated, as that
    of a recording does. Accuracies are not stated where there are faults, and the kind of depth counts as unknown:
    everything is looked for as in a recording.
    """

    faults: Faults  # what is wrong
    seed: int  # random seed of noise

    @property
    def camera(self) -> CameraModel:
        """The stated camera."""
        return stated_camera(self.sequence.camera, self.faults)

    def camera_at(self, index: int) -> CameraModel:
        """The stated camera of one frame."""
        return stated_camera(camera_at(self.sequence, index), self.faults)

    @cached_property
    def world_from_camera(self) -> NDArray[np.float64]:
        """(n, 4, 4) float64: the stated poses."""
        if not self.faults.move_poses:
            return self.sequence.world_from_camera
        return stated_poses(self.sequence, self.faults, self._generator(_Stream.poses))

    @property
    def pose_accuracy(self) -> PoseAccuracy | None:
        """That of the sequence shown; None where the stated poses are wrong."""
        return None if self.faults.move_poses else self.sequence.pose_accuracy

    @property
    def depth_accuracy(self) -> DepthAccuracy | None:
        """That of the sequence shown; None where the stated depths are wrong."""
        return self.sequence.depth_accuracy if self.faults.depth == DepthFaults() else None

    @property
    def shutter(self) -> RollingShutter | None:
        """The stated shutter."""
        return None if self.faults.hide_shutter else shutter_of(self.sequence)

    @property
    def truths(self) -> tuple[str, ...]:
        """Those of the sequence shown, without ray cast."""
        return tuple(kind for kind in self.sequence.truths if kind != TruthKind.raycast)

    @property
    def surface(self) -> None:
        """None: the exact surface is not what a recording with these faults would state."""
        return None

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the sequence shown, and what is wrong."""
        return (*self.sequence.notes, f"the stated truth has planted faults: {', '.join(self.faults.planted())}")

    def depth(self, index: int) -> DepthMap | None:
        """The stated depth of one frame: see `Sequence.depth`."""
        faults = self.faults.depth
        depth = depth_with_lag(self.sequence, index, faults.lag_frames)
        if faults == replace(DepthFaults(), lag_frames=faults.lag_frames):
            return depth
        return None if depth is None else stated_depth(depth, faults, self._generator(_Stream.depth, index))

    def _generator(self, stream: _Stream, index: int = 0) -> np.random.Generator:
        """A generator that does not depend on the order in which frames are read."""
        scene = zlib.crc32(self.sequence.id.scene.encode())
        return np.random.default_rng([self.seed, stream, scene, index])
