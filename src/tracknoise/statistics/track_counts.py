"""Counts of observations and of ends of tracks, and the share of features that a tracker rejects."""

from collections.abc import Iterable
from dataclasses import asdict

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import add_up, group_rows, in_chunks, total_if_known
from tracknoise.statistics.histograms import box_of_counts
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.findings_schema import COUNTS, OUTLIERS
from tracknoise.tables.schema import FRAME_COUNTS, TrackEnd, TruthStatus, check, empty

_SORTED = [column for column in COUNTS if column != "n"]


def counts(sequence: PreparedSequence) -> pl.DataFrame:
    """Count truth statuses and track ends of every condition, trimmed tracks included.

    Returns schema `COUNTS`, sorted by all columns but `n`: every name of a kind, with 0 where there is none, for each
    condition that the table has. Counts of ends are null, but for those of tracks that were alive at the end, in
    conditions whose tracker does not report causes.
    """
    seen, tracks = sequence.seen, sequence.tracks
    statuses = _count(seen.conditions, seen.condition, sequence.observations["truth"], TruthStatus, "truth")
    ends = _count(seen.conditions, sequence.track_condition, tracks["end"], TrackEnd, "end")
    return pl.concat([statuses, ends]).select(*COUNTS).sort(_SORTED)


def merge_counts(tables: Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Add up the counts of several sets of scenes.

    Parameters
    ----------
    tables
        Any number of counts tables, read one at a time.

    Returns
    -------
    polars.DataFrame
        Schema `COUNTS`, sorted by all columns but `n`.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    return add_up(tables, COUNTS, "counts").sort(_SORTED)


def _count(
    conditions: pl.DataFrame,
    condition: NDArray[np.intp],
    column: pl.Series,
    names: type[TruthStatus] | type[TrackEnd],
    kind: str,
) -> pl.DataFrame:
    """Rows with each name, by condition; `condition` is that of each row, `column` its name."""
    pooled = group_rows(conditions, POOLED)
    place, stated = pooled.index[condition], column.is_not_null().to_numpy()
    codes = place[stated] * len(names) + column.drop_nulls().to_physical().to_numpy()
    n = pl.Series(np.bincount(codes, minlength=pooled.count * len(names)), dtype=pl.Int64)
    unknown = np.isin(np.arange(pooled.count), place[~stated]).repeat(len(names))
    n = n.set(pl.Series(unknown) & (n == 0), None)
    all_names = pl.DataFrame({"kind": kind, "name": [name.name for name in names]})
    grid = pooled.keys.join(all_names, how="cross", maintain_order="left_right")
    present = np.isin(np.arange(pooled.count), pooled.index[condition])
    return grid.with_columns(n=n).filter(pl.Series(present.repeat(len(names))))


_HAS_FEATURES = pl.col("offered") > 0
_RATIO = pl.when(_HAS_FEATURES).then(pl.col("outliers") / pl.col("offered"))


def outlier_ratios(frames: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Distribution of the outlier ratio over the frames of every condition, all scenes together.

    Parameters
    ----------
    frames
        One frames table, or any number of tables, read one at a time.

    Returns
    -------
    polars.DataFrame
        Schema `OUTLIERS`, sorted by condition: every condition that the frames have; see
        `tracknoise.statistics.histograms` for the box. `n_frames` and `n_scenes` count those with F(t-1) > 0.
        `pooled_ratio` is sum f1(t) / sum F(t-1). Where a condition never had a feature to track, counts are 0 and
        ratios null. `outliers` and ratios are null where the tracker does not report outliers.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    totals, ratios, scenes = _pooled(frames)
    n_scenes = scenes.group_by(POOLED).agg(n_scenes=pl.len().cast(pl.Int32))
    listed = ratios.group_by(POOLED).agg("ratio", "times")
    conditions = totals.join(n_scenes, on=POOLED, how="left").join(listed, on=POOLED, how="left").sort(POOLED)
    conditions = conditions.with_columns(pl.col("n_scenes").fill_null(0), pooled_ratio=_RATIO)
    boxes = [_box(row["ratio"], row["times"]) for row in conditions.iter_rows(named=True)]
    kinds = {column: pl.Float64 for column in OUTLIERS if column not in conditions.columns}
    table = conditions.hstack(pl.DataFrame(boxes, schema=kinds))
    return check(table.select(*OUTLIERS), OUTLIERS, "outliers")


def _pooled(
    frames: pl.DataFrame | Iterable[pl.DataFrame],
) -> tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]:
    """Counts of each condition; how often it had each ratio; and its scenes with F(t-1) > 0."""
    seen = empty(FRAME_COUNTS).with_columns(ratio=_RATIO)
    totals, ratios, scenes = _totals(seen), _ratios(seen), _scenes(seen)
    for chunk in in_chunks(frames, FRAME_COUNTS, "frames"):
        seen = chunk.with_columns(ratio=_RATIO)
        counts = (total_if_known(name, pl.col(name).sum()) for name in ("n_frames", "offered", "outliers"))
        totals = pl.concat([totals, _totals(seen)]).group_by(POOLED).agg(counts)
        ratios = pl.concat([ratios, _ratios(seen)]).group_by(*POOLED, "ratio").agg(pl.col("times").sum())
        scenes = pl.concat([scenes, _scenes(seen)]).unique()
    return totals, ratios, scenes


def _totals(seen: pl.DataFrame) -> pl.DataFrame:
    sums = (total_if_known(name, pl.col(name).cast(pl.Int64).sum()) for name in ("offered", "outliers"))
    return seen.group_by(POOLED).agg(_HAS_FEATURES.sum().cast(pl.Int64).alias("n_frames"), *sums)


def _ratios(seen: pl.DataFrame) -> pl.DataFrame:
    """There are few: with up to some thousand features, ratios recur."""
    return seen.drop_nulls("ratio").group_by(*POOLED, "ratio").agg(times=pl.len().cast(pl.Int64))


def _scenes(seen: pl.DataFrame) -> pl.DataFrame:
    return seen.filter(_HAS_FEATURES).select("scene", *POOLED).unique()


def _box(ratios: list[float] | None, times: list[int] | None) -> dict[str, float | None]:
    return asdict(box_of_counts(ratios or [], times or []))
