"""Increments of errors pooled over scenes: mean and covariance by age, and autocorrelation by lag.

See `tracknoise.statistics.errors.increments` for what a change is, and for (autocorrelation).
"""

from collections.abc import Iterable

import polars as pl

from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.errors.moment_cells import ABOUT_ZERO
from tracknoise.statistics.grouping import group_rows, in_chunks
from tracknoise.tables.schema import CHANGES, INCREMENTS, check

_KEYS = [*POOLED, "trimming", "lag", "age"]
_PAIRS = (("u", "u"), ("u", "v"), ("v", "v"))
_PRODUCTS = ["lagged_uu", "lagged_vv", "squares_uu", "squares_vv"]
_SUMS = ["n", "n_scenes", *ABOUT_ZERO, *_PRODUCTS]


def change_curves(increments: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Mean and covariance of the changes of errors by age, and their autocorrelation by lag, of every condition.

    Parameters
    ----------
    increments
        What `tracknoise.statistics.errors.increments.increments` made of any number of scenes; or any number of such
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
    table = table.sort(_KEYS).select(pl.col(name).cast(kind) for name, kind in CHANGES.items())
    return check(table, CHANGES, "changes")


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
