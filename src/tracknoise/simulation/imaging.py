"""How a simulated camera takes images: from which poses, and how irradiance becomes grey levels."""

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, Positive, Share, require, require_bounds
from tracknoise.geometry.cameras import CameraModel, Intrinsics
from tracknoise.geometry.pose import PosePath
from tracknoise.geometry.shutter import RollingShutter

_MOST_RENDERS = 64
_MOST_QUALITY = 100
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class AutoExposure:
    """Light that is switched, and a gain that follows it after a delay.

    The light alternates between 1 and `light_step`. The gain of a frame is the reciprocal of the light some frames
    earlier. After each switch, images are therefore too bright or too dark by the factor `light_step` until the gain
    has followed.

    Parameters
    ----------
    light_step
        Ratio of the two levels of the light; 1 for constant light.
    period_frames
        Number of frames between two switches.
    delay_frames
        Number of frames after which the gain follows.

    Raises
    ------
    ValueError
        If a value is impossible, or the gain would not have followed before the next switch.
    """

    light_step: Positive = 1.0
    period_frames: Annotated[int, Ge(1)] = 10
    delay_frames: Annotated[int, Ge(0)] = 3

    def __post_init__(self) -> None:
        require_bounds(self)
        most = f"a number not above {self.period_frames}"
        require(self.delay_frames <= self.period_frames, "delay_frames", self.delay_frames, most)

    def brightness(self, index: int) -> float:
        """Light times gain in one frame, relative to constant light."""
        change = self._level(index) - self._level(max(index - self.delay_frames, 0))
        return float(self.light_step**change)

    def _level(self, index: int) -> int:
        return index // self.period_frames % 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Imaging:
    """How images are taken. By default all of an image is exposed at one instant, and only Gaussian noise is added.

    Parameters
    ----------
    rate_hz
        Frames per second, for timestamps; 0 for a camera without timestamps.
    readout_s
        Rolling shutter: time from the first to the last row of an image, seconds; negative where the last row comes
        first. 0 for a global shutter. See `tracknoise.geometry.shutter.RollingShutter`.
    exposure_s
        Exposure time, seconds. The time of a row is the middle of its exposure.
    exposure_renders
        An image with motion blur is the mean of this many images at times spread evenly over the exposure.
    auto_exposure
        Steps of light and gain.
    vignetting
        Share of the light that is lost in the corner farthest from the principal point. The loss grows with the
        square of the distance.
    photon_gain
        Grey levels per electron. The variance of photon noise at grey level I is photon_gain I; 0 for none.
    prnu
        Fixed pattern, photo response non-uniformity: standard deviation of the sensitivity of pixels, relative.
    dsnu
        Fixed pattern, dark signal non-uniformity: standard deviation of the offset of pixels, grey levels.
    jpeg_quality
        Quality of JPEG compression, 1 to 100; 0 for no compression.

    Raises
    ------
    ValueError
        If a value is impossible, or a time is given without a rate or is longer than a frame.
    """

    rate_hz: NotNegative = 0.0
    readout_s: float = 0.0
    exposure_s: NotNegative = 0.0
    exposure_renders: Annotated[int, Ge(1), Le(_MOST_RENDERS)] = 8
    auto_exposure: AutoExposure = field(default_factory=AutoExposure)
    vignetting: Share = 0.0
    photon_gain: NotNegative = 0.0
    prnu: NotNegative = 0.0
    dsnu: NotNegative = 0.0
    jpeg_quality: Annotated[int, Ge(0), Le(_MOST_QUALITY)] = 0

    def __post_init__(self) -> None:
        require_bounds(self)
        for name in ("readout_s", "exposure_s"):
            self._require_within_frame(name, getattr(self, name))

    def _require_within_frame(self, name: str, time_s: float) -> None:
        require(math.isfinite(time_s), name, time_s, "a finite number")
        require(time_s == 0.0 or self.rate_hz > 0.0, name, time_s, "0, or a rate_hz")
        within = abs(time_s) * self.rate_hz <= 1.0 + _ROUNDING
        require(within, name, time_s, "at most the time between two frames (1 / rate_hz)")

    @property
    def shutter(self) -> RollingShutter | None:
        """The rolling shutter; None for a global shutter."""
        return RollingShutter(self.readout_s) if self.readout_s else None


