"""Settings of how a simulated camera takes images: shutter, exposure, gain, noise and compression."""

import math
from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Ge, Le

from tracknoise.checks import NotNegative, Positive, Share, require, require_bounds
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
