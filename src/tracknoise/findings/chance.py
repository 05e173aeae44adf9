"""What chance does to the means of scenes if the true mean is zero: random signs or directions, shared by a dataset.

Which of them depends on the groups of scenes (`tracknoise.findings.sampling.groups.scheme`):

- scenes: the signs of scene means are flipped.
- groups: the signs of whole groups are flipped.
- within: with fixed groups, the mean and the differences within groups have the same covariance. They are rotated
  together, so that another direction of this space takes the place of the mean (rotations). This is exact for Gaussian
  scene means.

All conditions of a dataset share the flips of their scenes. The best of many tests therefore has, under flips, the
dependence that the data have.

Source of the rotations: Ø. Langsrud, Statistics and Computing 15 (2005).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.sampling.groups import MIN_WITHIN, scheme
from tracknoise.findings.sampling.units import MIN_SCENES
from tracknoise.tables.enumerations import Resampled

Array = NDArray[np.float64]

EXACT = 12
"""Largest number of units for which all flips are used."""
FLIPS = 2**EXACT


@dataclass(frozen=True, slots=True)
class Chance:
    """Draws of chance for the scenes of a dataset, or for some of them.

    Attributes
    ----------
    scenes
        Names, in the order of `group`.
    group : (scenes,)
        Number of the group of each scene.
    draws : (draws, scenes)
        Signs or, within groups, Gaussian numbers; the first draw is the data as they are.
    kind
        `scenes`, `groups` or `within`; None if there can be no test.
    """

    scenes: tuple[str, ...]
    group: NDArray[np.intp]
    draws: Array
    kind: Resampled | None

    @classmethod
    def of(cls, scenes: Sequence[str], group: NDArray[np.intp] | None = None, *, seed: int = 0) -> "Chance":
        """Draws for scenes, each a group of its own by default.

        Parameters
        ----------
        scenes
            Names.
        group : (scenes,)
            Number of the group of each scene.
        seed
            Of the draws, where not all flips are used.
        """
        groups = np.arange(len(scenes)) if group is None else group
        kind = scheme(groups)
        if kind == Resampled.within:
            draws = np.random.default_rng(seed).standard_normal((FLIPS, len(scenes)))
            draws[0] = 1.0
        else:
            unit = np.unique(groups, return_inverse=True)[1] if kind == Resampled.groups else np.arange(len(scenes))
            draws = _signs(int(unit.max(initial=-1)) + 1, seed)[:, unit]
        return cls(tuple(scenes), groups, draws, kind)

    def some(self, scenes: Sequence[str]) -> "Chance":
        """The same for some of the scenes, in their order."""
        places = np.array([self.scenes.index(scene) for scene in scenes], dtype=np.intp)
        return Chance(tuple(scenes), self.group[places], self.draws[:, places], self.kind)

    def units(self, there: NDArray[np.bool_]) -> int:
        """Degrees of freedom of the mean and of what varies beside it; 0 if there are too few for a test.

        Parameters
        ----------
        there : (scenes,)
            Which scenes have a mean.
        """
        n, n_groups = int(there.sum()), len(np.unique(self.group[there]))
        if self.kind == Resampled.within:
            return n - n_groups + 1 if n >= MIN_SCENES and n - n_groups >= MIN_WITHIN else 0
        least = n_groups if self.kind == Resampled.groups else n
        return least if least >= MIN_SCENES and self.kind is not None else 0

    def rows(self, there: NDArray[np.bool_]) -> tuple[Array, Array]:
        """How scenes with groups are put together to independent rows, and the directions in which chance looks.

        Parameters
        ----------
        there : (scenes,)
            Which scenes have a mean.

        Returns
        -------
        rows : (rows, scenes)
            What scene means are multiplied by.
        directions : (draws, rows)
            Of length 1.
        """
        if self.kind == Resampled.within:
            basis = _within(self.group, there)
            turned = self.draws @ basis.T
            return basis, turned / np.linalg.norm(turned, axis=1, keepdims=True)
        number, first, unit = np.unique(self.group, return_index=True, return_inverse=True)
        summed = (unit == np.arange(len(number))[:, None]) * there
        present = summed.any(axis=1)
        return summed[present] * 1.0, self.draws[:, first[present]] / np.sqrt(max(int(present.sum()), 1))


def _signs(units: int, seed: int) -> Array:
    """Flips as rows of 1 and -1; the first has no flip."""
    if units <= EXACT:
        bits = np.arange(2**units)[:, None] >> np.arange(units) & 1
    else:
        bits = np.random.default_rng(seed).integers(0, 2, (FLIPS, units))
        bits[0] = 0
    return np.asarray(1.0 - 2.0 * bits, dtype=np.float64)


def _within(group: NDArray[np.intp], there: NDArray[np.bool_]) -> Array:
    """Orthonormal rows: the mean of the scenes, then the differences within groups, (rows, scenes)."""
    same = (group[:, None] == group) & there & there[:, None]
    centred = np.diag(there * 1.0) - same / np.maximum(same.sum(axis=1), 1)
    values, vectors = np.linalg.eigh(centred)
    mean = there / np.sqrt(max(there.sum(), 1))
    return np.concatenate([mean[None], vectors[:, values > 0.5].T])
