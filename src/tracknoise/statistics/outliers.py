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
    ratio = pl.col("outliers") / pl.col("offered")
    found = reduce_each(frames, FRAMES, "frames", _offered).with_columns(ratio=ratio)
    return check(found.select(*FRAME_RATIOS).sort(*ORIGIN, "frame"), FRAME_RATIOS, "frame ratios")


def outlier_ratios(frames: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Distribution of the outlier ratio over the frames of every condition, all scenes together.

    Parameters
    ----------
    frames
        One frames table, or any number of them, read one at a time.

    Returns
    -------
    polars.DataFrame
        Schema `OUTLIERS`, sorted by condition; see `tracknoise.statistics.box` for the box. `pooled_ratio` is
        sum f1(t) / sum F(t-1). A condition that never had a feature to track has no row.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    conditions = (
        frame_ratios(frames)
        .group_by(POOLED)
        .agg(
            pl.col("ratio"),
            n_frames=pl.len().cast(pl.Int64),
            n_scenes=pl.col("scene").n_unique().cast(pl.Int32),
            offered=pl.col("offered").cast(pl.Int64).sum(),
            outliers=pl.col("outliers").cast(pl.Int64).sum(),
        )
    )
    conditions = conditions.sort(POOLED).with_columns(pooled_ratio=pl.col("outliers") / pl.col("offered"))
    boxes = [asdict(box_summary(ratios.to_numpy())) for ratios in conditions["ratio"]]
    kinds = {column: pl.Float64 for column in OUTLIERS if column not in conditions.columns}
    table = conditions.hstack(pl.DataFrame(boxes, schema=kinds))
    return check(table.select(*OUTLIERS), OUTLIERS, "outliers")


def _offered(frames: pl.DataFrame) -> pl.DataFrame:
    return frames.filter(pl.col("offered") > 0).select(*ORIGIN, "frame", "offered", "outliers")
