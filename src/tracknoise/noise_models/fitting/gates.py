"""Gates that let through a stated share of good tracks, by length of the window."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from scipy.special import gammaincinv

from tracknoise.noise_models.linear_benchmark import gate_factor
from tracknoise.noise_models.linear_window import LinearTracks
from tracknoise.noise_models.track_noise import TrackNoise
from tracknoise.statistics.errors.log_histogram import BINS, quantile, share_below
from tracknoise.tables.enumerations import Trimming

LEVELS = (0.95, 0.99)
_LEAST = 200
_NEAR = 0.2
"""Windows may differ in length by this share."""


def gates(
    windows: pl.DataFrame, length: int, *, limit_px: float, modelled: tuple[Sequence[LinearTracks], TrackNoise]
) -> tuple[float, float]:
    """Quantiles of .95 and .99 of the sum of squared residuals of a track, px^2, over those of chi square.

    They are those of the measured windows of nearly this length, tails included, but without windows whose residuals
    are as large as with one outlier. If there are too few, they are those of Gaussian noise with the components.

    Parameters
    ----------
    windows
        Schema `WINDOW_NOISE`, of one tracker and speed.
    length
        Frames of the window.
    limit_px
        Errors beyond this are outliers.
    modelled
        A window of this length, and its noise; walk and drift per frame of the window.
    """
    apart = (pl.col("window").cast(pl.Int64) - length).abs()
    near = windows.filter(pl.col("trimming") == Trimming.untrimmed, apart <= _NEAR * length)
    if near["n"].to_numpy().sum() < _LEAST:
        low, high = (gate_factor(*modelled, sigma=1.0, level=level) for level in LEVELS)
        return low, high
    nearest = near.filter(apart == near.select(apart.min()).item())
    counts = np.array(nearest["residual_counts"].to_list(), dtype=np.float64).reshape(-1, BINS).sum(axis=0)
    freedom = (nearest["freedom_u"].to_numpy().sum() + nearest["freedom_v"].to_numpy().sum()) / nearest[
        "n"
    ].to_numpy().sum()
    good = float(share_below(counts, np.array(limit_px / np.sqrt(freedom))))
    squares = [float(quantile(counts, level * good)) ** 2 * freedom for level in LEVELS]
    low, high = (
        float(square / (2.0 * gammaincinv(freedom / 2.0, level))) for square, level in zip(squares, LEVELS, strict=True)
    )
    return low, high
