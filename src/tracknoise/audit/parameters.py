"""What can be wrong with a stated truth, as numbers that are fitted to the errors of tracks."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray


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
