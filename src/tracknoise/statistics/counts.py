"""How many observations have each truth status, and how tracks ended."""

from collections.abc import Iterable

import polars as pl

from tracknoise.statistics.grouping import POOLED, add_up
from tracknoise.tables.schema import COUNTS, OBSERVATIONS, TRACKS, TrackEnd, TruthStatus, check


def counts(observations: pl.DataFrame, tracks: pl.DataFrame) -> pl.DataFrame:
    """Count truth statuses and track ends of every condition, trimmed tracks included.

    Parameters
    ----------
    observations, tracks
        Tables of any number of scenes.

    Returns
    -------
    polars.DataFrame
        Schema `COUNTS`, sorted by all columns but `n`: every name of a kind, with 0 where there is none, for each
        condition that the table has.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    statuses = _count(
        check(observations, OBSERVATIONS, "observations"), "truth", [status.name for status in TruthStatus]
    )
    ends = _count(check(tracks, TRACKS, "tracks"), "end", [end.name for end in TrackEnd])
    return merge_counts([statuses, ends])


def merge_counts(tables: Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Add up what `counts` returned for several sets of scenes.

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
    return add_up(tables, COUNTS, "counts").sort([column for column in COUNTS if column != "n"])


def _count(table: pl.DataFrame, kind: str, names: list[str]) -> pl.DataFrame:
    grid = table.select(POOLED).unique().join(pl.DataFrame({"name": names}), how="cross")
    found = table.group_by(*POOLED, name=pl.col(kind).cast(pl.String)).agg(n=pl.len().cast(pl.Int64))
    joined = grid.join(found, on=[*POOLED, "name"], how="left")
    return joined.with_columns(pl.col("n").fill_null(0), kind=pl.lit(kind)).select(*COUNTS)
