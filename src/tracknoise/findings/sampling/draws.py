"""Draws of units with replacement: the weights of sums in the bootstrap."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.sampling.groups import NO_GROUPS, SceneGroups
from tracknoise.findings.sampling.units import Units
from tracknoise.statistics.blocks import BLOCKS
from tracknoise.tables.enumerations import Resampled

N_DRAWS = 2000


def draws(n_units: int, *, n_draws: int = N_DRAWS, seed: int = 0) -> NDArray[np.float64]:
    """How often each unit was drawn, with replacement, in each of many draws of as many units as there are.

    Parameters
    ----------
    n_units
        At least one.
    n_draws
        Number of draws.
    seed
        The same seed gives the same draws.

    Returns
    -------
    (n_draws, n_units) float64
        Counts; every row sums to `n_units`.
    """
    return draws_within([n_units], n_draws=n_draws, seed=seed)


def draws_within(sizes: Sequence[int], *, n_draws: int = N_DRAWS, seed: int = 0) -> NDArray[np.float64]:
    """Draws of units that stay within their stratum: as many from each as it has.

    Parameters
    ----------
    sizes
        Units in each stratum; the units of a stratum follow one another.
    n_draws, seed
        As in `draws`.

    Returns
    -------
    (n_draws, sum(sizes)) float64
        Counts; in every row those of a stratum sum to its size.
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
