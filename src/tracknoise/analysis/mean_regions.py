"""Confidence regions of the mean error at one age, u and v together, that agree with the test of a zero mean there.

Scene means x_i (or what stands for them where scenes have groups, `tracknoise.inference.sign_flips`) have the mean m,
the sum s, the matrix Q = sum x_i x_i' about zero, and W about m. With q = s' Q^-1 s / n and q / (1 - q) = n m' W^-1 m,
the region is

    n (x - m)' W^-1 (x - m) <= q_c / (1 - q_c)                                                             (region)

where q_c is the largest value that more than `ALPHA` of the flips reach. It is Hotelling's ellipse, with the limit
from the flips in place of that of F. Zero lies outside exactly where the p-value of the flips at this age is at most
`ALPHA`. The bounds of u and of v are the extent of the ellipse, so that both hold at once; those of the length of the
mean are the smallest and the largest distance of the ellipse from zero. Where groups of unequal size share a large
mean, W has a part of it, and the region is too large.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from tracknoise.inference.sign_flips import Chance

Array = NDArray[np.float64]

ALPHA = 0.05
"""Probability of a false rejection of a true zero."""
BOUNDS = tuple(f"{name}_{end}_px" for name in ("effect", "mean_u", "mean_v") for end in ("low", "high"))
"""Names of the bounds, in the order of `mean_bounds`."""
_ANGLES = np.linspace(0.0, 2.0 * np.pi, 721)
_ROUNDING = 1e-9
_FLAT = 1e-12
"""Variances that are smaller than this, relative to another's, are rounding."""


def mean_bounds(means: Array, chance: Chance) -> Mapping[str, Array]:
    """Bounds of the mean over scenes at every age, px, NaN where there is no test; (ages,) by the names in `BOUNDS`.

    Parameters
    ----------
    means : (scenes, ages, 2)
        Mean error of each scene at each age, px; NaN where a scene has none.
    chance
        Flips of these scenes.
    """
    there = ~np.isnan(means[..., 0])
    found = np.full((means.shape[1], len(BOUNDS)), np.nan)
    patterns, kind = np.unique(there, axis=1, return_inverse=True)
    for place, pattern in enumerate(patterns.T):
        if not chance.units(pattern):
            continue
        rows, directions = chance.rows(pattern)
        for age in np.flatnonzero(kind.ravel() == place):
            put_together = rows[:, pattern] @ means[pattern, age]
            found[age] = _bounds(put_together, directions, rows[:, pattern].sum(axis=1) @ directions[0])
    return dict(zip(BOUNDS, found.T, strict=True))


def _bounds(rows: Array, directions: Array, length: float) -> Array:
    """Bounds at one age: of rows (rows, 2) in directions (draws, rows), and the length of the mean's direction."""
    turned = directions @ rows
    about_zero = rows.T @ rows
    q = np.minimum(np.einsum("di,ij,dj->d", turned, _inverse(about_zero), turned), 1.0)
    limit = np.sort(q)[::-1][int(ALPHA * len(q))] * (1 + _ROUNDING)
    if limit >= 1 - _ROUNDING:
        return np.full(len(BOUNDS), np.nan)
    mean = turned[0] / length
    values, vectors = np.linalg.eigh(about_zero - np.outer(turned[0], turned[0]))
    axes = vectors * np.sqrt(np.maximum(values, 0.0) * limit / (1 - limit)) / length
    edge = mean + np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1) @ axes.T
    distance, extent = np.hypot(*edge.T), np.linalg.norm(axes, axis=1)
    nearest = 0.0 if q[0] <= limit else distance.min()
    return np.array(
        [nearest, distance.max(), *(end for u in range(2) for end in (mean[u] - extent[u], mean[u] + extent[u]))]
    )


def _inverse(matrix: Array) -> Array:
    """Inverse in the directions in which means vary."""
    values, vectors = np.linalg.eigh(matrix)
    varies = values > _FLAT * np.maximum(values[-1], np.finfo(np.float64).tiny / _FLAT)
    return np.asarray((vectors * np.where(varies, 1 / np.where(varies, values, 1.0), 0.0)) @ vectors.T)
