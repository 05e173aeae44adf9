"""Gates that let through a stated share of good tracks, by length of the window and kind of landmark.

Where the first observation has a residual like any other, gates are those of the measured windows, tails included, but
without windows whose residuals are as large as with one outlier. If there are too few, they are those of Gaussian noise
with the components. Where the first observation is exact or a state, its error is in all residuals. The linear
benchmark says what that does to Gaussian noise, and the gate is larger by as much:

    gate = measured modelled(landmark) / modelled(free)    (gates.landmark)
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

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


@dataclass(frozen=True, slots=True, eq=False)
class Gates:
    """Gates of windows of one length.

    Attributes
    ----------
    window, noise
        A window of this length, and its noise; walk and drift per frame of the window.
    modelled, measured
        Quantiles of `LEVELS` of the sum of squared residuals of a track, px^2, over those of chi square with as many
        degrees of freedom, for a free landmark: of Gaussian noise, and of good tracks.
    """

    window: Sequence[LinearTracks]
    noise: TrackNoise
    modelled: tuple[float, ...]
    measured: tuple[float, ...]
    _known: dict[tuple[float, bool], tuple[float, ...]] = field(default_factory=dict, init=False, repr=False)

    def factors(self, sigma: float, *, first: float | None, born_only: bool = False) -> tuple[float, ...]:
        """What to multiply gates at `LEVELS` by, (gates.landmark).

        Parameters
        ----------
        sigma
            Of all observations, px, above 0.
        first
            That of first observations over it; None for a free landmark.
        born_only
            Whether this is that of tracks that begin in the window only.
        """
        squares = self.measured if first is None else self._with_first(first, born_only)
        return tuple(square / sigma**2 for square in squares)

    def _with_first(self, first: float, born_only: bool) -> tuple[float, ...]:
        """Quantiles as in `measured`, of residuals whitened by this ratio for first observations; computed once."""
        if (first, born_only) not in self._known:
            own = partial(gate_factor, self.window, self.noise, sigma=1.0, first=first, born_only=born_only)
            pairs = zip(LEVELS, self.measured, self.modelled, strict=True)
            found = tuple(own(level=level) * measured / modelled for level, measured, modelled in pairs)
            self._known[first, born_only] = found
        return self._known[first, born_only]


def gates(
    windows: pl.DataFrame, length: int, *, limit_px: float, window: Sequence[LinearTracks], noise: TrackNoise
) -> Gates:
    """Gates of windows of a length.

    Parameters
    ----------
    windows
        Schema `WINDOW_NOISE`, of one tracker and speed.
    length
        Frames of the window.
    limit_px
        Errors beyond this are outliers.
    window, noise
        As in `Gates`.
    """
    modelled = tuple(gate_factor(window, noise, sigma=1.0, level=level) for level in LEVELS)
    return Gates(window, noise, modelled, _measured(windows, length, limit_px) or modelled)


def _measured(windows: pl.DataFrame, length: int, limit_px: float) -> tuple[float, ...] | None:
    """Those of the measured windows of nearly this length; None if there are too few, or if they have no noise."""
    apart = (pl.col("window").cast(pl.Int64) - length).abs()
    near = windows.filter(pl.col("trimming") == Trimming.untrimmed, apart <= _NEAR * length)
    if near["n"].to_numpy().sum() < _LEAST:
        return None
    nearest = near.filter(apart == near.select(apart.min()).item())
    counts = np.array(nearest["residual_counts"].to_list(), dtype=np.float64).reshape(-1, BINS).sum(axis=0)
    freedom = (nearest["freedom_u"].to_numpy().sum() + nearest["freedom_v"].to_numpy().sum()) / nearest[
        "n"
    ].to_numpy().sum()
    good = float(share_below(counts, np.array(limit_px / np.sqrt(freedom))))
    squares = [float(quantile(counts, level * good)) ** 2 * freedom for level in LEVELS]
    if not np.isfinite(squares).all():
        return None
    return tuple(
        float(square / (2.0 * gammaincinv(freedom / 2.0, level))) for square, level in zip(squares, LEVELS, strict=True)
    )
