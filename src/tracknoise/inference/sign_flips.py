"""Tests of a zero mean whose sampling unit is the scene: what chance alone gives when signs are flipped.

Chance
------

Chance flips signs or takes random directions. Which of them depends on the groups of scenes
(`tracknoise.inference.units.scheme`):

- scenes: the signs of scene means are flipped.
- groups: the signs of whole groups are flipped.
- within: with fixed groups, the mean and the differences within groups have the same covariance. They are rotated
  together, so that another direction of this space takes the place of the mean (rotations). This is exact for Gaussian
  scene means.

All conditions of a dataset share the flips of their scenes. The best of many tests therefore has, under flips, the
dependence that the data have.

Source of the rotations: Ø. Langsrud, Statistics and Computing 15 (2005).

Tests
-----

Every scene counts once, by its mean error (x_i, a pair u and v) at an age. The tested mean is therefore that of curves
with weighting `scenes`. With n scenes, Q = sum x_i x_i' and s = sum x_i:

- q = s' Q^-1 s / n, from 0 to 1 (q), grows with Hotelling's T2 = (n - 1) q / (1 - q). For Gaussian scene means its
  p-value is P(q) = (1 - q)^((n - 2) / 2) (hotelling), that of F with 2 and n - 2 degrees of freedom.
- Signs of whole scenes are flipped, at all ages together, which changes s but not Q. The p-value is the share of flips
  whose q is at least as large as the measured one (flips). It is exact if the distribution of scene means is symmetric
  about zero, for any dependence between ages. All 2^n flips are used up to `EXACT` scenes, otherwise `FLIPS`. One of
  them is the data without any flip.
- All ages together: the largest of -log P(q) over the ages, under the same flips (overall).
- One age among all: the share of flips whose largest -log P(q) over the ages is at least as large as the measured one
  at this age (adjusted). Rejecting where it is at most alpha keeps the probability of any false rejection below alpha,
  for any set of ages that differ from zero and any dependence between them (Westfall and Young 1993). Holm's adjustment
  does so too, but no p-value is less than 2 / 2^n: with nine scenes and twenty ages it never rejects.
- Several conditions: the same with the largest over all ages of all conditions (family), under flips of the same
  scenes.

With groups of scenes, the sums of groups take the place of scene means. With too few groups, the mean and the
differences within groups take the place of flipped scene means, n is one more than the degrees of freedom within
groups, and (rotations) take the place of flips.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.inference.units import MIN_SCENES, MIN_WITHIN, Resampled, scheme

Array = NDArray[np.float64]

EXACT = 12
"""Largest number of units for which all flips are used."""
FLIPS = 2**EXACT


@dataclass(frozen=True, slots=True)
class Chance:
    """Draws of chance for the scenes of a dataset, or for some of them."""

    scenes: tuple[str, ...]  # names, in the order of `group`
    group: NDArray[np.intp]  # (scenes,): number of the group of each scene
    draws: Array  # (draws, scenes): signs or, within groups, Gaussian numbers; the first draw is the data as they are
    kind: Resampled | None  # `scenes`, `groups` or `within`; None if there can be no test

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


def _within(group: NDArray[np.intp], present: NDArray[np.bool_]) -> Array:
    """Orthonormal rows: the mean of the scenes, then the differences within groups, (rows, scenes)."""
    same = (group[:, None] == group) & present & present[:, None]
    centred = np.diag(present * 1.0) - same / np.maximum(same.sum(axis=1), 1)
    values, vectors = np.linalg.eigh(centred)
    mean = present / np.sqrt(max(present.sum(), 1))
    return np.concatenate([mean[None], vectors[:, values > 0.5].T])


_SAME = 1e-9
"""Values of q, or of -log P, that differ by less than this, relative to the value, differ by rounding."""
_CERTAIN = 1 - 1e-12
"""Largest q: all scene means equal leave no variation to compare with."""
_FLAT = 1e-12
"""Variances that are smaller than this, relative to another's, are rounding."""


@dataclass(frozen=True, slots=True)
class FlipTest:
    """What `flip_test` found at each age, NaN where no test is made, and for all ages together."""

    n_scenes: NDArray[np.intp]  # (ages,): scenes that have a mean there
    # hotelling_p, sign_flip_p: (ages,): By (hotelling) and (flips). Hotelling's requires means that vary in both
    # directions.
    hotelling_p: Array
    sign_flip_p: Array
    adjusted_p: Array  # (ages,): by (adjusted)
    overall_p: float  # by (overall); NaN if no age has scenes or groups enough
    strongest: int | None  # which age has the largest -log P; None if no age has scenes or groups enough
    evidence: Array  # (ages,): -log P of the data as they are, NaN where no test is made
    largest: Array  # (draws,): the largest -log P over the ages in each draw; 0 without any


