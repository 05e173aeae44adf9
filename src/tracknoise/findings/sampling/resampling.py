"""Bootstrap of sums that add up over independent units, and intervals from it: arrays only.

Whatever is computed from sums over scenes (means, second moments, ratios, survival) is computed again from sums in
which each scene counts as often as it was drawn. That is one matrix product, whatever the number of draws.

Bootstrap percentiles are too narrow for few units, by a factor of sqrt((n - 1) / n) in the standard error and by a
Gaussian's tail in place of Student's. Both are put right by asking for wider percentiles (Hesterberg 2015, "What
teachers should know about the bootstrap", section 5.3): the standard Gaussian quantile z becomes

    z' = t(n - 1) sqrt(n / (n - 1))    (expansion)

with the same quantile t of Student's distribution. With `bca` these are shifted, too, for median bias and for a
standard error that grows with the value (Efron 1987): Phi(z0 + (z0 + z') / (1 - a (z0 + z'))), z0 from the share of
draws below the estimate, a from the skewness of the jackknife. Where scenes differ much in their second moments or
ratios, intervals of either kind miss more often than they say; see `tracknoise.findings.sampling.jackknife`.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from tracknoise.exceptions import SettingsError
from tracknoise.tables.defaults import LEVEL
from tracknoise.tables.enumerations import IntervalKind

_KINDS = (IntervalKind.percentile, IntervalKind.bca)
_SAME = 1e-12
"""Values that differ by less than this, relative to the largest, differ by rounding."""


def resample(sums: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums over the units, each as often as it was drawn.

    Parameters
    ----------
    sums : (units, points, columns)
        Additive sums of each unit.
    weights : (draws, units)
        What `tracknoise.findings.sampling.draws.draws` returned.

    Returns
    -------
    (draws, points, columns) float64
        A view in which the draws of one value lie next to each other in memory, which `interval` is fast with.
    """
    units, *shape = sums.shape
    totals = np.ascontiguousarray(sums.reshape(units, -1).T) @ np.ascontiguousarray(weights.T)
    return np.moveaxis(totals.reshape(*shape, len(weights)), -1, 0)


def leave_one_out(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums over all units but one, for each of them: (units, points, columns), as `sums`."""
    total: NDArray[np.float64] = sums.sum(axis=0)
    return total - sums


def interval(
    estimate: ArrayLike,
    replicates: NDArray[np.float64],
    *,
    n_units: ArrayLike,
    acceleration: ArrayLike = 0.0,
    kind: str = IntervalKind.bca,
    level: float = LEVEL,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two-sided bootstrap intervals of any number of statistics, expanded for few units.

    Parameters
    ----------
    estimate : (...)
        The statistics of all units, each once.
    replicates : (draws, ...)
        Those of each draw; NaN where a draw has none.
    n_units : (...)
        How many units the statistics rest on; with units drawn within strata, in each of these. At least 2 are needed.
    acceleration : (...)
        For `bca`: what `tracknoise.findings.sampling.jackknife.acceleration` returned; 0 corrects median bias alone.
    kind
        `percentile` or `bca`.
    level
        Between 0 and 1.

    Returns
    -------
    low, high : (...) float64
        Linearly interpolated between draws; NaN where the estimate is NaN or rests on fewer than two units.

    Raises
    ------
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    if kind not in _KINDS:
        raise SettingsError(f"kind of interval is {kind!r}, expected {' or '.join(_KINDS)}")
    if not 0 < level < 1:
        raise SettingsError(f"level is {level}, expected more than 0 and less than 1")
    value = np.asarray(estimate, dtype=np.float64)
    ordered = np.sort(np.moveaxis(replicates, 0, -1), axis=-1)  # NaN last
    known = np.count_nonzero(~np.isnan(ordered), axis=-1)
    n = np.broadcast_to(np.asarray(n_units), value.shape)
    usable = (known > 0) & (n > 1) & ~np.isnan(value)
    tail = _expanded(np.where(usable, n, 2), level)
    corrected = kind == IntervalKind.bca
    bias = _median_bias(value, ordered, known) if corrected else np.zeros_like(value)
    growth = np.broadcast_to(np.asarray(acceleration if corrected else 0.0, dtype=np.float64), value.shape)
    low, high = (_quantile(ordered, known, _share(z, bias, growth)) for z in (-tail, tail))
    return np.where(usable, low, np.nan), np.where(usable, high, np.nan)


def _expanded(n: NDArray[np.int64], level: float) -> NDArray[np.float64]:
    """Quantile z' of (expansion)."""
    return np.asarray(special.stdtrit(n - 1.0, (1 + level) / 2) * np.sqrt(n / (n - 1.0)), dtype=np.float64)


def _share(z: NDArray[np.float64], bias: NDArray[np.float64], acceleration: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of draws below the bound of an expanded quantile z."""
    shifted = bias + z
    scale = 1 - acceleration * shifted
    beyond = np.copysign(np.inf, shifted)  # where the error grows so fast that no draw is far enough
    reached = np.where(scale > 0, shifted / np.where(scale > 0, scale, 1.0), beyond)
    return np.asarray(special.ndtr(bias + reached))


def _median_bias(
    value: NDArray[np.float64], ordered: NDArray[np.float64], known: NDArray[np.intp]
) -> NDArray[np.float64]:
    """z0: the Gaussian quantile of the share of draws below the estimate, those that equal it counting half."""
    last = np.take_along_axis(ordered, np.maximum(known - 1, 0)[..., None], axis=-1)[..., 0]
    rounding = _SAME * np.maximum(np.abs(ordered[..., 0]), np.abs(last))
    below = np.count_nonzero(ordered < (value - rounding)[..., None], axis=-1)
    above = np.count_nonzero(ordered > (value + rounding)[..., None], axis=-1)
    counted = np.maximum(known, 1)
    share = (below + 0.5 * (known - below - above)) / counted
    bias: NDArray[np.float64] = special.ndtri(np.clip(share, 0.5 / counted, 1 - 0.5 / counted))
    return np.where(known > 0, bias, 0.0)


def _quantile(ordered: NDArray[np.float64], known: NDArray[np.intp], share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quantile of the first `known` values of the last axis, which are sorted; value i of m is that of i / (m + 1)."""
    place = np.clip(share * (known + 1) - 1, 0, np.maximum(known - 1, 0))
    left = np.floor(place).astype(np.intp)
    right = np.minimum(left + 1, np.maximum(known - 1, 0))
    low, high = (np.take_along_axis(ordered, index[..., None], axis=-1)[..., 0] for index in (left, right))
    return low + (place - left) * (high - low)
