"""Models of how errors grow with age, their fits, and whether they agree with curves and changes.

Scales of scenes
----------------

Scenes differ in how large their errors are. In units of their own scale they all count alike, and only the form of the
curve is left to vary. The scale c of a scene is the mean, over its errors, of their squares divided by the second
moment that all scenes have at the same age (scale):

    c = sum over ages of sum(e^2) / M(k), divided by the number of errors

where M is the second moment of errors that are already divided by c. Two rounds are enough.

Random walk and drift
---------------------

The second moment grows with age by a constant part, a random walk, and a drift. Over the ages k of a condition the
second moment about zero M(k) is fitted by

    M(k) = white^2 + walk^2 k + drift^2 k^2,  none of the three negative (growth)

with weighted least squares. Three columns have only seven subsets. Unbounded least squares is solved for each, and the
best solution without a negative number is used (Lawson and Hanson 1974, without the search that more columns need). The
solutions are linear in M, so any number of draws takes one matrix product.

Growth towards a limit
----------------------

An Ornstein-Uhlenbeck process that begins at birth has a second moment that grows towards a limit. M(k) is fitted by

    M(k) = white^2 + size^2 (1 - exp(-k / tau)),  neither size negative (saturating)

with weighted least squares. For a given tau only the two squares are unknown, and there are three subsets of the two
columns. All time constants of a grid are tried, from a quarter of the shortest to four times the longest age. The best
is refined by a parabola through the residuals of its neighbours.

Autocorrelations of changes
---------------------------

Errors are the sum of independent parts, and zero at birth. For successive changes, one step of s frames apart, let

- a^2 be the part of white^2 that is independent from frame to frame; the rest is an offset that stays,
- r^2 = walk^2 s, d^2 = drift^2 s^2,
- q^2 = size^2 and phi, the correlation over a step, of an Ornstein-Uhlenbeck process.

The variance of the change that ends j steps after birth, and its product with the one l steps earlier, are

    V(j)    = 2 a^2 + r^2 + d^2 + q^2 (2 (1 - phi) - (1 - phi)^2 phi^(2 j - 2)),  with white^2 for 2 a^2 if j is 1
    C(j, l) = d^2 - a^2 [l is 1] - q^2 (1 - phi)^2 (phi^(l - 1) + phi^(2 j - l - 2))  (changes)

For errors that are measured from the first error of a process that is as large then as later, the terms in phi^j
vanish, and the rest of them is halved (relative). A second moment shows only white^2: a^2 is what the autocorrelation
at lag 1 asks for, between 0 and white^2.

Agreement
---------

What the model misses is taken along a few directions. For the curve, weighted as in the fit, these are powers of the
age. For the autocorrelations, they are each lag, the average, and the difference between early and late lags. Each is
divided by its standard error, from the jackknife over units, with the model fitted anew to all units but one. The
largest of them is compared with the largest that chance alone leads to (`tracknoise.inference.multiple_tests`). This
gives the p-value (agreement).

With many scenes every model fails. A model is therefore refused if p is at most `ALPHA`, and it misses the curve by
more than `CURVE_TOLERANCE` or an autocorrelation by more than `LAG_TOLERANCE`.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.inference.estimates import Estimate
from tracknoise.inference.jackknife import degrees, parts
from tracknoise.inference.multiple_tests import best_by_chance, rotations, share_at_most
from tracknoise.statistics.definitions import LAGS

Array = NDArray[np.float64]

_ROUNDS = 2


@dataclass(frozen=True, slots=True)
class UnitSums:
    """Sums of one coordinate of every unit: scenes, or blocks of tracks within them.

    Attributes
    ----------
    n, squares : (units, ages)
        Number of errors, and the sum of their squares, px^2.
    lagged, changed : (units, lags)
        Sums of the products of changes that are a lag apart, and of their mean squares, px^2.
    scene : (units,)
        Number of each unit's scene.
    """

    n: Array
    squares: Array
    lagged: Array
    changed: Array
    scene: NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class SceneCurves:
    """The same in units of scale, of all units and of all but one; the last axis has all units first.

    Attributes
    ----------
    n, second : (ages, 1 + units)
        Number of errors, and their second moment about zero.
    related : (lags, 1 + units)
        (autocorrelation).
    log_scale : (1 + units,)
        Mean over scenes of the logarithm of (scale), log px^2.
    sizes, own : (units,)
        Errors of each unit, and (scale) of its scene.
    """

    n: Array
    second: Array
    related: Array
    log_scale: Array
    sizes: Array
    own: Array


def scene_curves(sums: UnitSums) -> SceneCurves:
    """Curves in units of the scale of each scene."""
    scales = _scales(_of_scenes(sums.n, sums.scene), _of_scenes(sums.squares, sums.scene))
    own = scales[sums.scene, None]
    n, squares = _and_without(sums.n), _and_without(sums.squares / own)
    second = squares / np.where(n > 0, n, np.nan)
    changed = _and_without(sums.changed / own)
    related = _and_without(sums.lagged / own) / np.where(changed > 0, changed, np.nan)
    return SceneCurves(
        n,
        np.where(np.isnan(second), second[:, :1], second),
        np.where(np.isnan(related), related[:, :1], related),
        _log_scales(sums, scales, second[:, 0]),
        sums.n.sum(axis=1),
        scales[sums.scene],
    )


def _scales(n: Array, squares: Array) -> Array:
    """(scale) of each scene, (scenes,); 1 for one without errors."""
    scales, total = np.ones(len(n)), np.maximum(n.sum(axis=0), 1)
    for _ in range(_ROUNDS):
        second = (squares / scales[:, None]).sum(axis=0) / total
        scales = _scale(n, squares, second)
    return scales


def _scale(n: Array, squares: Array, second: Array) -> Array:
    relative = (squares / np.where(second > 0, second, 1.0)).sum(axis=1)
    return np.where(relative > 0, relative / np.maximum(n.sum(axis=1), 1), 1.0)


def _log_scales(sums: UnitSums, scales: Array, second: Array) -> Array:
    """Mean logarithm of the scales, of all units and of all but one."""
    logs, count, members = np.log(scales), len(scales), np.bincount(sums.scene)[sums.scene]
    n, squares = (_of_scenes(table, sums.scene)[sums.scene] - table for table in (sums.n, sums.squares))
    others = np.log(_scale(n, squares, second))
    left = logs.sum() - logs[sums.scene]
    return np.append(logs.mean(), np.where(members == 1, left / max(count - 1, 1), (left + others) / count))


def _of_scenes(sums: Array, scene: NDArray[np.intp]) -> Array:
    """Sums of units added up by scene, (scenes, columns)."""
    n_scenes = int(scene.max()) + 1
    if len(scene) == n_scenes:  # each is a unit
        return sums
    return np.stack([sums[scene == number].sum(axis=0) for number in range(n_scenes)])


def _and_without(sums: Array) -> Array:
    """Sums over all units, then over all but each: (columns, 1 + units)."""
    total = sums.sum(axis=0)
    return np.concatenate([total[None], total - sums]).T


TERMS = ("white", "walk", "drift")
TERM_UNITS = ("px", "px per sqrt(frame)", "px per frame")
"""Units of the roots of their coefficients."""
_POWERS = np.arange(len(TERMS))
_SUBSETS = np.array([of for of in product((0.0, 1.0), repeat=len(TERMS)) if any(of)])
"""Which columns each subset has, (subsets, 3); the last has all."""


@dataclass(frozen=True, slots=True)
class GrowthFit:
    """Fits of (growth) at the same ages with the same weights: what they share does not depend on what is fitted.

    Attributes
    ----------
    root : (ages, 1)
        Of the weights.
    columns : (ages, 3)
        Of the fit, weighted.
    unit : (3, 1)
        What a coefficient of these columns is worth.
    inverses : (subsets, 3, ages)
        The pseudo-inverse of the columns of each subset; 0 for columns that are not of it.
    """

    root: Array
    columns: Array
    unit: Array
    inverses: Array

    @classmethod
    def at(cls, since: Array, weight: Array) -> "GrowthFit":
        """Prepare fits."""
        root, longest = np.sqrt(weight)[:, None], since.max()
        columns = (since / longest)[:, None] ** _POWERS * root
        inverses = np.linalg.pinv(columns * _SUBSETS[:, None]) * _SUBSETS[..., None]
        return cls(root, columns, 1 / (longest**_POWERS)[:, None], inverses)

    def bounded(self, second: Array) -> Array:
        """white^2, walk^2 and drift^2 of (growth), (3, ...): px^2, px^2 per frame and px^2 per frame^2.

        Shapes: second (ages, ...) px^2.
        """
        observed = self._observed(second)
        solutions = (self.inverses.reshape(-1, len(observed)) @ observed).reshape(*_SUBSETS.shape, -1)
        explained = np.einsum("stc,tc->sc", solutions, self.columns.T @ observed)  # what the sum of squares loses
        explained[solutions.min(axis=1) < 0] = 0.0
        best = explained.argmax(axis=0)[None]
        chosen = np.take_along_axis(solutions, best[None], axis=0)[0]
        coefficients = np.where(np.take_along_axis(explained, best, axis=0) > 0, chosen, 0.0)
        return (coefficients * self.unit).reshape(len(TERMS), *second.shape[1:])

    def free(self, second: Array) -> Array:
        """The same without bounds: coefficients that may come out negative, but are right on average."""
        solution: Array = self.inverses[-1] @ self._observed(second) * self.unit
        return solution.reshape(len(TERMS), *second.shape[1:])

    def alone(self, second: Array) -> Array:
        """Each coefficient if its term made all of the mean second moment of the ages: in (growth) none is larger."""
        whole = second.mean(axis=0).reshape(1, -1) / (self.columns / self.root).mean(axis=0)[:, None]
        return np.asarray(whole * self.unit).reshape(len(TERMS), *second.shape[1:])

    def _observed(self, second: Array) -> Array:
        """Weighted second moments, (ages, curves)."""
        return self.root * second.reshape(len(self.root), -1)


def misfit(second: Array, since: Array, coefficients: Array) -> float:
    """Root mean square of what the fit (3,) misses of the second moment (ages,), relative to it."""
    fitted = (since[:, None] ** _POWERS) @ coefficients
    return float(np.sqrt(np.mean((fitted / second - 1) ** 2)))


GRID = 80
"""Time constants that are tried, evenly spaced on the log scale."""
_SHORTEST, _LONGEST = 0.25, 4.0
"""Range of time constants, relative to the shortest and the longest age."""


@dataclass(frozen=True, slots=True)
class SaturatingFit:
    """Fits of (saturating) at the same ages with the same weights.

    Attributes
    ----------
    since, weight : (ages,)
        k, frames, and the weight of each squared residual.
    grid : (taus,)
        Time constants that are tried, frames.
    columns : (taus, ages)
        1 - exp(-k / tau), weighted.
    alike : two of (taus, 1)
        Weighted products of that column with the constant and with itself.
    """

    since: Array
    weight: Array
    grid: Array
    columns: Array
    alike: tuple[Array, Array]

    @classmethod
    def at(cls, since: Array, weight: Array) -> "SaturatingFit":
        """Prepare fits."""
        grid = np.geomspace(*range_tried(since), GRID)
        columns = -np.expm1(-since / grid[:, None])
        return cls(since, weight, grid, columns * weight, ((columns @ weight)[:, None], (columns**2 @ weight)[:, None]))

    def fit(self, second: Array) -> Array:
        """white^2 and size^2 (px^2) and tau (frames) of (saturating), (3, ...). Shapes: second (ages, ...) px^2."""
        weight, observed = self.weight, second.reshape(len(self.since), -1)
        constant, total = weight @ observed, weight.sum()
        products = self.columns @ observed
        explained = _explained(constant, products, total, *self.alike)
        best, curve = explained.argmax(axis=0), np.arange(observed.shape[1])
        tau = _refined(np.log(self.grid), explained, best)
        own = -np.expm1(-self.since[:, None] / tau)
        finer = weight @ (own * observed), total, weight @ own, weight @ own**2
        kept = _explained(constant, *finer) >= explained[best, curve]
        on_grid = products[best, curve], total, *(alike[best, 0] for alike in self.alike)
        both = zip(_squares(constant, *finer), _squares(constant, *on_grid), strict=True)
        chosen = [np.where(kept, one, other) for one, other in both]
        return np.stack([*chosen, np.where(kept, tau, self.grid[best])]).reshape(3, *second.shape[1:])


def range_tried(since: Array) -> tuple[float, float]:
    """Shortest and longest time constant that are tried at some ages (ages,), frames."""
    return _SHORTEST * float(since.min()), _LONGEST * float(since.max())


def saturating_curve(coefficients: Array, since: Array) -> Array:
    """M(k) of (saturating), (ages, ...). Shapes: coefficients (3, ...), since (ages,) frames."""
    white, size, tau = coefficients
    ages = since.reshape(-1, *[1] * tau.ndim)
    return np.asarray(white - size * np.expm1(-ages / tau))


def _explained(b0: Array, b1: Array, a00: float, a01: Array, a11: Array) -> Array:
    """By how much the fit of `_squares` reduces the sum of squares."""
    white, size = _unbounded(b0, b1, a00, a01, a11)
    alone = np.maximum(np.maximum(b0 / a00, 0.0) * b0, np.maximum(b1 / a11, 0.0) * b1)
    return np.where((white >= 0) & (size >= 0), white * b0 + size * b1, alone)


def _squares(b0: Array, b1: Array, a00: float, a01: Array, a11: Array) -> tuple[Array, Array]:
    """white^2 and size^2, from weighted products of the columns.

    `b0` and `b1` are those of the constant and of 1 - exp(-k / tau) with what was observed, the others those of the
    columns with each other.
    """
    white, size = _unbounded(b0, b1, a00, a01, a11)
    only_white, only_size = np.maximum(b0 / a00, 0.0), np.maximum(b1 / a11, 0.0)
    inside = (white >= 0) & (size >= 0)
    constant = only_white * b0 >= only_size * b1
    white = np.where(inside, white, np.where(constant, only_white, 0.0))
    return white, np.where(inside, size, np.where(constant, 0.0, only_size))


def _unbounded(b0: Array, b1: Array, a00: float, a01: Array, a11: Array) -> tuple[Array, Array]:
    """The same where they may be negative."""
    determinant = np.maximum(a00 * a11 - a01**2, 1e-12 * a00 * a11)
    return (a11 * b0 - a01 * b1) / determinant, (a00 * b1 - a01 * b0) / determinant


def _refined(log_tau: Array, explained: Array, best: NDArray[np.intp]) -> Array:
    """Where the parabola through the best point of the grid and its neighbours has its highest point."""
    middle = np.clip(best, 1, len(log_tau) - 2)
    low, here, high = (np.take_along_axis(explained, (middle + shift)[None], axis=0)[0] for shift in (-1, 0, 1))
    bend = low - 2 * here + high
    bent = (bend < 0) & (middle == best)
    shift = np.where(bent, 0.5 * (low - high) / np.where(bent, bend, -1.0), best - middle)
    return np.asarray(np.exp(log_tau[middle] + shift * (log_tau[1] - log_tau[0])))


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

    Shapes: counts (places, ...), steps (places,), first_lag (...). `steps`: that number, from 1 on, ascending.
    """
    share = _predicted_shares(counts, steps)
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


