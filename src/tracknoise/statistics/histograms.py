"""Histograms that can be added, quantiles from them, and the definition of what box plots show."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import ArrayLike, NDArray

from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import add_up, group_runs
from tracknoise.tables.findings_schema import ERRORS
from tracknoise.tables.schema import TRACKS, check

BINS_PER_DECADE = 10
# Rounded to be the same on every machine.
_BOUNDS_PX = [
    float(f"{10 ** (step / BINS_PER_DECADE):.6g}") for step in range(-3 * BINS_PER_DECADE, 3 * BINS_PER_DECADE + 1)
]
HISTOGRAM_BINS = pl.DataFrame(
    {"bin": range(len(_BOUNDS_PX) + 1), "bin_low_px": [0.0, *_BOUNDS_PX], "bin_high_px": [*_BOUNDS_PX, None]},
    schema={"bin": pl.Int64, "bin_low_px": pl.Float64, "bin_high_px": pl.Float64},
)
"""[0, 0.001) px, ten bins per decade up to 1000 px, then one bin from 1000 px on, whose upper bound is null."""


def error_histogram(tracks: pl.DataFrame) -> pl.DataFrame:
    """Histogram of the largest L2 error of every track, before trimming, of every condition.

    Returns schema `ERRORS`, sorted by condition and bin: every bin of `HISTOGRAM_BINS` for every condition that has
    tracks. A bin includes its lower bound but not its upper one.
    """
    (groups,) = group_runs([check(tracks, TRACKS, "tracks")], POOLED)
    measured = tracks["max_error_px"].is_not_null().to_numpy()
    place = np.searchsorted(_BOUNDS_PX, tracks["max_error_px"].to_numpy()[measured], side="right")
    n = np.bincount(
        groups.index[measured] * HISTOGRAM_BINS.height + place, minlength=groups.count * HISTOGRAM_BINS.height
    )
    grid = groups.keys.join(HISTOGRAM_BINS, how="cross", maintain_order="left_right")
    table = grid.with_columns(n=pl.Series(n, dtype=pl.Int64))
    return check(table.select(*ERRORS), ERRORS, "errors")


def merge_errors(errors: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Add up what `error_histogram` returned for several sets of tracks.

    Parameters
    ----------
    errors
        One table of errors, or any number of them, read one at a time.

    Returns
    -------
    polars.DataFrame
        Schema `ERRORS`, sorted by condition and bin.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    total = add_up(errors, ERRORS, "errors")
    return check(total.sort(*POOLED, "bin_low_px"), ERRORS, "errors")


_PER_OCTAVE = 8
_LOWEST, _OCTAVES = -12, 24
LOG_HISTOGRAM_BINS = _PER_OCTAVE * _OCTAVES
"""Number of bins: eight to a factor of two, from 2^-12 to 2^12. What lies beyond is in the first or the last."""


def bin_of(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """(n,) intp: bins of numbers (n,), none negative."""
    with np.errstate(divide="ignore"):
        place = np.floor((np.log2(values) - _LOWEST) * _PER_OCTAVE)
    return np.asarray(np.clip(place, 0, LOG_HISTOGRAM_BINS - 1), dtype=np.intp)


def listed(group: NDArray[np.intp], values: NDArray[np.float64], count: int) -> pl.Series:
    """Histogram of the values (n,) of each of `count` groups, as lists; missing values are not counted."""
    is_known = ~np.isnan(values)
    cells = group[is_known] * LOG_HISTOGRAM_BINS + bin_of(values[is_known])
    counted = np.bincount(cells, minlength=count * LOG_HISTOGRAM_BINS).reshape(count, LOG_HISTOGRAM_BINS)
    return pl.Series(counted.tolist(), dtype=pl.List(pl.UInt32))


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
    value = 2.0 ** (_LOWEST + (place[0] + fraction) / _PER_OCTAVE)
    return np.where((up_to[-1] > 0) & (place[0] > 0), value, np.nan)


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
        position = (np.log2(limit) - _LOWEST) * _PER_OCTAVE
        covered = np.clip(position - np.arange(LOG_HISTOGRAM_BINS).reshape(-1, *[1] * np.ndim(limit)), 0.0, 1.0)
        share = (counts * covered).sum(axis=0) / counts.sum(axis=0)
    return np.where((position < 1.0) & (counts[0] > 0), np.nan, share)


WHISKER_REACH = 1.5


@dataclass(frozen=True, slots=True)
class Box:
    """Box, whiskers and mean of n values, in their unit; all None where n is 0."""

    n: int
    mean: float | None
    median: float | None
    lower_quartile: float | None
    upper_quartile: float | None
    lower_whisker: float | None
    upper_whisker: float | None


def box_summary(values: ArrayLike) -> Box:
    """Summarise values for a box plot.

    Quartiles are NumPy's linearly interpolated percentiles. Each whisker ends at the last value within 1.5 times the
    interquartile range of its quartile, or at the quartile itself where no value lies in between.

    Parameters
    ----------
    values
        (n,) finite numbers in any order, which does not change the result.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    if not ordered.size:
        return Box(0, *[None] * 6)
    return _box(ordered.size, float(np.mean(ordered)), np.percentile(ordered, [25, 50, 75]), ordered)


def box_of_counts(values: ArrayLike, counts: ArrayLike) -> Box:
    """Summarise a histogram for a box plot, as `box_summary` does the values that were counted.

    Parameters
    ----------
    values
        (m,) finite numbers, each once, in any order.
    counts
        (m,) how often each occurred.
    """
    numbers, times = np.asarray(values, dtype=np.float64), np.asarray(counts, dtype=np.int64)
    order = np.argsort(numbers[times > 0])
    ordered, last = numbers[times > 0][order], np.cumsum(times[times > 0][order])
    if not ordered.size:
        return Box(0, *[None] * 6)
    n = int(last[-1])
    position = np.array([0.25, 0.5, 0.75]) * (n - 1)
    below, above = (ordered[np.searchsorted(last, rounded(position), side="right")] for rounded in (np.floor, np.ceil))
    quartiles = below + (position % 1.0) * (above - below)
    return _box(n, float(ordered @ np.diff(last, prepend=0)) / n, quartiles, ordered)


def _box(n: int, mean: float, quartiles: NDArray[np.float64], ordered: NDArray[np.float64]) -> Box:
    lower, median, upper = map(float, quartiles)
    reach = WHISKER_REACH * (upper - lower)
    within = ordered[(ordered >= lower - reach) & (ordered <= upper + reach)]
    lowest, highest = min(lower, float(within[0])), max(upper, float(within[-1]))
    return Box(n, mean, median, lower, upper, lowest, highest)
