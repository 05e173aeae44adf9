"""Student's t of pairs, fitted by expectation and maximisation.

Of pairs, the density is (student)

    p(x) = (1 + d2 / nu)^(-(nu + 2) / 2) / (2 pi sqrt(|S|)),  d2 = (x - m)^T S^-1 (x - m)

without any gamma function. One round takes a Newton step in 1 / nu on the likelihood itself (Liu and Rubin 1995, ECME),
then weights w = (nu + 2) / (nu + d2), then m = sum(w x) / sum(w) and S = sum(w (x - m) (x - m)^T) / sum(w): divided by
the sum of weights, not by the count, which has the same fixed point and gets there sooner (Kent, Tyler and Vardi 1994).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.shape.elliptical import log_normaliser, moments, squared_distances

Array = NDArray[np.float64]

ROUNDS = 40
"""At most: enough for nu to three digits, unless tails are so heavy that scenes differ by more than their errors do."""
_SETTLED = 1e-5
"""A fit whose nu and spread change by less than this share in a round is not continued."""
NU_RANGE = (0.5, 200.0)
"""Beyond the upper end it cannot be distinguished from a Gaussian: the two differ by 5e-5 nats there."""
_START = 8.0


@dataclass(frozen=True, slots=True)
class Student:
    """One fit per sample.

    Attributes
    ----------
    mean, scatter : (samples, 2), (samples, 3)
        m, and S as uu, uv, vv.
    nu : (samples,)
        Degrees of freedom.
    """

    mean: Array
    scatter: Array
    nu: Array

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
    first = start or Student(*moments(points.sum(axis=2)), np.full(len(points), _START))
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

    Parameters
    ----------
    t : (samples,)
        Where the step starts.
    scaled : (samples, points)
        t d2 of each point; padding has 0, and adds nothing.
    count : (samples,)
        How many points there are.
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
