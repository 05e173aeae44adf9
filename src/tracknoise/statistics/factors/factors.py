"""Factors whose effects are reported, and the conditions at which they are compared."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

FACTORS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "tracker": (),
        "speed": ("tracker",),
        "lighting": ("tracker", "speed"),
        "rotation": ("tracker",),
        "direction": ("tracker",),
    }
)
"""For each factor, the columns of which each value is examined separately. Others are held at their reference."""
SCALARS: Mapping[str, str] = MappingProxyType({"lifetime": "frames", "outlier_ratio": "share"})
"""Statistics with one number per condition, and their units."""


@dataclass(frozen=True, slots=True)
class ReferenceCondition:
    """Where factors are held while another one varies.

    Parameters
    ----------
    lighting, direction, camera
        Names as in the tables.
    rotation
        Degrees.
    speed
        The nominal one.
    key_frames
        Where curves run along frames: the one in which errors are zero, by direction.
    """

    lighting: str
    rotation: int = 0
    direction: str = "forward"
    speed: int = 1
    key_frames: Mapping[str, int] = field(default_factory=dict)
    camera: str = ""
