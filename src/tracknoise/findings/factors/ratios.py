"""Differences between levels of a factor, relative to what is common to them: arrays only."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Ratios:
    """Differences and what is common to them, at any number of points, estimated from scenes.

    Attributes
    ----------
    difference, common : (points,) float64
        Signed differences, and what they are relative to, never negative.
    difference_parts, common_parts : (scenes, points) float64
        What each scene adds to the error of these: sums of squares and products over scenes are their (co)variances.
    degrees : (points,) float64
        Degrees of freedom of their variance: one less than the scenes, if these weigh the same.
    curve : (points,) intp
        Of which curve's range `common` is.
    curve_parts : (scenes, curves, places) float64
        What each scene adds to the error of these curves; no places if common is not a range.
    """

    difference: NDArray[np.float64]
    common: NDArray[np.float64]
    difference_parts: NDArray[np.float64]
    common_parts: NDArray[np.float64]
    degrees: NDArray[np.float64]
    curve: NDArray[np.intp]
    curve_parts: NDArray[np.float64]
