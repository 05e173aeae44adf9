"""How much better Student's t, or a mixture, says what errors come next than a Gaussian does.

Half of what is independent (scenes, or blocks of tracks) is fitted, the other half is told, and then the other way
round. What counts is the log-likelihood that a density gives to what it was not fitted to, less that of the Gaussian
fitted to the same, in nats per error (gain). A density with more parameters gains nothing by having them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.shape.elliptical import determinant, terms
from tracknoise.findings.shape.gaussian import fit_gaussian
from tracknoise.findings.shape.mardia import whitening
from tracknoise.findings.shape.mixture import Mixture, fit_mixture
from tracknoise.findings.shape.student import Student, fit_student

Array = NDArray[np.float64]

MIN_FITTED = 50
"""Fewest errors in each half."""
MAX_FITTED = 1024
"""So many errors of a half are fitted at most; all of the other half are told."""


@dataclass(frozen=True, slots=True)
class Gains:
    """What was gained on each error, and the fits' parameters; NaN for samples too small to be halved.

    Attributes
    ----------
    student, mixture : (rows,)
        Log-likelihood less that of the Gaussian, nats.
    nu, spread : (samples,)
        Student's degrees of freedom, and the fourth root of the determinant of its scatter: geometric means of both
        halves' fits.
    share, ratio : (samples,)
        The mixture's: how many errors are of the wider component, and how many times larger its covariance is.
    """

    student: Array
    mixture: Array
    nu: Array
    spread: Array
    share: Array
    ratio: Array


def gains(pairs: Array, sample: NDArray[np.intp], half: NDArray[np.bool_], count: int) -> Gains:
    """Work out (gain) for several samples at once.

    Parameters
    ----------
    pairs : (rows, 2)
        Errors, or anything that is linear in them.
    sample : (rows,)
        Of which sample each is, under `count`.
    half : (rows,)
        Of which half of it.
    count
        Number of samples.
    """
    parts = [[np.flatnonzero((sample == place) & (half == side)) for side in (False, True)] for place in range(count)]
    usable = [place for place, (one, other) in enumerate(parts) if _fits(pairs[one]) and _fits(pairs[other])]
    fitted = terms([pairs[_thinned(rows)] for place in usable for rows in parts[place]])
    others = [rows for place in usable for rows in reversed(parts[place])]
    told = terms([pairs[rows] for rows in others])
    student, mixture = np.full(len(pairs), np.nan), np.full(len(pairs), np.nan)
    parameters = np.full((4, count), np.nan)
    if usable:
        base, heavy, mixed = fit_gaussian(fitted), fit_student(fitted), fit_mixture(fitted)
        reference = base.log_density(told)
        for gain, density in ((student, heavy.log_density(told)), (mixture, mixed.log_density(told))):
            for rows, values in zip(others, density - reference, strict=True):
                gain[rows] = values[: len(rows)]
        parameters[:, usable] = _parameters(heavy, mixed)
    return Gains(student, mixture, *parameters)


def _fits(pairs: Array) -> bool:
    """Whether a half is large enough, and has a spread."""
    if len(pairs) < MIN_FITTED:
        return False
    _, root = whitening(terms([pairs])[0].sum(axis=1))
    return bool(np.isfinite(root).all())


def _thinned(rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """At most `MAX_FITTED` of the rows, evenly spread over them."""
    if len(rows) <= MAX_FITTED:
        return rows
    return rows[np.arange(MAX_FITTED) * len(rows) // MAX_FITTED]


def _parameters(heavy: Student, mixed: Mixture) -> Array:
    """nu, spread, share and ratio of each sample, from the fits of its halves, which follow one another."""
    each = np.stack([heavy.nu, determinant(heavy.scatter) ** 0.25, mixed.share, mixed.ratio])
    halves: Array = np.exp(np.log(each).reshape(4, -1, 2).mean(axis=2))
    return halves
