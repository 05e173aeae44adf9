"""The bootstrap: draws of units with replacement, sums of drawn units, and intervals from them.

The bootstrap is of sums that add up over independent units, and works on arrays only. Whatever is computed from sums
over scenes (means, second moments, ratios, survival) is computed again from sums in which each scene counts as often as
it was drawn. That is one matrix product, whatever the number of draws.

Bootstrap percentiles are too narrow for few units, by a factor of sqrt((n - 1) / n) in the standard error and by a
Gaussian's tail in place of Student's. Both are put right by asking for wider percentiles (Hesterberg 2015, "What
teachers should know about the bootstrap", section 5.3): the standard Gaussian quantile z becomes

    z' = t(n - 1) sqrt(n / (n - 1))    (expansion)

with the same quantile t of Student's distribution. With `bca` these are shifted, too, for median bias and for a
standard error that grows with the value (Efron 1987): Phi(z0 + (z0 + z') / (1 - a (z0 + z'))), z0 from the share of
draws below the estimate, a from the skewness of the jackknife.

Where scenes differ much in their second moments or ratios, intervals of either kind miss more often than they say; see
`tracknoise.inference.jackknife`.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from tracknoise.exceptions import SettingsError
from tracknoise.inference.conventions import LEVEL, IntervalKind
from tracknoise.inference.units import BLOCKS, NO_GROUPS, Resampled, SceneGroups, Units

N_DRAWS = 2000


def draws(n_units: int, *, n_draws: int = N_DRAWS, seed: int = 0) -> NDArray[np.float64]:
    """How often each unit was drawn, with replacement, in each of many draws of as many units as there are.

    `n_units`: at least one; `n_draws`: number of draws; `seed`: the same seed gives the same draws. Returns (n_draws,
    n_units) float64: counts; every row sums to `n_units`.
    """
    return draws_within([n_units], n_draws=n_draws, seed=seed)


def draws_within(sizes: Sequence[int], *, n_draws: int = N_DRAWS, seed: int = 0) -> NDArray[np.float64]:
    """Draws of units that stay within their stratum: as many from each as it has.

    Returns (n_draws, sum(sizes)). Counts. In every row those of a stratum sum to its size.
    """
    rng = np.random.default_rng(seed)
    strata = [rng.multinomial(size, np.full(size, 1 / size), size=n_draws) for size in sizes]
    return np.concatenate(strata, axis=1).astype(np.float64)


class Draws:
    """Draws of all scenes of a dataset, shared by its conditions: a scene is drawn with all that belongs to it.

    Parameters
    ----------
    scenes
        Names of all scenes of the dataset, in any order.
    n_draws, seed
        As in `draws`.
    dataset, groups
        Name of the dataset, and groups of its scenes that are not independent of each other.

    Attributes
    ----------
    groups
        As given: units that are drawn have the same.
    """

    def __init__(
        self,
        scenes: Sequence[str],
        *,
        n_draws: int = N_DRAWS,
        seed: int = 0,
        dataset: str = "",
        groups: SceneGroups = NO_GROUPS,
    ) -> None:
        self.groups = groups
        names = sorted(scenes)
        self._place = {scene: place for place, scene in enumerate(names)}
        self._group = groups.of(dataset, names)
        self._n_draws, self._seed = n_draws, seed

    def weights(self, units: Units) -> NDArray[np.float64]:
        """How often each unit of a condition was drawn, (draws, units)."""
        places = np.array([self._place[scene] for scene in units.scenes], dtype=np.intp)
        if units.resampled == Resampled.groups:
            return self._of_groups[:, self._group[places]]
        if units.resampled == Resampled.within:
            return self._within_groups[:, places]
        if units.resampled != Resampled.blocks:
            return self._of_scenes[:, places]
        return self._of_blocks[:, places].reshape(self._n_draws, len(places) * BLOCKS)

    @cached_property
    def _of_scenes(self) -> NDArray[np.float64]:
        return draws(len(self._place), n_draws=self._n_draws, seed=self._seed)

    @cached_property
    def _of_groups(self) -> NDArray[np.float64]:
        return draws(int(self._group.max()) + 1, n_draws=self._n_draws, seed=self._seed)

    @cached_property
    def _within_groups(self) -> NDArray[np.float64]:
        """(draws, scenes): as many scenes of each group as it has."""
        order = np.argsort(self._group, kind="stable")
        sizes = np.bincount(self._group).tolist()
        drawn = np.empty((self._n_draws, len(order)))
        drawn[:, order] = draws_within(sizes, n_draws=self._n_draws, seed=self._seed)
        return drawn

    @cached_property
    def _of_blocks(self) -> NDArray[np.float64]:
        """(draws, scenes, blocks)."""
        sizes = [BLOCKS] * len(self._place)
        return draws_within(sizes, n_draws=self._n_draws, seed=self._seed).reshape(self._n_draws, len(sizes), BLOCKS)


def draws_by_dataset(
    scenes: Mapping[str, Iterable[str]], *, n_draws: int, seed: int, groups: SceneGroups = NO_GROUPS
) -> dict[str, Draws]:
    """Draws of the scenes of each dataset."""
    return {
        dataset: Draws(list(names), n_draws=n_draws, seed=seed, dataset=dataset, groups=groups)
        for dataset, names in scenes.items()
    }


_KINDS = (IntervalKind.percentile, IntervalKind.bca)
_SAME = 1e-12
"""Values that differ by less than this, relative to the largest, differ by rounding."""


def resample(sums: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums over the units, each as often as it was drawn.

    Shapes: sums (units, points, columns), weights (draws, units); returns (draws, points, columns). A view in which the
    draws of one value lie next to each other in memory, which `interval` is fast with.
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

    Shapes: estimate (...), replicates (draws, ...), n_units (...), acceleration (...); returns low, high (...).
    Linearly interpolated between draws. NaN where the estimate is NaN or rests on fewer than two units.
    """
    if kind not in _KINDS:
        raise SettingsError(f"kind of interval is {kind!r}, expected {' or '.join(_KINDS)}")
    if not 0 < level < 1:
        raise SettingsError(f"level is {level}, expected more than 0 and less than 1")
    value = np.asarray(estimate, dtype=np.float64)
    ordered = np.sort(np.moveaxis(replicates, 0, -1), axis=-1)  # NaN last
    count = np.count_nonzero(~np.isnan(ordered), axis=-1)
    n = np.broadcast_to(np.asarray(n_units), value.shape)
    usable = (count > 0) & (n > 1) & ~np.isnan(value)
    tail = _expanded(np.where(usable, n, 2), level)
    corrected = kind == IntervalKind.bca
    bias = _median_bias(value, ordered, count) if corrected else np.zeros_like(value)
    growth = np.broadcast_to(np.asarray(acceleration if corrected else 0.0, dtype=np.float64), value.shape)
    low, high = (_quantile(ordered, count, _share(z, bias, growth)) for z in (-tail, tail))
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
    value: NDArray[np.float64], ordered: NDArray[np.float64], count: NDArray[np.intp]
) -> NDArray[np.float64]:
    """z0: the Gaussian quantile of the share of draws below the estimate, those that equal it counting half."""
    last = np.take_along_axis(ordered, np.maximum(count - 1, 0)[..., None], axis=-1)[..., 0]
    rounding = _SAME * np.maximum(np.abs(ordered[..., 0]), np.abs(last))
    below = np.count_nonzero(ordered < (value - rounding)[..., None], axis=-1)
    above = np.count_nonzero(ordered > (value + rounding)[..., None], axis=-1)
    counted = np.maximum(count, 1)
    share = (below + 0.5 * (count - below - above)) / counted
    bias: NDArray[np.float64] = special.ndtri(np.clip(share, 0.5 / counted, 1 - 0.5 / counted))
    return np.where(count > 0, bias, 0.0)


def _quantile(ordered: NDArray[np.float64], count: NDArray[np.intp], share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quantile of the first `count` values of the last axis, which are sorted; value i of m is that of i / (m + 1)."""
    place = np.clip(share * (count + 1) - 1, 0, np.maximum(count - 1, 0))
    left = np.floor(place).astype(np.intp)
    right = np.minimum(left + 1, np.maximum(count - 1, 0))
    low, high = (np.take_along_axis(ordered, index[..., None], axis=-1)[..., 0] for index in (left, right))
    return low + (place - left) * (high - low)


def scattered(numbers: NDArray[np.integer[Any]]) -> NDArray[np.uint64]:
    """Distinct pseudo-random numbers: the finaliser of SplitMix64 (Steele et al. 2014)."""
    mixed = numbers.astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return mixed ^ (mixed >> np.uint64(31))
