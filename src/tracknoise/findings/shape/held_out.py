"""How much better Student's t, or a mixture, predicts errors than a Gaussian does.

Independent units (scenes, or blocks of tracks) are put into a few folds. Each fold is scored by what was fitted to all
others. What counts is the log-likelihood that a density gives to what it was not fitted to, less that of the Gaussian
fitted to the same, in nats per error (gain). More parameters alone give no gain.

Student's t is fitted to all errors first; from there its fits to all folds but one have not far to go, and reach their
own optimum to 1e-5 nats. Those of the mixture may not, where its components are hardly distinguishable, and would keep
information on the fold that is left out: each of these starts from its usual start.
"""

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.shape.elliptical import determinant, gathered, terms
from tracknoise.findings.shape.gains import Gains
from tracknoise.findings.shape.gaussian import fit_gaussian
from tracknoise.findings.shape.mardia import whitening
from tracknoise.findings.shape.mixture import Mixture, fit_mixture
from tracknoise.findings.shape.student import Student, fit_student

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

MIN_FITTED = 50
"""Fewest errors outside of each fold."""
MAX_FITTED = 768
"""Most errors that are fitted; all errors of a fold are scored."""
ROUNDS = 15
"""Of the fits of Student's t that start from that of all errors."""


def gains(pairs: Array, sample: Rows, fold: Rows, count: int) -> Gains:
    """Work out (gain) for several samples at once.

    Parameters
    ----------
    pairs : (rows, 2)
        Errors, or anything that is linear in them.
    sample : (rows,)
        Of which sample each is, under `count`.
    fold : (rows,)
        Of which fold of it.
    count
        Number of samples.
    """
    every = terms([pairs])[0]
    samples = [np.flatnonzero(sample == place) for place in range(count)]
    split = [_split(rows, fold) for rows in samples]
    sums = _sums(every, sample, fold, count)
    usable = [place for place, parts in enumerate(split) if parts and _can_be_fitted(sums[:, place])]
    student, mixture = np.full(len(pairs), np.nan), np.full(len(pairs), np.nan)
    parameters = np.full((4, count), np.nan)
    if usable:
        parts = [part for place in usable for part in split[place]]
        of = np.repeat(np.arange(len(usable)), [len(split[place]) for place in usable])
        whole = fit_student(gathered(every, [_thinned(samples[place]) for place in usable]))
        start = Student(whole.mean[of], whole.scatter[of], whole.nu[of])
        heavy, mixed, gained = _scored(every, parts, start)
        for (rows, _), one, other in zip(parts, *gained, strict=True):
            student[rows], mixture[rows] = one[: len(rows)], other[: len(rows)]
        parameters[:, usable] = _parameters(heavy, mixed, of)
    return Gains(student, mixture, *parameters)


def _scored(every: Array, parts: list[tuple[Rows, Rows]], start: Student) -> tuple[Student, Mixture, Array]:
    """Fits to all folds but one, and their (gain) on that fold, (2, folds, most errors). The t starts at `start`."""
    fitted = gathered(every, [_thinned(rest) for _, rest in parts])
    heavy, mixed = fit_student(fitted, rounds=ROUNDS, start=start), fit_mixture(fitted)
    scored = gathered(every, [rows for rows, _ in parts])
    base = fit_gaussian(fitted).log_density(scored)
    return heavy, mixed, np.stack([heavy.log_density(scored), mixed.log_density(scored)]) - base


def _parameters(heavy: Student, mixed: Mixture, of: Rows) -> Array:
    """nu, spread, share and ratio of each sample, from the fits of its folds, which follow one another."""
    each = np.log([heavy.nu, determinant(heavy.scatter) ** 0.25, mixed.share, mixed.ratio])
    means: Array = np.exp(np.stack([np.bincount(of, row) for row in each]) / np.bincount(of))
    return means


def _split(rows: Rows, fold: Rows) -> list[tuple[Rows, Rows]]:
    """Rows of each fold of a sample, and all others; empty if there is only one fold."""
    own = fold[rows]
    names = np.flatnonzero(np.bincount(own))
    inside = [own == name for name in names]
    return [(rows[each], rows[~each]) for each in inside] if len(names) > 1 else []


def _sums(every: Array, sample: Rows, fold: Rows, count: int) -> Array:
    """Sums of the terms over each fold of each sample, (6, count, folds); 0 where it has no such fold."""
    folds = int(fold.max(initial=0)) + 1
    place = sample * folds + fold
    totals: Array = np.stack([np.bincount(place, term, count * folds) for term in every])
    return totals.reshape(len(every), count, folds)


def _can_be_fitted(sums: Array) -> bool:
    """Whether there is enough outside of each fold, with a spread, from the sums of the terms over each."""
    folds = sums[:, sums[0] > 0]
    rest = folds.sum(axis=1, keepdims=True) - folds
    return bool(rest[0].min() >= MIN_FITTED and np.isfinite(whitening(rest)[1]).all())


def _thinned(rows: Rows) -> Rows:
    """At most `MAX_FITTED` of the rows, evenly spread over them."""
    if len(rows) <= MAX_FITTED:
        return rows
    return rows[np.arange(MAX_FITTED) * len(rows) // MAX_FITTED]
