"""Stated uncertainty of the poses and depths of a recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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
    """Standard deviation of the error of a depth Z; 0 where it is exact.

    It is sqrt(constant_m^2 + (relative Z)^2 + (quadratic_per_m Z^2)^2).

    Parameters
    ----------
    constant_m
        The part that does not depend on the depth, metres.
    relative
        The part that is proportional to the depth, no unit.
    quadratic_per_m
        The part that is proportional to the square of the depth, as that of stereo, 1/m.
    """

    constant_m: float
    relative: float
    quadratic_per_m: float = 0.0

    def sigma_m(self, depth_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """(...) float64: the standard deviation at depths, metres."""
        varying = np.hypot(self.relative * depth_m, self.quadratic_per_m * depth_m * depth_m)
        return np.hypot(self.constant_m, varying)


EXACT_POSE = PoseAccuracy(0.0, 0.0)
EXACT_DEPTH = DepthAccuracy(0.0, 0.0)
