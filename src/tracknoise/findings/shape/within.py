"""Errors in units of their own scene: less the mean of its other errors, and whitened by their covariance.

Scenes differ in scale. Put together, Gaussian errors of such scenes look heavy-tailed. Each error is therefore compared
with the n - 1 other errors of its own scene at its own age, or, where these are too few, with the other errors of its
scene in the band of ages, one per track. An error is never compared with itself: one that is far out would make the
covariance larger and hide. With m others, mean and covariance are estimates, so that Gaussian errors would still have

    P(T2 > t) = (1 + t / (m - 1))^(-(m - 2) / 2),  T2 = m / (m + 1) (x - mean)^T S^-1 (x - mean)

which is heavy-tailed. Each distance is therefore replaced by the one that a Gaussian exceeds as often (within):

    d2 = (m - 2) log(1 + T2 / (m - 1))

Gaussian errors of any scenes are then Gaussian with covariance 1, however few others there are. Tails of other
distributions are pulled in a little where there are few.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.shape.mardia import whitening
from tracknoise.statistics.grouping import group_rows

Array = NDArray[np.float64]

MIN_OTHERS = 30
"""Fewest other errors that one is compared with."""
_OWN_AGE = ["trimming", "at", "scene"]
_OWN_BAND = ["trimming", "age_low", "scene"]
_SUMS = ["n", "z_u", "z_v", "z_uu", "z_uv", "z_vv"]


def within_scenes(singles: pl.DataFrame, sums: pl.DataFrame) -> Array:
    """Single errors by (within), (rows, 2); NaN where there are too few others, or these lie on a line.

    Parameters
    ----------
    singles
        What `tracknoise.findings.shape.standard.standardised` made of the samples of one condition.
    sums
        What `tracknoise.findings.shape.standard.standard_sums` made of its moments.
    """
    z = singles.select_seq("z_u", "z_v").to_numpy()
    own = np.stack([np.ones(len(z)), *z.T, z[:, 0] ** 2, z[:, 0] * z[:, 1], z[:, 1] ** 2])
    ages = singles.select_seq(_OWN_AGE).join(
        sums.select_seq(*_OWN_AGE, *_SUMS), on=_OWN_AGE, how="left", maintain_order="left"
    )
    others = ages.select_seq(pl.col(_SUMS).fill_null(0.0)).to_numpy().T - own
    few = others[0] < MIN_OTHERS
    if few.any():
        others = np.where(few, _of_bands(singles, own) - own, others)
    return _compared(z, np.where(others[0] < MIN_OTHERS, np.nan, others))


def _of_bands(singles: pl.DataFrame, own: Array) -> Array:
    """Sums over the single errors of the same scene and band, (6, rows)."""
    groups = group_rows(singles, _OWN_BAND)
    return np.stack([np.bincount(groups.index, row, groups.count)[groups.index] for row in own])


def _compared(z: Array, others: Array) -> Array:
    """(within) of each error, given the sums of the others."""
    mean, (a, b, c) = whitening(others)
    u, v = z.T - mean
    m = others[0]
    white = np.stack([a * u, b * u + c * v]) * np.sqrt((m - 1) / m)  # S divides by m - 1
    distance = np.square(white).sum(axis=0)
    expected = (m - 2) * np.log1p(distance * m / (m + 1) / (m - 1))
    scale = np.sqrt(expected / np.where(distance > 0, distance, 1.0))
    return np.asarray((white * scale).T)
