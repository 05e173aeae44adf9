"""Number of observations with each truth status, and of tracks with each end."""

from collections.abc import Iterable

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import add_up, group_rows
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.schema import COUNTS, TrackEnd, TruthStatus

_SORTED = [column for column in COUNTS if column != "n"]


def counts(sequence: PreparedSequence) -> pl.DataFrame:
    """Count truth statuses and track ends of every condition, trimmed tracks included.

    Returns
    -------
    polars.DataFrame
        Schema `COUNTS`, sorted by all columns but `n`: every name of a kind, with 0 where there is none, for each
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
    every = pl.DataFrame({"kind": kind, "name": [name.name for name in names]})
    grid = pooled.keys.join(every, how="cross", maintain_order="left_right")
    present = np.isin(np.arange(pooled.count), pooled.index[condition])
    return grid.with_columns(n=n).filter(pl.Series(present.repeat(len(names))))
