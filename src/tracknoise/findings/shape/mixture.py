"""A Gaussian of pairs contaminated by a wider one of the same mean and shape, fitted by expectation and maximisation.

p(x) = (1 - share) N(x; m, S) + share N(x; m, ratio S),  ratio >= 1 (mixture)

Where the components are similar, such steps are tiny. So after every two of them the fit is extrapolated in their
direction, by (squarem)

    x - 2 a r + a^2 v,  r = x1 - x, v = x2 - 2 x1 + x, a = -|r| / |v|

on scales without limits, x1 and x2 being one and two steps from x, and takes a step from there; where the likelihood is
less than it was at x1, it stays at x2. Source: R. Varadhan, C. Roland, Scandinavian Journal of Statistics 35 (2008).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.shape.elliptical import (
    combined,
    distance_weights,
    log_normaliser,
    moments,
    squared_distances,
    trace_ratio,
)

Array = NDArray[np.float64]

CYCLES = 10
"""Of three steps each. Of a thousand points each of a dozen kinds, from Student's t of 2 to 10 degrees of freedom to
mixtures, they leave 1e-5 nats an error at most to the likelihood of 1000 cycles; thirty plain steps leave 0.07."""
_LEAST, _FARTHEST, _ALMOST = 1e-300, 500.0, 1 - 1e-12
"""Bounds that keep (squarem) from overflow."""
_START = (0.1, 10.0)
_SHARES = (1e-4, 1 - 1e-4)
_MAX_RATIO = 1e8


@dataclass(frozen=True, slots=True)
class Mixture:
    """One fit per sample.

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


def fit_mixture(points: Array, *, cycles: int = CYCLES) -> Mixture:
    """A likely (mixture) of each sample, from one start: a tenth of the points of ten times the covariance.

    Parameters
    ----------
    points : (samples, 6, points)
        What `elliptical.terms` made; at least three points a sample that are not on a line.
    cycles
        How many.
    """
    total = points.sum(axis=2)
    fit = _first(total)
    for _ in range(cycles):
        one = _Expected.under(fit, points).next(points, total)
        at_one = _Expected.under(one, points)
        two = at_one.next(points, total)
        at_far = _Expected.under(_extrapolated(fit, one, two), points)
        better = at_far.log_likelihood(points, total) >= at_one.log_likelihood(points, total)
        fit = _chosen(better, at_far.next(points, total), two)
    return fit


def _first(total: Array) -> Mixture:
    mean, scatter = moments(total)
    share, ratio = (np.full(len(total), value) for value in _START)
    return Mixture(mean, scatter / (1 - share + share * ratio)[:, None], share, ratio)


@dataclass(frozen=True, slots=True)
class _Expected:
    """What a fit says of each point. Most of the time of a fit is spent here.

    Attributes
    ----------
    fit
        The mixture.
    weights : (samples, 6)
        `distance_weights` of its mean and scatter.
    odds : (samples, points)
        That a point is of the narrower component.
    """

    fit: Mixture
    weights: Array
    odds: Array

    @classmethod
    def under(cls, fit: Mixture, points: Array) -> "_Expected":
        """Of the points of each sample."""
        weights = distance_weights(fit.mean, fit.scatter)
        of_logarithm = weights * (-0.5 * (1 - 1 / fit.ratio))[:, None]
        of_logarithm[:, 0] += np.log((1 - fit.share) / fit.share * fit.ratio)
        odds = combined(of_logarithm, points)
        return cls(fit, weights, np.exp(odds, out=odds))

    def next(self, points: Array, total: Array) -> Mixture:
        """The next fit."""
        of_wide = 1 + self.odds
        wide = (points @ np.reciprocal(of_wide, out=of_wide)[:, :, None])[:, :, 0]
        mean, scatter = _core(total, wide, self.fit.ratio)
        share = (wide[:, 0] / total[:, 0]).clip(*_SHARES)
        ratio = (trace_ratio(_about(wide, mean), scatter) / (2 * wide[:, 0])).clip(1.0, _MAX_RATIO)
        return Mixture(mean, scatter, share, ratio)

    def log_likelihood(self, points: Array, total: Array) -> Array:
        """Log-likelihood of the fit, but for a constant, (samples,)."""
        fit, n = self.fit, total[:, 0]
        if_wide = n * np.log(fit.share / fit.ratio) - (self.weights * total).sum(axis=1) / (2 * fit.ratio)
        beyond = np.einsum("ij,ij->i", np.log1p(self.odds), points[:, 0])
        return np.asarray(if_wide + beyond + n * log_normaliser(fit.scatter)[:, 0])


def _extrapolated(fit: Mixture, one: Mixture, two: Mixture) -> Mixture:
    """(squarem); at least as far as the two steps went, and no farther where there is no direction."""
    x, x1, x2 = (_free(each) for each in (fit, one, two))
    r, v = x1 - x, x2 - 2 * x1 + x
    length = np.sqrt(np.square(r).sum(axis=0) / np.maximum(np.square(v).sum(axis=0), _LEAST))
    a = -np.maximum(length, 1.0)
    far = x - 2 * a * r + a**2 * v
    return _bound(np.where(np.isfinite(far) & (np.abs(far) < _FARTHEST), far, x2))


def _free(fit: Mixture) -> Array:
    """Parameters on scales without limits, (7, samples)."""
    uu, uv, vv = fit.scatter.T
    shape = np.arctanh((uv / np.sqrt(uu * vv)).clip(-_ALMOST, _ALMOST))
    odds = np.log(fit.share / (1 - fit.share))
    return np.array([*fit.mean.T, np.log(uu), np.log(vv), shape, odds, np.log(fit.ratio)])


def _bound(free: Array) -> Mixture:
    """The mixture of such parameters, within its limits."""
    u, v, log_uu, log_vv, shape, odds, log_ratio = free
    uu, vv = np.exp(log_uu), np.exp(log_vv)
    scatter = np.array([uu, np.tanh(shape) * np.sqrt(uu * vv), vv]).T
    share = (1 / (1 + np.exp(-odds))).clip(*_SHARES)
    return Mixture(np.array([u, v]).T, scatter, share, np.exp(log_ratio).clip(1.0, _MAX_RATIO))


def _chosen(first: NDArray[np.bool_], one: Mixture, other: Mixture) -> Mixture:
    """Of each sample one fit or the other."""
    row = first[:, None]
    return Mixture(
        np.where(row, one.mean, other.mean),
        np.where(row, one.scatter, other.scatter),
        np.where(first, one.share, other.share),
        np.where(first, one.ratio, other.ratio),
    )


def _core(total: Array, wide: Array, ratio: Array) -> tuple[Array, Array]:
    """Mean and scatter, given the points' sums and those of the wider component, which count 1 / ratio."""
    sums = total - wide + wide / ratio[:, None]
    mean, scatter = moments(sums)
    return mean, scatter * (sums[:, :1] / total[:, :1])


def _about(sums: Array, mean: Array) -> Array:
    """Second moments about a mean, summed: uu, uv, vv."""
    u, v = mean.T
    n, of_u, of_v, uu, uv, vv = sums.T
    found = np.empty((len(mean), 3))
    found[:, 0] = uu - 2 * u * of_u + n * u * u
    found[:, 1] = uv - u * of_v - v * of_u + n * u * v
    found[:, 2] = vv - 2 * v * of_v + n * v * v
    return found
