"""Whether a fitted model agrees with the curve and with the autocorrelations of changes.

What the model misses is taken along a few directions: of the curve, weighted as in the fit, along powers of the age;
of the autocorrelations, at each lag, on average, and from early to late lags. Each is divided by its standard error,
from the jackknife over units, with the model fitted anew to all units but one. The largest of them is compared with
the largest that chance alone leads to (`tracknoise.findings.factors.rotation`). This is the p-value of (agreement).

With many scenes every model fails. A model is therefore refused if p is at most `ALPHA`, and it misses the curve by
more than `CURVE_TOLERANCE` or an autocorrelation by more than `LAG_TOLERANCE`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.findings.factors.rotation import best_by_chance, rotations, share_at_most
from tracknoise.findings.sampling.jackknife import degrees, parts

Array = NDArray[np.float64]

ALPHA = 0.01
"""Probability of a false refusal of a model that is true."""
CURVE_TOLERANCE = 0.05
"""Root mean square of what the curve may be missed by, relative to the second moment."""
LAG_TOLERANCE = 0.03
"""By how much an autocorrelation may be missed."""
POWERS = (-1.0, 0.0, 0.5, 1.0, 2.0, 3.0)
"""Powers of age along which the curve is looked at."""
_ROTATIONS = 999
_ROUNDING = 1e-9
"""What is less than this, relative to the curve, or of a correlation, is rounding."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """How a model agrees with what was measured.

    Attributes
    ----------
    p
        By (agreement); 1 where nothing can be resampled.
    misfit
        Root mean square of what the curve is missed by, relative to the second moment.
    measured, predicted : (lags,)
        Autocorrelations.
    """

    p: float
    misfit: float
    measured: Array
    predicted: Array

    @property
    def lag(self) -> int:
        """The lag at which the autocorrelation is missed by most."""
        return 1 + int(np.nanargmax(self._missed)) if not np.isnan(self._missed).all() else 1

    @property
    def misses_curve(self) -> bool:
        """Whether the curve is missed by more than is tolerated."""
        return self.misfit > CURVE_TOLERANCE

    @property
    def misses_lags(self) -> bool:
        """Whether an autocorrelation is missed by more than is tolerated."""
        return bool((self._missed > LAG_TOLERANCE).any())

    @property
    def refused(self) -> bool:
        """Whether the model misses more than chance and tolerance explain."""
        return self.p <= ALPHA and (self.misses_curve or self.misses_lags)

    @property
    def _missed(self) -> Array:
        return np.abs(self.measured - self.predicted)


def agreement(
    second: Array, fitted: Array, related: Array, predicted: Array, directions: Array, sizes: Array
) -> Agreement:
    """Compare a model with what was measured.

    Parameters
    ----------
    second, fitted : (ages, 1 + units)
        Second moments of all units and of all but one, and the model fitted to them.
    related, predicted : (lags, 1 + units)
        Autocorrelations and what the model predicts.
    directions : (directions, ages)
        What `curve_directions` returned.
    sizes : (units,)
        Errors of each unit.
    """
    missed = np.nan_to_num(related - predicted)
    of_lags = [missed, missed.mean(axis=0)[None], missed[1:].mean(axis=0)[None], missed[:-2] - missed[2:]]
    statistics = np.concatenate([directions @ (second - fitted), *of_lags, (missed[1] - missed[-1])[None]])
    misfit = float(np.sqrt(np.mean((fitted[:, 0] / second[:, 0] - 1) ** 2)))
    return Agreement(by_chance(statistics, sizes), misfit, related[:, 0], predicted[:, 0])


def curve_directions(since: Array, second: Array, weight: Array) -> Array:
    """Directions along which residuals of a curve are looked at, (directions, ages), relative to the curve.

    Parameters
    ----------
    since, second, weight : (ages,)
        Frames, and the second moment and its weight in the fit.
    """
    powers = (since / since.max()) ** np.array(POWERS)[:, None]
    length = np.sqrt((weight * powers**2).sum(axis=1, keepdims=True) * (weight * second**2).sum())
    return np.asarray(powers * weight / length)


def by_chance(statistics: Array, sizes: Array) -> float:
    """P-value of the largest of several statistics that are zero on average.

    Parameters
    ----------
    statistics : (statistics, 1 + units)
        Of all units, and of all but one.
    sizes : (units,)
        How much each unit holds; units without anything do not count.
    """
    there = sizes > 0
    value = np.where(np.abs(statistics[:, 0]) > _ROUNDING, statistics[:, 0], 0.0)
    moved = parts((statistics[:, :1] - statistics[:, 1:]).T[there], sizes[there, None])
    error = np.sqrt((moved**2).sum(axis=0))
    largest = float((np.abs(value) / np.maximum(error, _ROUNDING)).max())
    freedom = float(degrees(sizes[there, None])[0])
    p = 2 * float(special.stdtr(freedom, -largest))
    if p > ALPHA or p * len(statistics) <= ALPHA:
        return min(1.0, p * len(statistics))  # decided already
    chance = best_by_chance(moved, rotations(len(moved), n_draws=_ROTATIONS, seed=0))
    return share_at_most(chance, p)
