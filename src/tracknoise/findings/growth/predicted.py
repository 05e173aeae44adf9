"""Autocorrelations of changes that a fitted second moment predicts.

Errors are the sum of independent parts, and zero at birth. Of successive changes, one step of s frames apart, with

- a^2 the part of white^2 that is independent from frame to frame; the rest is an offset that stays,
- r^2 = walk^2 s, d^2 = drift^2 s^2,
- q^2 = size^2 and phi, the correlation over a step, of an Ornstein-Uhlenbeck process,

the variance of the change that ends j steps after birth, and its product with the one l steps earlier, are

    V(j)    = 2 a^2 + r^2 + d^2 + q^2 (2 (1 - phi) - (1 - phi)^2 phi^(2 j - 2)),  with white^2 for 2 a^2 if j is 1
    C(j, l) = d^2 - a^2 [l is 1] - q^2 (1 - phi)^2 (phi^(l - 1) + phi^(2 j - l - 2))  (changes)

For errors that are measured from the first error of a process that is as large then as later, the terms in phi^j
vanish, and the rest of them is halved (relative). A second moment shows only white^2: a^2 is what the autocorrelation
at lag 1 asks for, between 0 and white^2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.statistics.definitions import LAGS

Array = NDArray[np.float64]

_LAGS = np.arange(1, LAGS + 1)
_LEAST = 1e-9


@dataclass(frozen=True, slots=True)
class Parts:
    """Parts of the errors of one condition; each (...), px^2 for one step of the tracker.

    Attributes
    ----------
    white, walk, drift, size
        white^2, r^2, d^2 and q^2 of (changes).
    phi
        Correlation of the process over a step.
    relative
        Whether errors are measured from the first error of the process (relative).
    """

    white: Array
    walk: Array
    drift: Array
    size: Array
    phi: Array
    relative: bool = False


def predicted(parts: Parts, counts: Array, steps: Array, first_lag: Array) -> Array:
    """Autocorrelations at every lag from 1 to `LAGS`, (lags, ...).

    Parameters
    ----------
    parts
        Each (...).
    counts : (places, ...)
        How many changes end a number of steps after birth. Tracks are taken as seen in every frame since.
    steps : (places,)
        That number, from 1 on, ascending.
    first_lag : (...)
        Measured autocorrelation at lag 1.
    """
    share = _shares(counts, steps)
    of_first = np.stack([share[lag - 1][steps == lag + 1].sum(axis=0) for lag in _LAGS])
    products, variances = _process(parts, share, steps)
    products = products + parts.drift
    variances = variances + parts.walk + parts.drift + of_first * parts.white / 2
    slope = 2 - of_first  # of the variance in a^2
    asked = (products[0] - first_lag * variances[0]) / np.maximum(1 + first_lag * slope[0], _LEAST)
    independent = np.clip(asked, 0.0, parts.white)
    lagged = products - independent * np.eye(LAGS)[0].reshape(-1, *[1] * independent.ndim)
    total = variances + slope * independent
    return np.asarray(lagged / np.where(total > 0, total, np.nan))


def _shares(counts: Array, steps: Array) -> Array:
    """Which share of the pairs of changes of a lag ends at each step, (lags, places, ...)."""
    ends = steps > _LAGS[:, None]
    pairs = np.where(ends.reshape(*ends.shape, *[1] * (counts.ndim - 1)), counts, 0.0)
    total = pairs.sum(axis=1, keepdims=True)
    return np.asarray(pairs / np.where(total > 0, total, 1.0))


def _process(parts: Parts, share: Array, steps: Array) -> tuple[Array, Array]:
    """Mean product and variance of the changes of the process, (lags, ...) each."""
    size, phi, apart = parts.size, parts.phi, 1 - parts.phi
    lag = _LAGS.reshape(-1, *[1] * phi.ndim)
    if not size.any():
        return np.zeros_like(lag * size), np.zeros_like(lag * size)
    if parts.relative:
        return -size / 2 * apart**2 * phi ** (lag - 1), size * apart * np.ones_like(lag * phi)

    def decayed(lags_before: float) -> Array:
        """Mean of phi^(2 j - 2 - lags_before l) over the pairs of each lag."""
        powers = np.maximum(2 * steps - 2 - lags_before * _LAGS[:, None], 0.0)
        decay = phi ** powers.reshape(*powers.shape, *[1] * phi.ndim)
        return np.asarray(np.einsum("lp...,lp...->l...", share, decay))

    products = -size * apart**2 * (phi ** (lag - 1) + decayed(1))
    return products, size * (2 * apart - apart**2 * (decayed(0) + decayed(2)) / 2)