def _predicted_shares(counts: Array, steps: Array) -> Array:
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

    Shapes: second, fitted (ages, 1 + units), related, predicted (lags, 1 + units), directions (directions, ages), sizes
    (units,).
    """
    missed = np.nan_to_num(related - predicted)
    of_lags = [missed, missed.mean(axis=0)[None], missed[1:].mean(axis=0)[None], missed[:-2] - missed[2:]]
    statistics = np.concatenate([directions @ (second - fitted), *of_lags, (missed[1] - missed[-1])[None]])
    misfit = float(np.sqrt(np.mean((fitted[:, 0] / second[:, 0] - 1) ** 2)))
    return Agreement(by_chance(statistics, sizes), misfit, related[:, 0], predicted[:, 0])


def curve_directions(since: Array, second: Array, weight: Array) -> Array:
    """Directions along which residuals of a curve are looked at, (directions, ages), relative to the curve."""
    powers = (since / since.max()) ** np.array(POWERS)[:, None]
    length = np.sqrt((weight * powers**2).sum(axis=1, keepdims=True) * (weight * second**2).sum())
    return np.asarray(powers * weight / length)


def by_chance(statistics: Array, sizes: Array) -> float:
    """P-value of the largest of several statistics that are zero on average.

    Shapes: statistics (statistics, 1 + units), sizes (units,).
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


