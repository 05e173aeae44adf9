"""The result of a fit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.audit.normal import NormalEquations
from tracknoise.audit.parameters import Parameter, columns_of


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
