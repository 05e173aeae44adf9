"""A Gaussian of pairs contaminated by a wider one of the same mean and shape, fitted by expectation and maximisation.

p(x) = (1 - share) N(x; m, S) + share N(x; m, ratio S),  ratio >= 1 (mixture)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.shape.elliptical import log_normaliser, moments, squared_distances, trace_ratio

Array = NDArray[np.float64]

ROUNDS = 30
"""Enough for the likelihood to 1e-5 nats where the components can be told apart."""
_START = (0.1, 10.0)
_SHARES = (1e-4, 1 - 1e-4)
_MAX_RATIO = 1e8


@dataclass(frozen=True, slots=True)
class Mixture:
    """One a sample.

    Attributes
    ----------
    mean, scatter : (samples, 2), (samples, 3)
        m, and S as uu, uv, vv.
    share, ratio : (samples,)
        Of the wider component: how many points are of it, and how many times larger its covariance is.
    """

    mean: Array
    scatter: Array
    share: Array
    ratio: Array

    def log_density(self, points: Array) -> Array:
        """Log density of each point, (samples, points); see `fit_mixture` for `points`."""
        distance = squared_distances(points, self.mean, self.scatter)
        core = np.log1p(-self.share)[:, None] - distance / 2
        wide = np.log(self.share / self.ratio)[:, None] - distance / (2 * self.ratio[:, None])
        return log_normaliser(self.scatter) + np.logaddexp(core, wide)


def fit_mixture(points: Array, *, rounds: int = ROUNDS) -> Mixture:
    """A likely (mixture) of each sample, from one start: a tenth of the points of ten times the covariance.

    Parameters
    ----------
    points : (samples, 6, points)
        What `elliptical.terms` made; at least three points a sample that are not on a line.
    rounds
        How many.
    """
    total = points.sum(axis=2)
    mean, scatter = moments(total)
    share, ratio = (np.full(len(points), value) for value in _START)
    scatter = scatter / (1 - share + share * ratio)[:, None]
    for _ in range(rounds):
        wide = (points @ _wide(squared_distances(points, mean, scatter), share, ratio)[:, :, None])[:, :, 0]
        mean, scatter = _core(total, wide, ratio)
        share = np.clip(wide[:, 0] / total[:, 0], *_SHARES)
        ratio = np.clip(trace_ratio(_about(wide, mean), scatter) / (2 * wide[:, 0]), 1.0, _MAX_RATIO)
    return Mixture(mean, scatter, share, ratio)


def _wide(distance: Array, share: Array, ratio: Array) -> Array:
    """Probability that each point is of the wider component."""
    odds = np.log((1 - share) / share * ratio)[:, None] - 0.5 * (1 - 1 / ratio)[:, None] * distance
    return 1 / (1 + np.exp(odds))


def _core(total: Array, wide: Array, ratio: Array) -> tuple[Array, Array]:
    """Mean and scatter, given the points' sums and those of the wider component, which count 1 / ratio."""
    sums = total - wide + wide / ratio[:, None]
    mean, scatter = moments(sums)
    return mean, scatter * (sums[:, :1] / total[:, :1])


def _about(sums: Array, mean: Array) -> Array:
    """Second moments about a mean, summed: uu, uv, vv."""
    u, v = mean.T
    n, of_u, of_v, uu, uv, vv = sums.T
    return np.stack(
        [uu - 2 * u * of_u + n * u * u, uv - u * of_v - v * of_u + n * u * v, vv - 2 * v * of_v + n * v * v], axis=1
    )
