"""What can be wrong with a stated truth, as numbers that are fitted to the errors of tracks.

- Parameters whose derivatives are computed together.
- Numbers that correct the truth.
- Parameters in units that engineers use, beside their stated values.
- The result of a fit.
"""

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
    depth_scale, depth_offset: true depth = scale * depth + offset. mounting_rotation, mounting_translation: the poses
    belong to another sensor, in whose frame the camera is turned and placed like this. clock_offset: the pose at the
    time of a frame plus this fits its image. readout: time from the first row of an image to the last. ray_depth: 1 if
    depths are distances along the ray, 0 if they are distances along the optical axis.
    """

    focal_length = "focal_length"
    principal_point = "principal_point"
    k1 = "k1"
    depth_scale = "depth_scale"
    depth_offset = "depth_offset"
    mounting_rotation = "mounting_rotation"
    mounting_translation = "mounting_translation"
    clock_offset = "clock_offset"
    readout = "readout"
    ray_depth = "ray_depth"


class Family(StrEnum):
    """Parameters that are fitted together.

    alone: one parameter. beside_bias: one parameter, beside a constant bias and a drift of each tracker. The others are
    joint fits: optics (focal length, principal point, k1), timing (clock offset, readout), depth (scale, offset),
    mounting (rotation, translation), optics_and_timing, all. named: the faults that were found, together.
    """

    alone = "alone"
    beside_bias = "beside_bias"
    optics = "optics"
    timing = "timing"
    depth = "depth"
    mounting = "mounting"
    optics_and_timing = "optics_and_timing"
    all = "all"
    named = "named"


_OPTICS = (Parameter.focal_length, Parameter.principal_point, Parameter.k1)
_TIMING = (Parameter.clock_offset, Parameter.readout)
JOINT: Mapping[Family, tuple[Parameter, ...]] = MappingProxyType(
    {
        Family.optics: _OPTICS,
        Family.timing: _TIMING,
        Family.depth: (Parameter.depth_scale, Parameter.depth_offset),
        Family.mounting: (Parameter.mounting_rotation, Parameter.mounting_translation),
        Family.optics_and_timing: (*_OPTICS, *_TIMING),
        Family.all: tuple(Parameter),
    }
)
"""The joint fits, and what is free in each."""


@dataclass(frozen=True, slots=True)
class Numbers:
    """The numbers of a parameter.

    Attributes
    ----------
    components
        Their names; one empty name for a single number.
    plausible
        A change so large that a smaller fault would still be worth correcting. Where an interval is wider than this to
        either side, the parameter cannot be determined.
    furthest
        Largest change that is tried.
    is_kind
        Whether the truth is one of two kinds, 0 or 1, and nothing between.
    """

    components: tuple[str, ...]
    plausible: float
    furthest: float
    is_kind: bool = False

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.components)


NUMBERS: Mapping[Parameter, Numbers] = MappingProxyType(
    {
        Parameter.focal_length: Numbers(("",), 0.1, 0.6),
        Parameter.principal_point: Numbers(("u", "v"), 20.0, 300.0),
        Parameter.k1: Numbers(("",), 0.2, 2.0),
        Parameter.depth_scale: Numbers(("",), 0.1, 0.6),
        Parameter.depth_offset: Numbers(("",), 0.2, 2.0),
        Parameter.mounting_rotation: Numbers(("x", "y", "z"), 0.05, 0.6),
        Parameter.mounting_translation: Numbers(("x", "y", "z"), 0.1, 1.0),
        Parameter.clock_offset: Numbers(("",), 1.0, 8.0),
        Parameter.readout: Numbers(("",), 1.0, 2.0),
        Parameter.ray_depth: Numbers(("",), 0.3, 2.0, is_kind=True),
    }
)
"""In the units of the fit: changes of factors from 1, px, metres, radians, frame intervals, and 0 or 1."""

TIMED = frozenset(_TIMING)
"""Parameters that need poses between frames."""
COUNT = sum(numbers.count for numbers in NUMBERS.values())
"""Numbers of all parameters together."""


def _slices() -> dict[Parameter, slice]:
    ends = np.cumsum([NUMBERS[one].count for one in Parameter]).tolist()
    return {one: slice(end - NUMBERS[one].count, end) for one, end in zip(Parameter, ends, strict=True)}


SLICES: Mapping[Parameter, slice] = MappingProxyType(_slices())
"""Where the numbers of each parameter are in the vector of all, (COUNT,)."""


def columns_of(parameters: Iterable[Parameter]) -> NDArray[np.intp]:
    """Places of the numbers of some parameters, in the order given."""
    places = [np.arange(SLICES[one].start, SLICES[one].stop) for one in parameters]
    return np.concatenate([np.empty(0, np.intp), *places]).astype(np.intp)


def furthest(parameters: Iterable[Parameter]) -> NDArray[np.float64]:
    """Largest change of each number that is tried."""
    found = [np.full(NUMBERS[one].count, NUMBERS[one].furthest) for one in parameters]
    return np.concatenate([np.empty(0), *found])


class Part(StrEnum):
    """What parameters correct: optics, depth, rotation or translation of the mounting, or time."""

    optics = "optics"
    depth = "depth"
    rotation = "rotation"
    translation = "translation"
    time = "time"


_PARAMETERS: Mapping[Part, tuple[Parameter, ...]] = MappingProxyType(
    {
        Part.optics: (Parameter.focal_length, Parameter.principal_point, Parameter.k1),
        Part.depth: (Parameter.depth_scale, Parameter.depth_offset, Parameter.ray_depth),
        Part.rotation: (Parameter.mounting_rotation,),
        Part.translation: (Parameter.mounting_translation,),
        Part.time: (Parameter.clock_offset, Parameter.readout),
    }
)
"""Parameters of each part, in the order of its columns."""


def _places() -> dict[Parameter, tuple[Part, slice]]:
    found = {}
    for part, parameters in _PARAMETERS.items():
        start = 0
        for one in parameters:
            found[one] = (part, slice(start, start + NUMBERS[one].count))
            start += NUMBERS[one].count
    return found


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
        px, deg, m, ms, frames, or empty.
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
        found: NDArray[np.float64] = np.array(self.stated) + self.factor * numbers
        return found


def shown(samples: AuditSamples, parameter: Parameter) -> Shown:
    """Unit and stated value of a parameter; factors and shifts where cameras differ."""
    camera = samples.cameras[0] if len(samples.cameras) == 1 else None
    nothing = (0.0,) * NUMBERS[parameter].count
    if parameter is Parameter.focal_length:
        return Shown("px", (camera.fx,), camera.fx) if camera else Shown("", (1.0,), 1.0)
    if parameter is Parameter.principal_point:
        return Shown("px", (camera.cx, camera.cy) if camera else nothing, 1.0)
    if parameter is Parameter.k1:
        known = isinstance(camera, Camera) and camera.distortion
        return Shown("", (camera.distortion[0],) if known and isinstance(camera, Camera) else nothing, 1.0)
    if parameter in (Parameter.depth_scale, Parameter.ray_depth):
        return Shown("", (1.0 if parameter is Parameter.depth_scale else 0.0,), 1.0)
    if parameter is Parameter.mounting_rotation:
        return Shown("deg", nothing, float(np.degrees(1.0)))
    if parameter in TIMED:
        return _timed(samples, parameter)
    return Shown("m", nothing, 1.0)


def _timed(samples: AuditSamples, parameter: Parameter) -> Shown:
    """Milliseconds, or frames where times are unknown."""
    unit, factor = ("frames", 1.0) if samples.interval_s is None else ("ms", _MS * samples.interval_s)
    readout = float(np.median(samples.readout)) if parameter is Parameter.readout else 0.0
    return Shown(unit, (factor * readout,), factor)


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
    design : (n, 2, columns) float64
        Derivatives of the corrected positions by the free numbers, then by the biases of each tracker.
    free : (columns,) intp
        Place of each free number in `theta`; the columns of biases come after them.
    equations
        Normal equations of each tracker and cluster.
    """

    parameters: tuple[Parameter, ...]
    with_bias: bool
    theta: NDArray[np.float64]
    error: NDArray[np.float64]
    residual: NDArray[np.float64]
    design: NDArray[np.float64]
    free: NDArray[np.intp]
    equations: NormalEquations

    @property
    def estimate(self) -> NDArray[np.float64]:
        """Values of the free numbers."""
        return self.theta[self.free]

    def places_of(self, parameter: Parameter) -> NDArray[np.intp]:
        """Columns of a parameter that was free."""
        return np.flatnonzero(np.isin(self.free, columns_of([parameter])))