_FEWEST = 2
"""Units of an interval of (growth ratio)."""
OWN = 0.05
"""How far off a model may be, relative to the second moment: that much is added to each age's standard error."""


@dataclass(frozen=True, slots=True)
class Ages:
    """Where curves are, and which of it is fitted.

    Attributes
    ----------
    since : (ages,)
        Frames from where errors are zero.
    fitted : (ages,) bool
        Ages with enough errors.
    step
        Frames between two changes of errors.
    """

    since: Array
    fitted: NDArray[np.bool_]
    step: float


@dataclass(frozen=True, slots=True)
class _Curve:
    since: Array
    second: Array
    weight: Array


def polynomial(curves: SceneCurves, ages: Ages, level: float) -> tuple[Agreement, dict[str, Estimate]]:
    """Fit (growth): how it agrees, and its sizes as geometric means over scenes."""
    curve = _fitted(curves, ages)
    fit = GrowthFit.at(curve.since, curve.weight)
    bounded, free = fit.bounded(curve.second), fit.free(curve.second)
    white, walk, drift = bounded
    none = np.zeros_like(white)
    process = Parts(white, walk * ages.step, drift * ages.step**2, none, none)
    agreement = _agreement(curves, ages, curve, curve.since[:, None] ** np.arange(len(TERMS)) @ bounded, process)
    scale, least = np.exp(curves.log_scale), _ROUNDING * curve.second.max() / curve.since.max() ** _POWERS[:, None]
    coefficients = (np.where(np.abs(one) > least, one * scale, 0.0) for one in (bounded, free))
    second, sizes = scale * curve.second.mean(axis=0), {}
    for term, unit, one, other in zip(TERMS, TERM_UNITS, *coefficients, strict=True):
        sizes[term] = replace(_size(one, other, second, level), unit=unit)
    return agreement, sizes


