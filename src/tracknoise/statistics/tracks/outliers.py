"""Share of its features that a tracker rejects as outliers, by frame."""

from collections.abc import Iterable
from dataclasses import asdict

import polars as pl

from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.errors.box import box_of_counts
from tracknoise.statistics.grouping import in_chunks, total_if_known
from tracknoise.tables.schema import FRAME_COUNTS, OUTLIERS, check, empty

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
        `tracknoise.statistics.errors.box` for the box. `n_frames` and `n_scenes` count those with F(t-1) > 0.
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
