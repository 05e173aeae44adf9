"""Tests of a zero mean whose sampling unit is the scene, not the feature: arrays only.

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
  for any set of ages that differ from zero and any dependence between them (Westfall and Young 1993). Holm's
  adjustment does so too, but no p-value is less than 2 / 2^n: with nine scenes and twenty ages it never rejects.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.sampling.units import MIN_SCENES

EXACT = 12
"""Largest number of scenes for which all flips are used."""
FLIPS = 2**EXACT

_SAME = 1e-9
"""Values of q, or of -log P, that differ by less than this, relative to the value, differ by rounding."""
_CERTAIN = 1 - 1e-12
"""Largest q: all scene means equal leave no variation to compare with."""
_FLAT = 1e-12
"""Variances that are smaller than this, relative to another's, are rounding."""


@dataclass(frozen=True, slots=True)
class FlipTest:
    """What `flip_test` found at each age, NaN where no test is made, and for all ages together.

    Attributes
    ----------
    n_scenes : (ages,) intp
        Scenes that have a mean there.
    hotelling_p, sign_flip_p : (ages,) float64
        By (hotelling) and (flips). Hotelling's requires means that vary in both directions.
    adjusted_p : (ages,) float64
        By (adjusted).
    overall_p
        By (overall); NaN if no age has `MIN_SCENES` scenes.
    strongest
        Which age has the largest -log P; None if no age has `MIN_SCENES` scenes.
    """

    n_scenes: NDArray[np.intp]
    hotelling_p: NDArray[np.float64]
    sign_flip_p: NDArray[np.float64]
    adjusted_p: NDArray[np.float64]
    overall_p: float
    strongest: int | None


def flip_test(means: NDArray[np.float64], *, seed: int = 0) -> FlipTest:
    """Test whether means are zero, by (hotelling), (flips) and (overall).

    Parameters
    ----------
    means : (scenes, ages, 2)
        Mean error of each scene at each age, px; NaN where a scene has none.
    seed
        Of the flips, where they are not all used.
    """
    there = ~np.isnan(means[..., 0])
    n = there.sum(axis=0)
    directions, rank = _whitened(np.where(there[..., None], means, 0.0))
    flipped = np.tensordot(_signs(len(means), seed), directions, axes=1)
    q = np.minimum((flipped**2).sum(axis=-1) / np.maximum(n, 1), _CERTAIN)
    strength = -np.maximum(n - 2, 0) / 2 * np.log1p(-q)
    tested = n >= MIN_SCENES
    largest = strength[:, tested].max(axis=1, initial=0.0)
    return FlipTest(
        n_scenes=n,
        hotelling_p=np.where(tested & (rank == 2), np.exp(-strength[0]), np.nan),
        sign_flip_p=np.where(tested, _share_as_large(q), np.nan),
        adjusted_p=np.where(tested, _share_above(largest, strength[0]), np.nan),
        overall_p=float(_share_as_large(largest)) if tested.any() else np.nan,
        strongest=int(np.argmax(np.where(tested, strength[0], -1.0))) if tested.any() else None,
    )


def _share_as_large(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of flips, along the first axis, whose value is at least that of the first, which has no flip."""
    return np.asarray((values >= values[0] * (1 - _SAME)).mean(axis=0))


def _share_above(values: NDArray[np.float64], limits: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of values that are at least each limit."""
    below = np.searchsorted(np.sort(values), limits * (1 - _SAME))
    return np.asarray(1 - below / len(values), dtype=np.float64)


def _signs(scenes: int, seed: int) -> NDArray[np.float64]:
    """Flips as rows of 1 and -1; the first has no flip."""
    if scenes <= EXACT:
        bits = np.arange(2**scenes)[:, None] >> np.arange(scenes) & 1
    else:
        bits = np.random.default_rng(seed).integers(0, 2, (FLIPS, scenes))
        bits[0] = 0
    return np.asarray(1.0 - 2.0 * bits, dtype=np.float64)


def _whitened(means: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Scene means in directions in which Q is the identity, (scenes, ages, 2), and in how many they vary, (ages,)."""
    values, vectors = np.linalg.eigh(np.einsum("sai,saj->aij", means, means))
    varies = values > _FLAT * np.maximum(values[:, -1:], np.finfo(np.float64).tiny / _FLAT)
    scale = np.where(varies, 1 / np.sqrt(np.where(varies, values, 1.0)), 0.0)
    return np.einsum("sai,aij,aj->saj", means, vectors, scale), varies.sum(axis=1)
