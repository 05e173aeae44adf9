"""What share of its features a tracker rejects as outliers, frame by frame."""

from collections.abc import Iterable
from dataclasses import asdict

import polars as pl

from tracknoise.statistics.box import box_summary
from tracknoise.statistics.grouping import POOLED, reduce_each
from tracknoise.tables.schema import FRAMES, ORIGIN, OUTLIERS, Schema, check

FRAME_RATIOS: Schema = {
    **ORIGIN,
    "frame": pl.UInt32,
    "offered": pl.UInt32,
    "outliers": pl.UInt32,
    "ratio": pl.Float64,
}

_RATIO = pl.when(pl.col("offered") > 0).then(pl.col("outliers") / pl.col("offered"))


def frame_ratios(frames: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Outlier ratio f1(t) / F(t-1) of every frame that the tracker entered with features.

    Parameters
    ----------
    frames
        One frames table, or any number of them, read one at a time.

    Returns
    -------
    polars.DataFrame
        Schema `FRAME_RATIOS`, sorted by scene, condition and frame; frames with F(t-1) = 0 have no row.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    found = _each_frame(frames).drop_nulls("ratio")
    return check(found.sort(*ORIGIN, "frame"), FRAME_RATIOS, "frame ratios")


def outlier_ratios(frames: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Distribution of the outlier ratio over the frames of every condition, all scenes together.

    Parameters
    ----------
    frames
        One frames table, or any number of them, read one at a time.

    Returns
    -------
    polars.DataFrame
        Schema `OUTLIERS`, sorted by condition: every condition that the frames have; see `tracknoise.statistics.box`
        for the box. `n_frames` and `n_scenes` count those with F(t-1) > 0. `pooled_ratio` is sum f1(t) / sum F(t-1).
        Where a condition never had a feature to track, counts are 0 and ratios null.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    conditions = (
        _each_frame(frames)
        .group_by(POOLED)
        .agg(
            pl.col("ratio").drop_nulls(),
            n_frames=pl.col("ratio").count().cast(pl.Int64),
            n_scenes=pl.col("scene").filter(pl.col("ratio").is_not_null()).n_unique().cast(pl.Int32),
            offered=pl.col("offered").cast(pl.Int64).sum(),
            outliers=pl.col("outliers").cast(pl.Int64).sum(),
        )
    )
    conditions = conditions.sort(POOLED).with_columns(pooled_ratio=_RATIO)
    boxes = [asdict(box_summary(ratios.to_numpy())) for ratios in conditions["ratio"]]
    kinds = {column: pl.Float64 for column in OUTLIERS if column not in conditions.columns}
    table = conditions.hstack(pl.DataFrame(boxes, schema=kinds))
    return check(table.select(*OUTLIERS), OUTLIERS, "outliers")


def _each_frame(frames: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """All frames with the columns of `FRAME_RATIOS`; the ratio is null where F(t-1) = 0."""
    columns = [*ORIGIN, "frame", "offered", "outliers"]
    return reduce_each(frames, FRAMES, "frames", lambda table: table.select(columns)).with_columns(ratio=_RATIO)