def saturating(curves: SceneCurves, ages: Ages) -> Agreement:
    """Fit (saturating); errors may be measured from birth or from the first error, whichever agrees better."""
    curve = _fitted(curves, ages)
    white, size, tau = SaturatingFit.at(curve.since, curve.weight).fit(curve.second)
    none = np.zeros_like(white)
    fitted = saturating_curve(np.stack([white, size, tau]), curve.since)
    decays = ((np.exp(-ages.step / (2 * tau)), False), (np.exp(-ages.step / tau), True))
    both = [_agreement(curves, ages, curve, fitted, Parts(white, none, none, size, *decay)) for decay in decays]
    return max(both, key=lambda model: model.p)


def growth_ratio(n: Array, squares: Array, own: Array, level: float) -> Estimate:
    """RMS at an age over that at an earlier one, of the same tracks, whose scenes count alike.

    Squared errors are in units of the scale of their scene. The interval is Student's, of the logarithm, by leaving out
    each unit. Shapes: n, squares (units, 2), first the earlier age, px^2; own (units,), (scale) of each unit's scene.
    """
    second = _and_without(squares / own[:, None]) / np.maximum(_and_without(n), 1)
    logs = np.log(np.where(second > 0, second, np.nan)) / 2
    ratio = logs[1] - logs[0]
    sizes = n[:, 1]
    there = sizes > 0
    if np.isnan(ratio[0]) or np.count_nonzero(there) < _FEWEST:
        return Estimate(None if np.isnan(ratio[0]) else float(np.exp(ratio[0])))
    moved = parts(np.nan_to_num(ratio[0] - ratio[1:])[there, None], sizes[there, None])
    width = _student(degrees(sizes[there, None]), level) * np.sqrt((moved**2).sum(axis=0))
    value, low, high = np.exp(ratio[0] + np.array([0.0, -width[0], width[0]]))
    return Estimate(float(value), float(low), float(high))