def flip_test(means: Array, *, seed: int = 0, chance: Chance | None = None) -> FlipTest:
    """Test whether means are zero, by (hotelling), (flips) and (overall).

    Parameters
    ----------
    means : (scenes, ages, 2)
        Mean error of each scene at each age, px; NaN where a scene has none.
    seed
        Of the flips, where they are not all used.
    chance
        Flips of these scenes; by default their own, with every scene a group of its own.
    """
    draws = chance or Chance.of([str(place) for place in range(len(means))], seed=seed)
    present = ~np.isnan(means[..., 0])
    patterns, kind = np.unique(present, axis=1, return_inverse=True)
    units = np.array([draws.units(pattern) for pattern in patterns.T], dtype=np.intp)[kind.ravel()]
    q, rank = _q(np.where(present[..., None], means, 0.0), draws, patterns, kind.ravel())
    strength = -np.maximum(units - 2, 0) / 2 * np.log1p(-q)
    tested = units > 0
    largest = strength[:, tested].max(axis=1, initial=0.0)
    return FlipTest(
        n_scenes=present.sum(axis=0),
        hotelling_p=np.where(tested & (rank == 2), np.exp(-strength[0]), np.nan),
        sign_flip_p=np.where(tested, _share_as_large(q), np.nan),
        adjusted_p=np.where(tested, _share_above(largest, strength[0]), np.nan),
        overall_p=float(_share_as_large(largest)) if tested.any() else np.nan,
        strongest=int(np.argmax(np.where(tested, strength[0], -1.0))) if tested.any() else None,
        evidence=np.where(tested, strength[0], np.nan),
        largest=largest,
    )


def family_p(tests: Sequence[FlipTest]) -> list[Array]:
    """P-values by (family) of every age of several conditions, (ages,) each; NaN where no test is made.

    Parameters
    ----------
    tests
        Of the conditions of a dataset, with flips of the same scenes.
    """
    largest = np.max([test.largest for test in tests], axis=0)
    return [np.where(np.isnan(test.evidence), np.nan, _share_above(largest, test.evidence)) for test in tests]


def _q(
    means: Array, chance: Chance, patterns: NDArray[np.bool_], kind: NDArray[np.intp]
) -> tuple[Array, NDArray[np.intp]]:
    """(q) in each draw and at each age, (draws, ages), and in how many directions means vary, (ages,)."""
    if chance.kind not in (Resampled.groups, Resampled.within):
        return _of_rows(means, chance.draws, np.maximum(patterns.sum(axis=0)[kind], 1))
    q, rank = np.zeros((len(chance.draws), means.shape[1])), np.zeros(means.shape[1], dtype=np.intp)
    for place, pattern in enumerate(patterns.T):
        ages = np.flatnonzero(kind == place)
        rows, directions = chance.rows(pattern)
        put_together = np.einsum("rs,sai->rai", rows, means[:, ages])
        q[:, ages], rank[ages] = _of_rows(put_together, directions, np.ones(len(ages), dtype=np.intp))
    return q, rank


def _of_rows(rows: Array, directions: Array, squared_length: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
    """(q) of rows (rows, ages, 2) in directions (draws, rows) of such a length, and in how many the rows vary."""
    whitened, rank = _whitened(rows)
    turned = np.tensordot(directions, whitened, axes=1)
    squares = np.square(turned)
    return np.minimum((squares[..., 0] + squares[..., 1]) / squared_length, _CERTAIN), rank


def _share_as_large(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of flips, along the first axis, whose value is at least that of the first, which has no flip."""
    return np.asarray((values >= values[0] * (1 - _SAME)).mean(axis=0))


def _share_above(values: NDArray[np.float64], limits: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of values that are at least each limit."""
    below = np.searchsorted(np.sort(values), np.nan_to_num(limits) * (1 - _SAME))
    return np.asarray(1 - below / len(values), dtype=np.float64)


def _whitened(means: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Scene means in directions in which Q is the identity, (scenes, ages, 2), and in how many they vary, (ages,)."""
    values, vectors = np.linalg.eigh(np.einsum("sai,saj->aij", means, means))
    varies = values > _FLAT * np.maximum(values[:, -1:], np.finfo(np.float64).tiny / _FLAT)
    scale = np.where(varies, 1 / np.sqrt(np.where(varies, values, 1.0)), 0.0)
    return np.einsum("sai,aij,aj->saj", means, vectors, scale), varies.sum(axis=1)
