"""Parameters whose derivatives are computed together."""

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType

from tracknoise.audit.parameters import NUMBERS, Parameter


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
