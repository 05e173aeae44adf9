"""Dropping the tracks with the largest errors, scene by scene, and saying what was dropped."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from tracknoise.exceptions import SchemaError, SettingsError, UnknownNameError
from tracknoise.statistics.populations import measured
from tracknoise.tables.defaults import POPULATION, TRIM_AMONG
from tracknoise.tables.schema import AMONG, OBSERVATIONS, ORIGIN, TRACKS, TRIMS, check

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
    observations: pl.DataFrame,
    tracks: pl.DataFrame,
    *,
    percentile: float | None,
    population: str = POPULATION,
    among: str = TRIM_AMONG,
    key_frame: int | None = None,
) -> Trimmed:
    """Mark as dropped the tracks whose largest error exceeds a percentile of their scene and condition.

    A track's largest error is the L2 norm of (du, dv), px, largest over its observations of `population`, null where
    it has none. The threshold is NumPy's linearly interpolated percentile of those that are not null; a track without
    one is kept, for nothing is known against it. A track that has no error but that at its anchor, the frame that fixes
    its true position, has a largest error of 0 or nearly so. As in the paper, such tracks count, and lower the
    threshold where they are many, unless `among` says otherwise.

    Parameters
    ----------
    observations, tracks
        Tables of any number of scenes; their `kept` and `max_error_px` are not read.
    percentile
        From 0 to 100; None keeps every track.
    population
        Which observations count: `visible` or `projected`.
    among
        Of which tracks the percentile is taken: of `all` that have a largest error, or of those that were `followed`,
        which have an error away from their anchor.
    key_frame
        Where a scan fixes true positions: the frame that is every track's anchor. Otherwise it is the track's first.

    Raises
    ------
    SettingsError
        If `percentile` is not between 0 and 100.
    UnknownNameError
        If there is no such population, or no such choice of tracks.
    SchemaError
        If a table has other columns, or an observation does not belong to exactly one track.
    """
    if percentile is not None and not 0 <= percentile <= 100:
        raise SettingsError(f"trimming percentile is {percentile}, expected 0 to 100")
    if among not in AMONG.categories:
        raise UnknownNameError("choice of tracks", among, AMONG.categories)
    errors = measured(check(observations, OBSERVATIONS, "observations"), population=population)
    away = pl.col("age") > 0 if key_frame is None else pl.col("frame") != key_frame
    largest = _with_largest_error(check(tracks, TRACKS, "tracks"), errors, away)
    thresholds = _thresholds(largest, percentile, among)
    exceeds = (pl.col("max_error_px") > pl.col("threshold_px")).fill_null(value=False)
    marked = largest.join(thresholds, on=_CONDITION, how="left", maintain_order="left").with_columns(kept=~exceeds)
    trims = _account(marked, thresholds, percentile, among)
    marked = marked.select(*TRACKS)
    return Trimmed(_with_kept(observations, marked), marked, trims)


def dropped_above(trims: pl.DataFrame) -> float | None:
    """Percentile of the tracks' largest errors above which a run's tracks were dropped; None where none was.

    Parameters
    ----------
    trims
        Schema `TRIMS`, of one run.
    """
    found: list[float] = trims["percentile"].drop_nulls().unique().to_list()
    return found[0] if found and found[0] < 100 else None


def _with_largest_error(tracks: pl.DataFrame, errors: pl.DataFrame, away: pl.Expr) -> pl.DataFrame:
    """Tracks with `max_error_px`, and `followed`: whether they have an error away from their anchor."""
    error_px = (pl.col("du_px").pow(2) + pl.col("dv_px").pow(2)).sqrt()
    largest = errors.group_by(_TRACK).agg(max_error_px=error_px.max(), followed=away.any())
    joined = tracks.drop("max_error_px").join(largest, on=_TRACK, how="left", maintain_order="left")
    return joined.with_columns(pl.col("followed").fill_null(value=False))


def _thresholds(tracks: pl.DataFrame, percentile: float | None, among: str) -> pl.DataFrame:
    """The cut of each scene and condition, px; null where nothing is cut or no track was measured."""
    counted = pl.col("followed") if among == "followed" else pl.col("max_error_px").is_not_null()
    groups = tracks.group_by(_CONDITION).agg(pl.col("max_error_px").filter(counted)).sort(_CONDITION)
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
    return check(joined.select(observations.columns), OBSERVATIONS, "observations")


def _account(tracks: pl.DataFrame, thresholds: pl.DataFrame, percentile: float | None, among: str) -> pl.DataFrame:
    """What was dropped; the share is of the measured tracks, null where there are none."""
    has_error, dropped = pl.col("max_error_px").is_not_null(), ~pl.col("kept")
    counts = tracks.group_by(_CONDITION).agg(
        n_tracks=pl.len().cast(pl.Int64),
        n_measured=has_error.sum().cast(pl.Int64),
        n_anchor_only=(has_error & ~pl.col("followed")).sum().cast(pl.Int64),
        n_dropped=dropped.sum().cast(pl.Int64),
        n_followed_dropped=(dropped & pl.col("followed")).sum().cast(pl.Int64),
    )
    share = pl.when(pl.col("n_measured") > 0).then(pl.col("n_dropped") / pl.col("n_measured"))
    table = thresholds.join(counts, on=_CONDITION, how="left", maintain_order="left").with_columns(
        percentile=pl.lit(percentile, dtype=pl.Float64), among=pl.lit(among, dtype=AMONG), dropped_share=share
    )
    return check(table.select(*TRIMS), TRIMS, "trims")