NO_EFFECTS = Imaging()
"""A global shutter, a short exposure, and no noise but that of the reader's `noise_sigma`."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraPath:
    """The path of a camera between its frames (truth.shutter).

    Between frames the position is linear in time and the rotation spherically linear. Times are counted in frames.
    """

    # (n, 4, 4) float64: the pose of each frame; n at least 2 if poses between frames are requested
    world_from_camera: NDArray[np.float64]
    imaging: Imaging  # rate, shutter and exposure

    def of_rows(self, frame: float, camera: CameraModel, *, late_s: float = 0.0) -> NDArray[np.float64]:
        """Pose of an image: (4, 4) float64, or (height, 4, 4), one for each row, with a rolling shutter.

        Parameters
        ----------
        frame
            Time of the middle of the image, in frames; times before the first and after the last frame are allowed.
        camera
            Of the image.
        late_s
            Seconds after this time.
        """
        rows = np.arange(camera.height, dtype=np.float64)
        return self._at(frame, camera, np.stack([np.zeros_like(rows), rows], axis=-1), late_s)

    def of_pixels(self, frame: float, camera: CameraModel, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pose of pixels (n, 2): (4, 4) float64, or (n, 4, 4) with a rolling shutter. Parameters as for `of_rows`."""
        return self._at(frame, camera, uv, 0.0)

    def during_exposure(self, frame: float, camera: CameraModel) -> Iterator[NDArray[np.float64]]:
        """Poses of the images whose mean is taken, each as from `of_rows`."""
        if not self.imaging.exposure_s:
            yield self.of_rows(frame, camera)
            return
        count = self.imaging.exposure_renders
        for index in range(count):
            late_s = self.imaging.exposure_s * ((index + 0.5) / count - 0.5)
            yield self.of_rows(frame, camera, late_s=late_s)

    def _at(self, frame: float, camera: CameraModel, uv: NDArray[np.float64], late_s: float) -> NDArray[np.float64]:
        shutter = self.imaging.shutter
        if shutter is not None:
            return self._between(frame + (shutter.delays_s(camera, uv) + late_s) * self.imaging.rate_hz)
        time = frame + late_s * self.imaging.rate_hz
        if time == int(time) and 0 <= time < len(self.world_from_camera):
            return np.asarray(self.world_from_camera[int(time)])
        return np.asarray(self._between(np.array([time]))[0])

    def _between(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return PosePath(np.arange(len(self.world_from_camera), dtype=np.float64), self.world_from_camera).at(times)


_FULL = np.float32(255.0)


class Sensor:
    """A sensor with a lens that vignettes, and the compression of its images.

    Parameters
    ----------
    camera
        Size of the images and principal point.
    imaging
        Effects. Shutter and exposure time are not effects of the sensor.
    noise_sigma
        Standard deviation of the Gaussian sensor noise, grey levels.
    pattern
        Random generator of the fixed pattern, which is the same in all images.
    """

    def __init__(
        self, camera: Intrinsics, imaging: Imaging, *, noise_sigma: float, pattern: np.random.Generator
    ) -> None:
        self._imaging, self._noise_sigma = imaging, noise_sigma
        shape = (camera.height, camera.width)
        sensitivity, offset = pattern.standard_normal((2, *shape), dtype=np.float32)
        falloff = _vignetting(camera, imaging.vignetting)
        self._response = falloff * (np.float32(1.0) + np.float32(imaging.prnu) * sensitivity)
        self._offset = np.float32(imaging.dsnu) * offset

    def image(self, irradiance: NDArray[np.float32], index: int, rng: np.random.Generator) -> NDArray[np.uint8]:
        """Image of one frame.

        Parameters
        ----------
        irradiance
            (height, width) float32, 1 is the sensor's full range.
        index
            Frame, on which the gain depends.
        rng
            Random generator of the noise.

        Returns
        -------
        (height, width) uint8
        """
        brightness = np.float32(self._imaging.auto_exposure.brightness(index))
        seen = irradiance * (brightness * np.maximum(self._response, 0.0))
        grain = photon_noise(seen, self._imaging.photon_gain, rng) + self._offset / _FULL
        image = expose(grain, self._noise_sigma, rng)
        return compressed(image, self._imaging.jpeg_quality) if self._imaging.jpeg_quality else image


def photon_noise(irradiance: NDArray[np.float32], gain: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Irradiance with photon noise: its variance at grey level I is gain I, grey levels squared.

    `gain`: 0 for no noise.
    """
    if gain == 0.0:
        return irradiance
    electrons = rng.poisson(irradiance.astype(np.float64) * (float(_FULL) / gain))
    return (electrons * (gain / float(_FULL))).astype(np.float32)


def expose(irradiance: NDArray[np.float32], noise_sigma: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Image that the sensor delivers.

    Parameters
    ----------
    irradiance
        (height, width) float32, 1 is the sensor's full range.
    noise_sigma
        Standard deviation of the Gaussian sensor noise, grey levels.
    rng
        Random generator of the noise.

    Returns
    -------
    (height, width) uint8
        Rounded, and clipped to 0..255.
    """
    grey = irradiance * _FULL
    if noise_sigma > 0.0:
        grey += np.float32(noise_sigma) * rng.standard_normal(grey.shape, dtype=np.float32)
    levels: NDArray[np.uint8] = np.clip(np.rint(grey), 0.0, 255.0).astype(np.uint8)
    return levels


def compressed(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """An image after JPEG compression and decompression."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


def _vignetting(camera: Intrinsics, loss: float) -> NDArray[np.float32]:
    """(height, width) float32: share of the light that reaches each pixel."""
    v, u = np.indices((camera.height, camera.width), dtype=np.float64)
    squared = np.square(u - camera.cx) + np.square(v - camera.cy)
    return np.asarray(1.0 - loss * squared / squared.max(), dtype=np.float32)


class Stream(IntEnum):
    """What random numbers are for."""

    world = 0
    path = 1
    noise = 2
    second_noise = 3
    pattern = 4
    second_pattern = 5
    inertial = 6


def generator(seed: int, stream: Stream, name: str, index: int = 0) -> np.random.Generator:
    """A generator that depends only on its arguments, so that frames can be rendered in any order."""
    return np.random.default_rng([seed, stream, zlib.crc32(name.encode()), index])
