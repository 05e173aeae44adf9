"""The Gaussian of pairs: what the other densities are compared with."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.shape.elliptical import log_normaliser, moments, squared_distances

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Gaussian:
    """One fit per sample.

    Attributes
    ----------
    mean, scatter : (samples, 2), (samples, 3)
        Mean, and covariance as uu, uv, vv.
    """

    mean: Array
    scatter: Array

    def log_density(self, points: Array) -> Array:
        """Log density of each point, (samples, points); see `fit_gaussian` for `points`."""
        return log_normaliser(self.scatter) - 0.5 * squared_distances(points, self.mean, self.scatter)


def fit_gaussian(points: Array) -> Gaussian:
    """The most likely Gaussian of each sample.

    Parameters
    ----------
    points : (samples, 6, points)
        What `elliptical.terms` made; at least three points a sample that are not on a line.
    """
    return Gaussian(*moments(points.sum(axis=2)))
