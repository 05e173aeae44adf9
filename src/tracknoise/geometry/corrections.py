"""Corrections of what a recording states about its camera, poses, depths and clock."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from numbers import Real
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from tracknoise.checks import Positive, require, require_bounds
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.text import constructed

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Corrections:
    """What is to be changed in the stated geometry of a recording before true positions are computed.

    Each correction changes nothing by default. They apply to the recording as it was read, before its frames are
    chosen, turned or played backward.

    Parameters
    ----------
    focal_scale
        Factor of both focal lengths. The principal point stays.
    principal_point_px
        Added to cx and cy, px.
    k1
        Added to the first coefficient of radial-tangential distortion, no unit.
    depth_scale
        Factor of depths.
    depth_offset_m
        Added to depths, after the factor, metres.
    inverse_depth_offset_per_m
        Added to the inverse of depths, after factor and offset, 1/m. Where it is not positive, there is no depth.
    depth_along_ray
        Whether what is stated as depth, with its factor and offsets, is the distance along the ray.
    clock_offset_s
        The pose at the time of an image plus this fits the image, seconds. For recordings with timestamps.
    clock_offset_frames
        The same in frames, for recordings without timestamps.
    clock_drift
        Growth of this offset with time, seconds per second; it is 0 in the middle of the recorded poses. For recordings
        with timestamps.
    readout_s
        Added to the readout of the rolling shutter, seconds; that of a recording that states none is 0.
    mounting_rotation_deg
        Rotation of the camera in the frame that the stated poses belong to: axis times angle, degrees.
    mounting_translation_m
        Position of the camera in that frame, metres: world_from_camera = stated pose [R t; 0 1].

    Raises
    ------
    ValueError
        If a value is not finite, a factor is not positive, a drift is not above -1, or both clock offsets are given.
    """

    focal_scale: Positive = 1.0
    principal_point_px: tuple[float, float] = (0.0, 0.0)
    k1: float = 0.0
    depth_scale: Positive = 1.0
    depth_offset_m: float = 0.0
    inverse_depth_offset_per_m: float = 0.0
    depth_along_ray: bool = False
    clock_offset_s: float = 0.0
    clock_offset_frames: float = 0.0
    clock_drift: Annotated[float, Gt(-1)] = 0.0
    readout_s: float = 0.0
    mounting_rotation_deg: Triple = (0.0, 0.0, 0.0)
    mounting_translation_m: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(field.default, tuple):
                object.__setattr__(self, field.name, _checked(field.name, value, len(field.default)))
            elif isinstance(field.default, bool):
                require(isinstance(value, bool), field.name, value, "true or false")
            else:
                require(_is_finite(value), field.name, value, "a finite number")
        require_bounds(self)
        RollingShutter(self.readout_s)
        both = self.clock_offset_s != 0.0 and self.clock_offset_frames != 0.0
        require(not both, "clock_offset_frames", self.clock_offset_frames, "0 beside clock_offset_s")

    def __repr__(self) -> str:
        return constructed(self)

    @property
    def are_neutral(self) -> bool:
        """Whether nothing is changed."""
        return self == UNCORRECTED

    @property
    def change_depths(self) -> bool:
        """Whether depths are changed."""
        return any(self._changes(name) for name in _OF_DEPTHS)

    @property
    def sentences(self) -> tuple[str, ...]:
        """One sentence for each correction that changes something."""
        values = asdict(self)
        said = (_SENTENCES[name].format(_shown(values[name])) for name in _SENTENCES if self._changes(name))
        return tuple(sentence.replace(" 1 frames ", " 1 frame ") for sentence in said)

    def depths_m(self, stated_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """(...) float64: depths, metres, with their factor and offsets; 0 where none is left."""
        found_m = self.depth_scale * stated_m + self.depth_offset_m
        more = self.inverse_depth_offset_per_m
        if not more:
            return found_m
        bend = 1.0 + more * found_m
        return np.asarray(np.where((found_m > 0.0) & (bend > 0.0), found_m / np.where(bend > 0.0, bend, 1.0), 0.0))

    def _changes(self, name: str) -> bool:
        changed: bool = getattr(self, name) != getattr(UNCORRECTED, name)
        return changed


_OF_DEPTHS = ("depth_scale", "depth_offset_m", "inverse_depth_offset_per_m", "depth_along_ray")
_SENTENCES = {
    "focal_scale": "correction: focal lengths are multiplied by {}",
    "principal_point_px": "correction: the principal point is moved by {} px",
    "k1": "correction: {} is added to the radial distortion k1",
    "depth_scale": "correction: depths are multiplied by {}",
    "depth_offset_m": "correction: {} m is added to depths",
    "inverse_depth_offset_per_m": "correction: {} 1/m is added to inverse depths",
    "depth_along_ray": "correction: depths are taken as distances along the ray",
    "clock_offset_s": "correction: the pose of a frame is the one recorded {} s after it",
    "clock_offset_frames": "correction: the pose of a frame is the one recorded {} frames after it",
    "clock_drift": "correction: the clock of the poses runs faster by {} s per s, about the middle of the poses",
    "readout_s": "correction: {} s is added to the readout of the rolling shutter",
    "mounting_rotation_deg": "correction: the camera is rotated by {} deg (rotation vector) in the frame of the poses",
    "mounting_translation_m": "correction: the camera is moved by {} m in the frame of the poses",
}


def _shown(value: float | tuple[float, ...]) -> str:
    return f"{value:.6g}" if isinstance(value, float | int) else f"({', '.join(f'{number:.6g}' for number in value)})"


def _checked(name: str, values: object, count: int) -> tuple[float, ...]:
    """The numbers as a tuple, if they are finite and so many."""
    numbers = tuple(values) if isinstance(values, Iterable) else ()
    require(len(numbers) == count and all(map(_is_finite, numbers)), name, values, f"{count} finite numbers")
    return numbers


def _is_finite(value: object) -> bool:
    return isinstance(value, Real) and math.isfinite(value)


UNCORRECTED = Corrections()
"""Corrections that change nothing."""
