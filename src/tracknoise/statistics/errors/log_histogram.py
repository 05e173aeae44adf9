"""Histograms of positive numbers in logarithmic bins, fine enough for quantiles, that can be added up."""

import numpy as np
from numpy.typing import NDArray

_PER_OCTAVE = 8
_LOWEST, _OCTAVES = -12, 24
BINS = _PER_OCTAVE * _OCTAVES
"""Number of bins: eight to a factor of two, from 2^-12 to 2^12. What lies beyond is in the first or the last."""
EDGES = 2.0 ** (_LOWEST + np.arange(BINS + 1) / _PER_OCTAVE)
"""(BINS + 1,) float64: bounds of the bins."""


def bin_of(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """(n,) intp: bins of numbers (n,), none negative."""
    with np.errstate(divide="ignore"):
        place = np.floor((np.log2(values) - _LOWEST) * _PER_OCTAVE)
    return np.asarray(np.clip(place, 0, BINS - 1), dtype=np.intp)


def quantile(counts: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Quantile of each histogram, with the numbers of a bin spread evenly over its logarithm.

    Parameters
    ----------
    counts
        (BINS, ...) float64.
    share
        Between 0 and 1.

    Returns
    -------
    (...) float64
        NaN where a histogram is empty, and where the quantile is in the first bin, whose numbers may be any below it.
    """
    up_to = np.cumsum(counts, axis=0)
    wanted = share * up_to[-1]
    place = np.argmax(up_to >= wanted, axis=0)[None]
    inside, above = (np.take_along_axis(values, place, axis=0)[0] for values in (counts, up_to))
    with np.errstate(invalid="ignore", divide="ignore"):
        fraction = 1.0 - (above - wanted) / inside
    found = 2.0 ** (_LOWEST + (place[0] + fraction) / _PER_OCTAVE)
    return np.where((up_to[-1] > 0) & (place[0] > 0), found, np.nan)


def share_below(counts: NDArray[np.float64], limit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of each histogram that lies below a limit, as `quantile` spreads it.

    Parameters
    ----------
    counts
        (BINS, ...) float64.
    limit
        (...) float64, positive.

    Returns
    -------
    (...) float64
        NaN where a histogram is empty, the limit is NaN, or some numbers and the limit are in the first bin.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        at = (np.log2(limit) - _LOWEST) * _PER_OCTAVE
        covered = np.clip(at - np.arange(BINS).reshape(-1, *[1] * np.ndim(limit)), 0.0, 1.0)
        share = (counts * covered).sum(axis=0) / counts.sum(axis=0)
    return np.where((at < 1.0) & (counts[0] > 0), np.nan, share)
