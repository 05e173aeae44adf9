"""Stated uncertainty of the poses and depths of a recording."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PoseAccuracy:
    """Standard deviations of the error of a pose, the same for every frame and axis; 0 where poses are exact.

    Parameters
    ----------
    position_m
        Of each coordinate of the position, metres.
    rotation_rad
        Of the rotation about each axis, radians.
    """

    position_m: float
    rotation_rad: float


@dataclass(frozen=True, slots=True)
class DepthAccuracy:
    """Standard deviation of the error of a depth Z, which is sqrt(constant_m^2 + (relative Z)^2); 0 where it is exact.

    Parameters
    ----------
    constant_m
        The part that does not depend on the depth, metres.
    relative
        The part that is proportional to the depth, no unit.
    """

    constant_m: float
    relative: float


EXACT_POSE = PoseAccuracy(0.0, 0.0)
EXACT_DEPTH = DepthAccuracy(0.0, 0.0)
