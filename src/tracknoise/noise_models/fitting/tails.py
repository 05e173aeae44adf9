"""Tails of the errors: Student's t of untrimmed errors, in units of what the components give at their age."""

import math

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.groups import NO_GROUPS, SceneGroups
from tracknoise.findings.shape.elliptical import moments, terms
from tracknoise.findings.shape.student import Student, fit_student
from tracknoise.noise_models.covariances import error_covariances
from tracknoise.noise_models.fitting.equations import matrix
from tracknoise.noise_models.fitting.independent import group_numbers
from tracknoise.noise_models.model import Tails
from tracknoise.noise_models.track_noise import TrackNoise

Array = NDArray[np.float64]

_FOLDS = 5
_LEAST = 50
_MOST = 30_000
_GAUSSIAN = 200.0
"""Degrees of freedom that cannot be distinguished from a Gaussian."""
_ROUNDING = 1e-12
"""Ratio of two variances of which the smaller one may be rounding."""


def fit_tails(samples: pl.DataFrame, noise: TrackNoise, *, last_age: int, groups: SceneGroups = NO_GROUPS) -> Tails:
    """Fit Student's t to single errors; none where the components have noise in one direction only.

    Parameters
    ----------
    samples
        Schema `SAMPLES`, of one tracker and speed.
    noise
        The components.
    last_age
        Oldest age to use, frames of the recording.
    groups
        Of scenes that are not independent of each other.
    """
    used = samples.filter(pl.col("at") <= last_age)
    used = used.gather_every(max(1, -(-used.height // _MOST)))
    if used.height < _LEAST or not _is_in_all_directions(noise):
        return Tails(nu=math.inf, core_sigma=_core(used, noise), core_ratio=1.0)
    points = _whitened(used, noise)
    student = fit_student(terms([points]))
    ratio = float(np.linalg.det(matrix(student.scatter[0])) ** 0.25)
    nu = float(student.nu[0])
    if nu >= 0.99 * _GAUSSIAN or _gain(points, _folds(group_numbers(used, groups))) <= 0.0:
        nu, ratio = math.inf, 1.0
    return Tails(nu=nu, core_sigma=ratio * _core(used, noise), core_ratio=ratio)


def _is_in_all_directions(noise: TrackNoise) -> bool:
    """Whether errors of an age above 0 have a covariance of full rank."""
    least, largest = np.linalg.eigvalsh(noise.first + noise.white + noise.walk + noise.drift)
    return bool(least > _ROUNDING * largest)


def _whitened(samples: pl.DataFrame, noise: TrackNoise) -> Array:
    """Errors in units of the standard deviations of the model at their ages, (n, 2)."""
    errors = samples.select("du_px", "dv_px").to_numpy()
    roots = np.linalg.cholesky(_covariances(samples, noise))
    return np.asarray(np.linalg.solve(roots, errors[:, :, None])[:, :, 0])


def _core(samples: pl.DataFrame, noise: TrackNoise) -> float:
    """Root mean square of the standard deviations of the model at the ages of the sample, px."""
    if samples.is_empty():
        return 0.0
    return float(np.sqrt(0.5 * np.trace(_covariances(samples, noise), axis1=1, axis2=2).mean()))


def _covariances(samples: pl.DataFrame, noise: TrackNoise) -> Array:
    age = samples["at"].to_numpy().astype(np.float64)
    one = np.ones_like(age)
    return error_covariances(noise, age, one, one)


def _folds(group: NDArray[np.intp]) -> NDArray[np.intp]:
    """A number for each error, the same for all of a group; of halves of the sample where there is one group."""
    places = group % _FOLDS
    return places if len(np.unique(places)) > 1 else (np.arange(len(group)) * 2 // len(group)).astype(np.intp)


def _gain(points: Array, folds: NDArray[np.intp]) -> float:
    """What Student's t gains over a Gaussian on errors of scenes that were left out, nat in all."""
    total = 0.0
    for fold in np.unique(folds):
        rest, left = terms([points[folds != fold]]), terms([points[folds == fold]])
        student = fit_student(rest)
        mean, covariance = moments(rest.sum(axis=2))
        gaussian = Student(mean, covariance, np.array([_GAUSSIAN]))
        total += float((student.log_density(left) - gaussian.log_density(left)).sum())
    return total
