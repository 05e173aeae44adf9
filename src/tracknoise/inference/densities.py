"""Densities of pairs: the Gaussian, Student's t and a contaminated Gaussian, their fits, and their gains.

Student's t and the contaminated Gaussian are compared with the Gaussian: how much better they predict errors. Many
samples are fitted at once, on arrays only. What the densities have in common is that they depend on a squared distance
alone. A sample is given by the terms of its power sums to order 2: 1, u, v, u^2, uv, v^2 of each point. Squared
distances and weighted moments are then one matrix product each. Shorter samples are padded with zeros, which have no
effect.

Student's t is fitted by expectation and maximisation. Of pairs, the density is (student)

    p(x) = (1 + d2 / nu)^(-(nu + 2) / 2) / (2 pi sqrt(|S|)),  d2 = (x - m)^T S^-1 (x - m)

without any gamma function. One round takes a Newton step in 1 / nu on the likelihood itself (Liu and Rubin 1995, ECME),
then weights w = (nu + 2) / (nu + d2), then m = sum(w x) / sum(w) and S = sum(w (x - m) (x - m)^T) / sum(w). S is
divided by the sum of weights, not by the count, which has the same fixed point and gets there sooner (Kent, Tyler and
Vardi 1994).

The contaminated Gaussian is a mixture with a wider Gaussian of the same mean and shape, fitted by expectation and
maximisation, too:

    p(x) = (1 - share) N(x; m, S) + share N(x; m, ratio S),  ratio >= 1 (mixture)

Where the components are similar, the steps of its fit are tiny. So after every two of them the fit is extrapolated in
their direction, by (squarem)

    x - 2 a r + a^2 v,  r = x1 - x, v = x2 - 2 x1 + x, a = -|r| / |v|

on scales without limits, x1 and x2 being one and two steps from x. It takes a step from there. Where the likelihood is
less than it was at x1, it stays at x2. Source: R. Varadhan, C. Roland, Scandinavian Journal of Statistics 35 (2008).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TERMS = 6
_LOG_2PI = float(np.log(2 * np.pi))


def terms(samples: Sequence[Array]) -> Array:
    """Terms of samples of pairs, each (points, 2): (samples, 6, most points)."""
    padded = np.zeros((len(samples), _TERMS, max((len(points) for points in samples), default=0)))
    for place, points in enumerate(samples):
        u, v = np.ascontiguousarray(points.T)
        for row, values in enumerate((1.0, u, v, u * u, u * v, v * v)):
            padded[place, row, : len(points)] = values
    return padded


def gathered(every: Array, samples: Sequence[NDArray[np.intp]]) -> Array:
    """Terms of samples, each some of the columns of the terms of all points: (samples, 6, most points).

    Parameters
    ----------
    every : (6, points)
        Terms of one sample that holds all points.
    samples
        Which points each is of.
    """
    padded = np.zeros((len(samples), len(every), max(map(len, samples), default=0)))
    for place, points in enumerate(samples):
        padded[place, :, : len(points)] = np.take(every, points, axis=1)
    return padded


def moments(sums: Array) -> tuple[Array, Array]:
    """Mean, (samples, 2), and covariance as uu, uv, vv, (samples, 3), from weighted sums of terms, (samples, 6)."""
    mean, covariance = sums[:, 1:3] / sums[:, :1], sums[:, 3:] / sums[:, :1]
    u, v = mean.T
    covariance[:, 0] -= u * u
    covariance[:, 1] -= u * v
    covariance[:, 2] -= v * v
    return mean, covariance


def squared_distances(points: Array, mean: Array, scatter: Array) -> Array:
    """(x - mean)^T scatter^-1 (x - mean) of each point, (samples, points).

    Shapes: points (samples, 6, points), mean, scatter (samples, 2), (samples, 3).
    """
    squared = combined(distance_weights(mean, scatter), points)
    return np.maximum(squared, 0.0, out=squared)  # rounding may leave less than 0


def distance_weights(mean: Array, scatter: Array) -> Array:
    """The weights of the terms of which `squared_distances` are sums, (samples, 6)."""
    u, v = mean.T
    uu, uv, vv = _inverse(scatter).T
    of_u, of_v = uu * u + uv * v, uv * u + vv * v
    weights = np.empty((len(mean), _TERMS))
    weights[:, 0] = u * of_u + v * of_v
    weights[:, 1], weights[:, 2] = -2 * of_u, -2 * of_v
    weights[:, 3], weights[:, 4], weights[:, 5] = uu, 2 * uv, vv
    return weights


def combined(weights: Array, points: Array) -> Array:
    """Sums of the terms of each point with the weights of its sample, (samples, points); 0 for padding."""
    sums: Array = (weights[:, None, :] @ points)[:, 0]
    return sums


def trace_ratio(second: Array, scatter: Array) -> Array:
    """Trace of scatter^-1 times second, both as uu, uv, vv, (samples, 3): (samples,)."""
    inverse = _inverse(scatter)
    ratio: Array = (inverse * second) @ np.array([1.0, 2.0, 1.0])
    return ratio


def log_normaliser(scatter: Array) -> Array:
    """Log density of a Gaussian at its mean, (samples, 1)."""
    logs: Array = -_LOG_2PI - 0.5 * np.log(determinant(scatter))
    return logs[:, None]


def determinant(scatter: Array) -> Array:
    """Determinant of each scatter, (samples,)."""
    uu, uv, vv = scatter.T
    product: Array = uu * vv - uv * uv
    return product


def _inverse(scatter: Array) -> Array:
    inverse = np.empty_like(scatter)
    inverse[:, 0], inverse[:, 1], inverse[:, 2] = scatter[:, 2], -scatter[:, 1], scatter[:, 0]
    inverse /= determinant(scatter)[:, None]
    return inverse


@dataclass(frozen=True, slots=True)
class Gaussian:
    """One fit per sample."""

    # mean, scatter: (samples, 2): mean, and covariance as uu, uv, vv
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


ROUNDS = 40
"""At most: enough for nu to three digits, unless tails are so heavy that scenes differ by more than their errors do."""
_SETTLED = 1e-5
"""A fit whose nu and spread change by less than this share in a round is not continued."""
NU_RANGE = (0.5, 200.0)
"""Beyond the upper end it cannot be distinguished from a Gaussian: the two differ by 5e-5 nats there."""
_STUDENT_START = 8.0


@dataclass(frozen=True, slots=True)
class Student:
    """One fit per sample."""

    # mean, scatter: (samples, 2): m, and S as uu, uv, vv
    mean: Array
    scatter: Array
    nu: Array  # (samples,): degrees of freedom

    def log_density(self, points: Array) -> Array:
        """Log density of each point, (samples, points); see `fit_student` for `points`."""
        nu = self.nu[:, None]
        distance = squared_distances(points, self.mean, self.scatter)
        return log_normaliser(self.scatter) - 0.5 * (nu + 2) * np.log1p(distance / nu)


def fit_student(points: Array, *, rounds: int = ROUNDS, start: Student | None = None) -> Student:
    """The most likely (student) of each sample.

    Parameters
    ----------
    points : (samples, 6, points)
        What `elliptical.terms` made; at least three points a sample that are not on a line.
    rounds
        How many at most.
    start
        Where to start, if something is known; otherwise at the moments.
    """
    first = start or Student(*moments(points.sum(axis=2)), np.full(len(points), _STUDENT_START))
    fit = Student(first.mean.copy(), first.scatter.copy(), first.nu.copy())
    moving = np.arange(len(points))
    for _ in range(rounds):
        before = Student(fit.mean[moving], fit.scatter[moving], fit.nu[moving])
        after = _round(before, points)
        fit.mean[moving], fit.scatter[moving], fit.nu[moving] = after.mean, after.scatter, after.nu
        still = _moved(before, after) > _SETTLED
        if not still.all():
            moving, points = moving[still], points[still]
        if not len(moving):
            break
    return fit


def _round(fit: Student, points: Array) -> Student:
    """One round of each fit."""
    scaled = squared_distances(points, fit.mean, fit.scatter * fit.nu[:, None])
    inverse_nu = _newton(1 / fit.nu, scaled, points[:, 0].sum(axis=1))
    scaled *= (inverse_nu * fit.nu)[:, None]
    scaled += 1
    weight = np.reciprocal(scaled, out=scaled)  # but for a factor, which has no effect
    return Student(*moments((points @ weight[:, :, None])[:, :, 0]), 1 / inverse_nu)


def _moved(before: Student, after: Student) -> Array:
    """By which share nu or a variance changed, (samples,)."""
    variances = np.abs(after.scatter / before.scatter - 1)[:, [0, 2]].max(axis=1)
    changed: Array = np.maximum(np.abs(after.nu / before.nu - 1), variances)
    return changed


def _newton(t: Array, scaled: Array, count: Array) -> Array:
    """One step from t = 1 / nu towards the most likely, at most by a factor of 2.

    Shapes: t (samples,), scaled (samples, points), count (samples,).
    """
    mean_log = np.log1p(scaled).sum(axis=1) / count
    ratio = scaled / (1 + scaled)
    mean_ratio = ratio.sum(axis=1) / count
    mean_square = np.einsum("ij,ij->i", ratio, ratio) / count
    # L(t) = -(1 + 2 t) / (2 t) E log(1 + t d2), and its first two derivatives in t, times 2 t^2 and 2 t^3
    slope = mean_log - (1 + 2 * t) * mean_ratio
    bend = (1 + 2 * t) * mean_square - 2 * (mean_log - mean_ratio)
    step = np.where(bend < 0, -t * slope / np.where(bend < 0, bend, -1.0), np.copysign(np.inf, slope))
    low, high = NU_RANGE
    stepped: Array = (t + step).clip(t / 2, 2 * t).clip(1 / high, 1 / low)
    return stepped


_CYCLES = 10
"""Of three steps each. Of a thousand points each of a dozen kinds, from Student's t of 2 to 10 degrees of freedom to
mixtures, they leave 1e-5 nats an error at most to the likelihood of 1000 cycles; thirty plain steps leave 0.07."""
_LEAST, _FARTHEST, _ALMOST = 1e-300, 500.0, 1 - 1e-12
"""Bounds that keep (squarem) from overflow."""
_MIXTURE_START = (0.1, 10.0)
_SHARES = (1e-4, 1 - 1e-4)
_MAX_RATIO = 1e8


@dataclass(frozen=True, slots=True)
class Mixture:
    """One fit per sample."""

    # mean, scatter: (samples, 2): m, and S as uu, uv, vv
    mean: Array
    scatter: Array
    # share, ratio: (samples,): of the wider component: how many points are of it, and how many times larger its
    # covariance is
    share: Array
    ratio: Array

    def log_density(self, points: Array) -> Array:
        """Log density of each point, (samples, points); see `fit_mixture` for `points`."""
        distance = squared_distances(points, self.mean, self.scatter)
        core = np.log1p(-self.share)[:, None] - distance / 2
        wide = np.log(self.share / self.ratio)[:, None] - distance / (2 * self.ratio[:, None])
        return log_normaliser(self.scatter) + np.logaddexp(core, wide)


def fit_mixture(points: Array) -> Mixture:
    """A likely (mixture) of each sample, from one start: a tenth of the points of ten times the covariance.

    Parameters
    ----------
    points : (samples, 6, points)
        What `elliptical.terms` made; at least three points a sample that are not on a line.
    """
    total = points.sum(axis=2)
    fit = _first(total)
    for _ in range(_CYCLES):
        first_step = _Expected.under(fit, points).next(points, total)
        at_first = _Expected.under(first_step, points)
        second_step = at_first.next(points, total)
        at_far = _Expected.under(_extrapolated(fit, first_step, second_step), points)
        better = at_far.log_likelihood(points, total) >= at_first.log_likelihood(points, total)
        fit = _chosen(better, at_far.next(points, total), second_step)
    return fit


def _first(total: Array) -> Mixture:
    mean, scatter = moments(total)
    share, ratio = (np.full(len(total), value) for value in _MIXTURE_START)
    return Mixture(mean, scatter / (1 - share + share * ratio)[:, None], share, ratio)


@dataclass(frozen=True, slots=True)
class _Expected:
    """What a fit says of each point. Most of the time of a fit is spent here."""

    fit: Mixture  # the mixture
    weights: Array  # (samples, 6): `distance_weights` of its mean and scatter
    odds: Array  # (samples, points): that a point is of the narrower component

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


def _extrapolated(fit: Mixture, first_step: Mixture, second_step: Mixture) -> Mixture:
    """(squarem); at least as far as the two steps went, and no farther where there is no direction."""
    x, x1, x2 = (_free(mixture) for mixture in (fit, first_step, second_step))
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
    scatter = np.array([uu, np.tanh(shape).clip(-_ALMOST, _ALMOST) * np.sqrt(uu * vv), vv]).T
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
    moments = np.empty((len(mean), 3))
    moments[:, 0] = uu - 2 * u * of_u + n * u * u
    moments[:, 1] = uv - u * of_v - v * of_u + n * u * v
    moments[:, 2] = vv - 2 * v * of_v + n * v * v
    return moments


@dataclass(frozen=True, slots=True)
class Gains:
    """What was gained on each error, and the fits' parameters; NaN for samples that are too small."""

    # student, mixture: (rows,): log-likelihood less that of the Gaussian, nats
    student: Array
    mixture: Array
    # nu, spread: (samples,): Student's degrees of freedom, and the fourth root of the determinant of its scatter:
    # geometric means of the fits of all folds
    nu: Array
    spread: Array
    # share, ratio: (samples,): the mixture's: how many errors are of the wider component, and how many times larger its
    # covariance is
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
