"""Dropping the tracks with the largest errors, scene by scene, and saying what was dropped."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from tracknoise.exceptions import SchemaError, SettingsError
from tracknoise.statistics.populations import measured
from tracknoise.tables.schema import OBSERVATIONS, ORIGIN, TRACKS, TRIMS, check

_CONDITION = list(ORIGIN)
_TRACK = [*ORIGIN, "track"]


@dataclass(frozen=True, slots=True)
class Trimmed:
    """Tables in which every track is marked as kept or dropped; no row is removed.

    Attributes
    ----------
    observations
        The observations in the order given, with `kept` as their track's.
    tracks
        The tracks in the order given, with `max_error_px` and `kept`.
    trims
        Schema `TRIMS`, a row for each scene and condition that has tracks, sorted by these.
    """

    observations: pl.DataFrame
    tracks: pl.DataFrame
    trims: pl.DataFrame


def trim(
    observations: pl.DataFrame, tracks: pl.DataFrame, *, percentile: float | None, population: str = "visible"
) -> Trimmed:
    """Mark as dropped the tracks whose largest error exceeds a percentile of their scene and condition.

    A track's largest error is the L2 norm of (du, dv), px, largest over its observations of `population`, null where
    it has none. The threshold is NumPy's linearly interpolated percentile of those that are not null; a track without
    one is kept, for nothing is known against it. As in the paper, tracks that were seen only once count: their largest
    error is 0 or nearly so, which lowers the threshold where such tracks are many.

    Parameters
    ----------
    observations, tracks
        Tables of any number of scenes; their `kept` and `max_error_px` are not read.
    percentile
        From 0 to 100; None keeps every track.
    population
        Which observations count: `visible` or `projected`.

    Raises
    ------
    SettingsError
        If `percentile` is not between 0 and 100.
    UnknownNameError
        If there is no such population.
    SchemaError
        If a table has other columns, or an observation does not belong to exactly one track.
    """
    if percentile is not None and not 0 <= percentile <= 100:
        raise SettingsError(f"trimming percentile is {percentile}, expected 0 to 100")
    errors = measured(check(observations, OBSERVATIONS, "observations"), population=population)
    largest = _with_largest_error(check(tracks, TRACKS, "tracks"), errors)
    thresholds = _thresholds(largest, percentile)
    exceeds = (pl.col("max_error_px") > pl.col("threshold_px")).fill_null(value=False)
    marked = largest.join(thresholds, on=_CONDITION, how="left", maintain_order="left").with_columns(kept=~exceeds)
    marked = marked.select(*TRACKS)
    return Trimmed(_with_kept(observations, marked), marked, _account(marked, thresholds, percentile))


def _with_largest_error(tracks: pl.DataFrame, errors: pl.DataFrame) -> pl.DataFrame:
    error_px = (pl.col("du_px").pow(2) + pl.col("dv_px").pow(2)).sqrt()
    largest = errors.group_by(_TRACK).agg(max_error_px=error_px.max())
    return tracks.drop("max_error_px").join(largest, on=_TRACK, how="left", maintain_order="left")


def _thresholds(tracks: pl.DataFrame, percentile: float | None) -> pl.DataFrame:
    """The cut of each scene and condition, px; null where nothing is cut or no track was measured."""
    groups = tracks.group_by(_CONDITION).agg(pl.col("max_error_px").drop_nulls()).sort(_CONDITION)
    cuts = [
        None if percentile is None or errors.is_empty() else float(np.percentile(errors.to_numpy(), percentile))
        for errors in groups["max_error_px"]
    ]
    return groups.select(_CONDITION).with_columns(pl.Series("threshold_px", cuts, dtype=pl.Float64))


def _with_kept(observations: pl.DataFrame, tracks: pl.DataFrame) -> pl.DataFrame:
    bare = observations.drop("kept")
    joined = bare.join(tracks.select(*_TRACK, "kept"), on=_TRACK, how="left", maintain_order="left")
    if joined.height != observations.height or joined["kept"].null_count():
        raise SchemaError("observations: a track number stands for no track or several in the tracks table, expected 1")
    return check(joined.select(*OBSERVATIONS), OBSERVATIONS, "observations")


def _account(tracks: pl.DataFrame, thresholds: pl.DataFrame, percentile: float | None) -> pl.DataFrame:
    """What was dropped; the share is of the measured tracks, null where there are none."""
    counts = tracks.group_by(_CONDITION).agg(
        n_tracks=pl.len().cast(pl.Int64),
        n_measured=pl.col("max_error_px").count().cast(pl.Int64),
        n_dropped=pl.col("kept").not_().sum().cast(pl.Int64),
    )
    share = pl.when(pl.col("n_measured") > 0).then(pl.col("n_dropped") / pl.col("n_measured"))
    table = thresholds.join(counts, on=_CONDITION, how="left", maintain_order="left").with_columns(
        percentile=pl.lit(percentile, dtype=pl.Float64), dropped_share=share
    )
    return check(table.select(*TRIMS), TRIMS, "trims")
