"""Settings of what is wrong with the stated truth of a sequence."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Annotated

from annotated_types import Gt

from tracknoise.checks import NotNegative, Positive, require, require_bounds, require_finite
from tracknoise.geometry.accuracy import DepthAccuracy

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

    Raises
    ------
    ValueError
        If one is negative.
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

    Raises
    ------
    ValueError
        If a number is not finite.
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

    Raises
    ------
    ValueError
        If a value is impossible.
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

    Raises
    ------
    ValueError
        If a value is impossible, or the clock offset is given twice.
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
    for item in fields(settings):  # type: ignore[arg-type]
        value = getattr(settings, item.name)
        if is_dataclass(value):
            yield from _changed(value, f"{prefix}{item.name}.")
        elif value != getattr(default, item.name):
            yield prefix + item.name, [*value] if isinstance(value, tuple) else value
