"""Changes of errors from one frame of the tracker to the next, and their autocorrelation.

At speed s, d_k = e_k - e_(k - s) is the change of a track's error that ends at age k. Over the pairs of changes of one
track that are l steps apart:

- autocorrelation(l) = sum(d_k d_(k - l s)) / sum((d_k^2 + d_(k - l s)^2) / 2) (autocorrelation)

It is about zero, not about the mean, so that a steady drift shows as positive correlation. It is between -1 and 1 for
any data. Errors that are independent from frame to frame give about -1/2 at lag 1 and 0 beyond (a little less than -1/2
where the first position is exact and tracks are short), those of a random walk 0 at every lag, of a steady drift 1.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.definitions import LAGS
from tracknoise.statistics.errors.joint import measure_moments
from tracknoise.statistics.errors.moment_cells import SECOND
from tracknoise.statistics.grouping import number_combinations
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.steps import changes, followers
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.schema import INCREMENTS, TRIMMING, Schema, check

_SORTED = ["condition", "block", "trimming", "lag", "age"]


@dataclass(frozen=True, slots=True)
class _Changes:
    """Changes of the errors of some tracks, sorted by condition, track and frame.

    Attributes
    ----------
    rows : (changes,) intp
        Row of the observation at the end of each change.
    change_px : (changes, 2) float64
        Of du and dv.
    """

    rows: NDArray[np.intp]
    change_px: NDArray[np.float64]


def increments(sequence: PreparedSequence) -> pl.DataFrame:
    """Moments of the changes of errors by age, and the sums that (autocorrelation) is made of.

    Parameters
    ----------
    sequence
        Trimmed. Only visible observations count. Where one is missing in between, there is no change across the gap.

    Returns
    -------
    polars.DataFrame
        Schema `INCREMENTS`, sorted by its columns before `n`: lags 0 to `LAGS`, where there are such pairs.
    """
    seen = sequence.seen
    rows = sequence.ordered_where(seen.visible)
    late, change_px = changes(seen.error_px[rows], sequence.track_row[rows], seen.frame[rows], seen.speed[rows])
    kept = seen.kept[rows[late]]
    selections = {
        Trimming.untrimmed: _Changes(rows[late], change_px),
        Trimming.trimmed: _Changes(rows[late][kept], change_px[kept]),
    }
    parts = [
        table.with_columns(trimming=pl.lit(trimming, dtype=TRIMMING))
        for trimming, chosen in selections.items()
        for table in (_by_age(sequence, chosen), *_products(sequence, chosen))
    ]
    table = pl.concat(parts, how="diagonal").sort(_SORTED)
    table = table.hstack(seen.conditions[table["condition"]])
    return check(table.select(pl.col(name).cast(kind) for name, kind in INCREMENTS.items()), INCREMENTS, "increments")


def _by_age(sequence: PreparedSequence, changed: _Changes) -> pl.DataFrame:
    """Rows of lag 0."""
    seen, rows = sequence.seen, changed.rows
    (condition, age), index = number_combinations([seen.condition[rows], seen.age[rows]])
    moments = measure_moments(changed.change_px, index, len(age), orders=SECOND)
    columns = {"n": moments.n, **dict(zip(("mean_u", "mean_v"), moments.mean.T, strict=True))}
    columns |= dict(zip(("m_uu", "m_uv", "m_vv"), moments.central.T, strict=True))
    keys = pl.DataFrame({"condition": condition, "age": age}, schema_overrides={"age": INCREMENTS["age"]})
    return keys.hstack(_typed(columns)).with_columns(lag=pl.lit(0, dtype=pl.UInt32))


def _products(sequence: PreparedSequence, changed: _Changes) -> Iterator[pl.DataFrame]:
    """Rows of each lag from 1 on."""
    seen, rows = sequence.seen, changed.rows
    track, frame, speed = sequence.track_row[rows], seen.frame[rows], seen.speed[rows]
    (condition, block), index = number_combinations([seen.condition[rows], sequence.block[rows]])
    keys = pl.DataFrame({"condition": condition, "block": block}, schema_overrides={"block": INCREMENTS["block"]})
    for lag in range(1, LAGS + 1):
        late = followers(track, frame, speed, lag)
        group = index[late]
        columns = {"n": np.bincount(group, minlength=len(block))}
        for axis, values in zip("uv", changed.change_px.T, strict=True):
            now, before = values[late], values[late - lag]
            terms = {f"lagged_{axis}{axis}": now * before, f"squares_{axis}{axis}": (now**2 + before**2) / 2}
            columns |= {name: np.bincount(group, term, len(block)) for name, term in terms.items()}
        yield keys.hstack(_typed(columns)).filter(pl.col("n") > 0).with_columns(lag=pl.lit(lag, dtype=pl.UInt32))


def _typed(columns: Mapping[str, NDArray[np.int64] | NDArray[np.float64]]) -> pl.DataFrame:
    kinds: Schema = {name: INCREMENTS[name] for name in columns}
    return pl.DataFrame(columns, schema=dict(kinds))