def _fitted(curves: SceneCurves, ages: Ages) -> _Curve:
    second = curves.second[ages.fitted]
    influence = second[:, 1:] - second[:, :1]
    weight = 1 / ((influence**2).sum(axis=1) + (OWN * second[:, 0]) ** 2)
    return _Curve(ages.since[ages.fitted], second, weight)


def _agreement(curves: SceneCurves, ages: Ages, curve: _Curve, fitted: Array, process: Parts) -> Agreement:
    directions = curve_directions(curve.since, curve.second[:, 0], curve.weight)
    expected = predicted(process, curves.n, np.round(ages.since / ages.step), curves.related[0])
    return agreement(curve.second, fitted, curves.related, expected, directions, curves.sizes)


def _size(bounded: Array, free: Array, second: Array, level: float) -> Estimate:
    """Root of a coefficient of all units and of all but one, with Student's interval.

    A term that may not be negative takes from the others where its true size is 0, and a jackknife does not show that.
    The bounds are therefore those of the fit without bounds, which is right on average, moved so that they contain both
    fits. They are on the log scale where the share of the term in the second moment (mean over ages) is clearly not 0,
    whatever the scale of scenes.
    """
    units = len(free) - 1
    tail = _student(units - 1.0, level)

    def width(values: Array) -> float:
        return float(tail * np.sqrt((units - 1) / units * np.square(values[1:] - values[0]).sum()))

    value, other = float(bounded[0]), float(free[0])
    low, high = min(value, other), max(value, other)
    if (free > 0).all() and width(free / second) < low / float(second[0]):
        factor = np.exp(width(np.log(free)))
        low, high = low / factor, high * factor
    else:
        low, high = max(low - width(free), 0.0), high + width(free)
    return Estimate(value**0.5, low**0.5, max(high, 0.0) ** 0.5)


def _student(freedom: Array | float, level: float) -> Array:
    return np.asarray(special.stdtrit(freedom, (1 + level) / 2))
