"""Changes of errors from one frame of the tracker to the next, and their autocorrelation.

At speed s, d_k = e_k - e_(k - s) is the change of a track's error that ends at age k. Over the pairs of changes of one
track that are l steps apart:

- autocorrelation(l) = sum(d_k d_(k - l s)) / sum((d_k^2 + d_(k - l s)^2) / 2) (autocorrelation)

It is about zero, not about the mean, so that a steady drift shows as positive correlation. It is between -1 and 1 for
any data. Errors that are independent from frame to frame give about -1/2 at lag 1 and 0 beyond (a little less than -1/2
where the first position is exact and tracks are short), those of a random walk 0 at every lag, of a steady drift 1.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.definitions import LAGS, POOLED
from tracknoise.statistics.grouping import group_rows, in_chunks, number_combinations
from tracknoise.statistics.moments import ABOUT_ZERO, SECOND, measure_moments
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.findings_schema import CHANGES
from tracknoise.tables.schema import INCREMENTS, TRIMMING, Schema, typed


def followers(
    track: NDArray[np.intp], frame: NDArray[np.int64], speed: NDArray[np.int64], steps: int
) -> NDArray[np.intp]:
    """Rows for which the row `steps` places above is of the same track, as many frames of the tracker earlier.

    `track, frame, speed`: sorted by track, which is a different number in each sequence and condition, and by frame.
    """
    late, early = slice(steps, None), slice(None, max(len(frame) - steps, 0))
    return np.flatnonzero((track[late] == track[early]) & (frame[late] - frame[early] == steps * speed[late])) + steps


def changes(
    error_px: NDArray[np.float64], track: NDArray[np.intp], frame: NDArray[np.int64], speed: NDArray[np.int64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Rows that follow on another, and how much their error changed since then.

    Shapes: error_px (rows, 2); returns late (changes,), change_px (changes, 2). `late`: row at the end of each change.
    """
    late = followers(track, frame, speed, 1)
    return late, error_px[late] - error_px[late - 1]


_SORTED = ["condition", "block", "trimming", "lag", "age"]


@dataclass(frozen=True, slots=True)
class _Changes:
    """Changes of the errors of some tracks, sorted by condition, track and frame."""

    rows: NDArray[np.intp]  # (changes,): row of the observation at the end of each change
    change_px: NDArray[np.float64]  # (changes, 2): of du and dv


def increments(sequence: PreparedSequence) -> pl.DataFrame:
    """Moments of the changes of errors by age, and the sums that (autocorrelation) is made of.

    Returns schema `INCREMENTS`, sorted by its columns before `n`: lags 0 to `LAGS`, where there are such pairs.
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
    table = seen.with_conditions(pl.concat(parts, how="diagonal").sort(_SORTED))
    return typed(table, INCREMENTS)


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


_KEYS = [*POOLED, "trimming", "lag", "age"]
_PAIRS = (("u", "u"), ("u", "v"), ("v", "v"))
_PRODUCTS = ["lagged_uu", "lagged_vv", "squares_uu", "squares_vv"]
_SUMS = ["n", "n_scenes", *ABOUT_ZERO, *_PRODUCTS]


def change_curves(increments: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Mean and covariance of the changes of errors by age, and their autocorrelation by lag, of every condition.

    Parameters
    ----------
    increments
        What `tracknoise.statistics.changes.increments` made of any number of scenes; or any number of such
        tables, read one at a time. Each scene and condition is in one of them only.

    Returns
    -------
    polars.DataFrame
        Schema `CHANGES`, sorted by condition, trimming, lag and age; covariances are null where n is 1.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    total = pl.DataFrame(schema={**{name: INCREMENTS[name] for name in _KEYS}, **dict.fromkeys(_SUMS, pl.Float64)})
    for chunk in in_chunks(increments, INCREMENTS, "increments"):
        total = _added(pl.concat([total, _sums(chunk)], how="diagonal"))
    alone = pl.when(pl.col("lag") == 0)
    related = pl.when(pl.col("lag") > 0)
    table = total.with_columns(
        **{f"mean_{axis}_px": alone.then(pl.col(axis) / pl.col("n")) for axis in "uv"},
        **{f"covariance_{a}{b}": alone.then(_covariance(a, b)) for a, b in _PAIRS},
        **{f"autocorrelation_{axis}": related.then(_ratio(axis)) for axis in "uv"},
    )
    return typed(table.sort(_KEYS), CHANGES)


def _covariance(a: str, b: str) -> pl.Expr:
    """Null where n is 1; rounding makes no variance negative."""
    n = pl.col("n")
    central = pl.col(a + b) - pl.col(a) * pl.col(b) / n
    return (central.clip(lower_bound=0.0) if a == b else central) / pl.when(n > 1).then(n - 1)


def _ratio(axis: str) -> pl.Expr:
    """Autocorrelation; null where nothing changes."""
    squares = pl.col(f"squares_{axis}{axis}")
    return pl.when(squares > 0).then(pl.col(f"lagged_{axis}{axis}") / squares)


def _sums(increments: pl.DataFrame) -> pl.DataFrame:
    """Sums about zero, which add up, of every scene: all of its blocks together."""
    about_zero = increments.select_seq(pl.col("n").cast(pl.Float64), *_PRODUCTS, **ABOUT_ZERO)
    groups = group_rows(increments, ["scene", *_KEYS])
    sums = groups.sums(about_zero.fill_null(0.0), about_zero.columns)
    return groups.keys.select_seq(_KEYS).hstack(sums).with_columns_seq(n_scenes=1.0)


def _added(sums: pl.DataFrame) -> pl.DataFrame:
    groups = group_rows(sums, _KEYS)
    return groups.keys.hstack(groups.sums(sums, _SUMS))
