"""Numbers that correct the truth."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.audit.parameters import SLICES, Parameter


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
