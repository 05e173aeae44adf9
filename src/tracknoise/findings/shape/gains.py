"""How much better other densities predict errors than a Gaussian: the numbers alone."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Gains:
    """What was gained on each error, and the fits' parameters; NaN for samples that are too small.

    Attributes
    ----------
    student, mixture : (rows,)
        Log-likelihood less that of the Gaussian, nats.
    nu, spread : (samples,)
        Student's degrees of freedom, and the fourth root of the determinant of its scatter: geometric means of the fits
        of all folds.
    share, ratio : (samples,)
        The mixture's: how many errors are of the wider component, and how many times larger its covariance is.
    """

    student: Array
    mixture: Array
    nu: Array
    spread: Array
    share: Array
    ratio: Array

    def expanded(self, rows: NDArray[np.bool_]) -> "Gains":
        """The same with NaN for the rows that were left out.

        Parameters
        ----------
        rows : (all rows,)
            Which of them these are.
        """
        student, mixture = np.full((2, len(rows)), np.nan)
        student[rows], mixture[rows] = self.student, self.mixture
        return replace(self, student=student, mixture=mixture)
