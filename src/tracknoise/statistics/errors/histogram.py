"""Histogram of the tracks' largest errors in fixed bins, so that histograms can be added."""

from collections.abc import Iterable

import numpy as np
import polars as pl

from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import add_up, group_runs
from tracknoise.tables.schema import ERRORS, TRACKS, check

BINS_PER_DECADE = 10
# Rounded to be the same on every machine.
_BOUNDS_PX = [
    float(f"{10 ** (step / BINS_PER_DECADE):.6g}") for step in range(-3 * BINS_PER_DECADE, 3 * BINS_PER_DECADE + 1)
]
BINS = pl.DataFrame(
    {"bin": range(len(_BOUNDS_PX) + 1), "bin_low_px": [0.0, *_BOUNDS_PX], "bin_high_px": [*_BOUNDS_PX, None]},
    schema={"bin": pl.Int64, "bin_low_px": pl.Float64, "bin_high_px": pl.Float64},
)
"""[0, 0.001) px, ten bins per decade up to 1000 px, then one bin from 1000 px on, whose upper bound is null."""


def error_histogram(tracks: pl.DataFrame) -> pl.DataFrame:
    """Histogram of the largest L2 error of every track, before trimming, of every condition.

    Parameters
    ----------
    tracks
        A tracks table with `max_error_px` filled in (`tracknoise.statistics.trimming`). Tracks without a measured error
        are not counted.

    Returns
    -------
    polars.DataFrame
        Schema `ERRORS`, sorted by condition and bin: every bin of `BINS` for every condition that has tracks. A bin
        includes its lower bound but not its upper one.

    Raises
    ------
    SchemaError
        If the table has other columns.
    """
    (groups,) = group_runs([check(tracks, TRACKS, "tracks")], POOLED)
    measured = tracks["max_error_px"].is_not_null().to_numpy()
    place = np.searchsorted(_BOUNDS_PX, tracks["max_error_px"].to_numpy()[measured], side="right")
    n = np.bincount(groups.index[measured] * BINS.height + place, minlength=groups.count * BINS.height)
    grid = groups.keys.join(BINS, how="cross", maintain_order="left_right")
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
