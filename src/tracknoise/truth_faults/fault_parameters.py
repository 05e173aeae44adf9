"""What can be wrong with a stated truth, as numbers that are fitted to the errors of tracks."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera
from tracknoise.inference.robust_fits import NormalEquations
from tracknoise.truth_faults.audit_samples import AuditSamples


class Parameter(StrEnum):
    """A number, or a vector, that corrects a fault of the stated truth.

    focal_length: factor of fx and fy. principal_point: added to cx and cy. k1: added to the first radial coefficient.
    depth_scale, depth_offset: true depth = scale * depth + offset, and inverse_depth_offset is added to the inverse of
    this, as where stereo has a wrong disparity. mounting_rotation, mounting_translation: the poses
    belong to another sensor, in whose frame the camera is turned and placed like this. clock_offset: the pose at the
    time of a frame plus this fits its image. clock_drift: that offset grows with time; it is 0 in the middle of a
    sequence, and this at the end of the longest. readout: time from the first row of an image to the last.
    rotation_delay: rotations are late by this against positions, about each axis of the camera. smoothing: the true
    pose is the stated one minus this times its second difference in time, for positions and rotations; it is half the
    variance of a smoothing filter, and negative for poses that jitter and for a sharpened path. ray_depth: 1 if depths
    are distances along the ray, 0 if they are distances along the optical axis.
    """

    focal_length = "focal_length"
    principal_point = "principal_point"
    k1 = "k1"
    depth_scale = "depth_scale"
    depth_offset = "depth_offset"
    inverse_depth_offset = "inverse_depth_offset"
    mounting_rotation = "mounting_rotation"
    mounting_translation = "mounting_translation"
    clock_offset = "clock_offset"
    clock_drift = "clock_drift"
    readout = "readout"
    rotation_delay = "rotation_delay"
    smoothing = "smoothing"
    ray_depth = "ray_depth"


class Family(StrEnum):
    """Parameters that are fitted together.

    alone: one parameter. beside_bias: one parameter, beside a constant bias and a drift of each tracker. named: the
    faults that were found, together. at_most: what all faults, or random errors of depths, can explain at most of a
    tracker, which is the component (`tracknoise.truth_faults.explained`), what named faults explain of it, and how much
    more they move it than others.
    """

    alone = "alone"
    beside_bias = "beside_bias"
    named = "named"
    at_most = "at_most"


class Part(StrEnum):
    """What parameters correct: optics, depth, rotation or translation of the mounting, time, or the path's shape."""

    optics = "optics"
    depth = "depth"
    rotation = "rotation"
    translation = "translation"
    time = "time"
    path = "path"


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault of the truth: its numbers, its name, and how it is corrected.

    Attributes
    ----------
    name
        What it is called in text.
    part
        What it corrects.
    components
        Names of its numbers; one empty name for a single number.
    plausible
        A change so large that a smaller fault would still be worth correcting. Where an interval is wider than this to
        either side, the parameter cannot be determined.
    furthest
        Largest change that is tried.
    is_kind
        Whether the truth is one of two kinds, 0 or 1, and nothing between.
    by_depth
        Whether only depths that differ determine it.
    key
        Of its correction in the settings (`tracknoise.geometry.corrections.Corrections`); empty where none undoes it.
    is_factor
        Whether the correction is a factor rather than a change.
    in_frames
        The key where times are unknown; empty where it has no time.
    """

    name: str
    part: Part
    components: tuple[str, ...] = ("",)
    plausible: float
    furthest: float
    is_kind: bool = False
    by_depth: bool = False
    key: str = ""
    is_factor: bool = False
    in_frames: str = ""

    @property
    def count(self) -> int:
        """How many numbers there are."""
        return len(self.components)


_XYZ = ("x", "y", "z")
FAULTS: Mapping[Parameter, Fault] = MappingProxyType(
    {
        Parameter.focal_length: Fault(
            name="focal length",
            part=Part.optics,
            plausible=0.1,
            furthest=0.6,
            by_depth=True,
            key="focal_scale",
            is_factor=True,
        ),
        Parameter.principal_point: Fault(
            name="principal point",
            part=Part.optics,
            components=("u", "v"),
            plausible=20.0,
            furthest=300.0,
            key="principal_point_px",
        ),
        Parameter.k1: Fault(name="radial distortion k1", part=Part.optics, plausible=0.2, furthest=2.0, key="k1"),
        Parameter.depth_scale: Fault(
            name="scale of the depths against the camera's path",
            part=Part.depth,
            plausible=0.1,
            furthest=0.6,
            by_depth=True,
            key="depth_scale",
            is_factor=True,
        ),
        Parameter.depth_offset: Fault(
            name="offset of the depths",
            part=Part.depth,
            plausible=0.2,
            furthest=2.0,
            by_depth=True,
            key="depth_offset_m",
        ),
        Parameter.inverse_depth_offset: Fault(
            name="offset of the inverse depths",
            part=Part.depth,
            plausible=0.05,
            furthest=0.5,
            by_depth=True,
            key="inverse_depth_offset_per_m",
        ),
        Parameter.mounting_rotation: Fault(
            name="rotation between camera and poses",
            part=Part.rotation,
            components=_XYZ,
            plausible=0.05,
            furthest=0.6,
            key="mounting_rotation_deg",
        ),
        Parameter.mounting_translation: Fault(
            name="translation between camera and poses",
            part=Part.translation,
            components=_XYZ,
            plausible=0.1,
            furthest=1.0,
            by_depth=True,
            key="mounting_translation_m",
        ),
        Parameter.clock_offset: Fault(
            name="clock offset of the poses",
            part=Part.time,
            plausible=1.0,
            furthest=8.0,
            key="clock_offset_s",
            in_frames="clock_offset_frames",
        ),
        Parameter.clock_drift: Fault(
            name="clock drift of the poses",
            part=Part.time,
            plausible=1.0,
            furthest=8.0,
            key="clock_drift",
            in_frames="# needs timestamps: clock drift",
        ),
        Parameter.readout: Fault(
            name="readout time of the shutter",
            part=Part.time,
            plausible=1.0,
            furthest=2.0,
            key="readout_s",
            in_frames="# needs timestamps: readout in frames",
        ),
        Parameter.rotation_delay: Fault(
            name="delay of the rotations of the poses",
            part=Part.path,
            components=_XYZ,
            plausible=1.0,
            furthest=8.0,
        ),
        Parameter.smoothing: Fault(name="smoothing of the poses", part=Part.path, plausible=1.0, furthest=20.0),
        Parameter.ray_depth: Fault(
            name="kind of depth",
            part=Part.depth,
            plausible=0.3,
            furthest=2.0,
            is_kind=True,
            key="depth_along_ray",
        ),
    }
)
"""Sizes in the units of the fit: changes of factors from 1, px, metres, 1/m, radians, frame intervals or their squares,
and 0 or 1."""


def of_parts(*parts: Part) -> tuple[Parameter, ...]:
    """Parameters that correct some parts."""
    return tuple(parameter for parameter in Parameter if FAULTS[parameter].part in parts)


LIKE: tuple[tuple[Parameter, ...], ...] = (
    of_parts(Part.optics),
    of_parts(Part.time),
    (Parameter.depth_scale, Parameter.depth_offset),
    of_parts(Part.rotation, Part.translation),
)
"""Parameters that have much the same effect, so that one of them may have another value beside the others."""
TIMED = frozenset(of_parts(Part.time, Part.path))
"""Parameters that need poses between frames."""
COUNT = sum(fault.count for fault in FAULTS.values())
"""Numbers of all parameters together."""


def _slices() -> dict[Parameter, slice]:
    ends = np.cumsum([FAULTS[parameter].count for parameter in Parameter]).tolist()
    return {
        parameter: slice(end - FAULTS[parameter].count, end) for parameter, end in zip(Parameter, ends, strict=True)
    }


SLICES: Mapping[Parameter, slice] = MappingProxyType(_slices())
"""Where the numbers of each parameter are in the vector of all, (COUNT,)."""


def columns_of(parameters: Iterable[Parameter]) -> NDArray[np.intp]:
    """Places of the numbers of some parameters, in the order given."""
    places = [np.arange(SLICES[parameter].start, SLICES[parameter].stop) for parameter in parameters]
    return np.concatenate([np.empty(0, np.intp), *places]).astype(np.intp)


def furthest(parameters: Iterable[Parameter]) -> NDArray[np.float64]:
    """Largest change of each number that is tried."""
    limits = [np.full(FAULTS[parameter].count, FAULTS[parameter].furthest) for parameter in parameters]
    return np.concatenate([np.empty(0), *limits])


def _places() -> dict[Parameter, tuple[Part, slice]]:
    places = {}
    for part in Part:
        start = 0
        for parameter in of_parts(part):
            places[parameter] = (part, slice(start, start + FAULTS[parameter].count))
            start += FAULTS[parameter].count
    return places


PLACES: Mapping[Parameter, tuple[Part, slice]] = MappingProxyType(_places())
"""Part of each parameter, and its columns among those of the part."""


@dataclass(frozen=True, eq=False)
class Corrections:
    """Numbers of all parameters, `theta` (COUNT,); zeros for the truth as stated."""

    theta: NDArray[np.float64]

    def of(self, parameter: Parameter) -> NDArray[np.float64]:
        """Numbers of a parameter."""
        return self.theta[SLICES[parameter]]

    def number(self, parameter: Parameter) -> float:
        """The only number of a parameter."""
        return float(self.of(parameter)[0])

    @cached_property
    def mounting(self) -> NDArray[np.float64]:
        """Rotation from the camera to the sensor that the poses belong to, (3, 3)."""
        turned: NDArray[np.float64] = Rotation.from_rotvec(self.of(Parameter.mounting_rotation)).as_matrix()
        return turned


_MS = 1000.0


@dataclass(frozen=True, slots=True)
class Shown:
    """How a parameter is shown: value = stated + factor * number of the fit.

    Attributes
    ----------
    unit
        px, deg, m, m⁻¹, ms, frames, frames², ms/s, frames per 100, or empty.
    stated
        What the truth states, of each component.
    factor
        Unit of the fit in this unit.
    """

    unit: str
    stated: tuple[float, ...]
    factor: float

    def values(self, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        """Corrected values for numbers of the fit."""
        values: NDArray[np.float64] = np.array(self.stated) + self.factor * numbers
        return values


def shown(samples: AuditSamples, parameter: Parameter) -> Shown:
    """Unit and stated value of a parameter; factors and shifts where cameras differ."""
    camera = samples.cameras[0] if len(samples.cameras) == 1 else None
    nothing = (0.0,) * FAULTS[parameter].count
    if parameter is Parameter.focal_length:
        return Shown("px", (camera.fx,), camera.fx) if camera else Shown("", (1.0,), 1.0)
    if parameter is Parameter.principal_point:
        return Shown("px", (camera.cx, camera.cy) if camera else nothing, 1.0)
    if parameter is Parameter.k1:
        stated = camera.distortion[:1] if isinstance(camera, Camera) and camera.distortion else nothing
        return Shown("", stated, 1.0)
    if parameter in (Parameter.depth_scale, Parameter.ray_depth):
        return Shown("", (1.0 if parameter is Parameter.depth_scale else 0.0,), 1.0)
    if parameter is Parameter.mounting_rotation:
        return Shown("deg", nothing, float(np.degrees(1.0)))
    if parameter is Parameter.inverse_depth_offset:
        return Shown("m⁻¹", nothing, 1.0)
    if parameter in TIMED:
        return _timed(samples, parameter)
    return Shown("m", nothing, 1.0)


def _timed(samples: AuditSamples, parameter: Parameter) -> Shown:
    """Milliseconds, or frames where times are unknown; smoothing is in squares of frame intervals."""
    if parameter is Parameter.smoothing:
        return Shown("frames²", (0.0,), 1.0)
    if parameter is Parameter.clock_drift:
        unit, per = ("frames per 100", 100.0) if samples.interval_s is None else ("ms/s", _MS)
        return Shown(unit, (0.0,), per / samples.paths.longest_half)
    unit, factor = ("frames", 1.0) if samples.interval_s is None else ("ms", _MS * samples.interval_s)
    readout = float(np.median(samples.readout)) if parameter is Parameter.readout else 0.0
    return Shown(unit, (factor * readout,) * FAULTS[parameter].count, factor)


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A fit that has ended.

    Attributes
    ----------
    parameters
        What was free.
    with_bias
        Whether trackers had biases of their own.
    theta : (COUNT,) float64
        Numbers of all parameters; 0 where they were held.
    error : (n, 2) float64
        Observed minus corrected true positions, px; NaN where the corrected truth has none.
    residual : (n, 2) float64
        Errors without the biases of the trackers.
    slopes : (n, 2, columns) float64
        Derivatives of the corrected positions by the free numbers.
    free : (columns,) intp
        Place of each free number in `theta`.
    equations
        Normal equations of each tracker and cluster.
    """

    parameters: tuple[Parameter, ...]
    with_bias: bool
    theta: NDArray[np.float64]
    error: NDArray[np.float64]
    residual: NDArray[np.float64]
    slopes: NDArray[np.float64]
    free: NDArray[np.intp]
    equations: NormalEquations

    @property
    def estimate(self) -> NDArray[np.float64]:
        """Values of the free numbers."""
        return self.theta[self.free]

    def places_of(self, parameter: Parameter) -> NDArray[np.intp]:
        """Columns of a parameter that was free."""
        return np.flatnonzero(np.isin(self.free, columns_of([parameter])))
