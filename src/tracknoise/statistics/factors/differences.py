"""How far curves differ, relative to how far they vary together.

For curves c_l and c_m of one statistic and coordinate:

- difference = max over k of |c_l(k) - c_m(k)|, over the ages (frames) k that both curves have (effect.difference)
- common = range over the same k of (c_l(k) + c_m(k)) / 2, the zero at age 0 (in the key frame) included (effect.common)
- effect = difference / common (effect.pair)

Curves are compared in pairs because at different speeds they do not have the same ages: each pair is judged where both
were seen, and a pair that shares nothing is left out.
"""

from collections.abc import Mapping

import polars as pl

from tracknoise.tables.enumerations import Axis


def comparable(curves: pl.DataFrame, key_frames: Mapping[str, int]) -> pl.DataFrame:
    """The points of curves at which they may be compared: not cut, and where errors are not zero by construction.

    Parameters
    ----------
    curves
        Columns axis, direction, at and cut, besides any others.
    key_frames
        Where curves run along frames: the one in which errors are zero, by direction.

    Returns
    -------
    polars.DataFrame
        The same columns; `at` is an age, or counts frames from the key frame on (Int64).
    """
    key = pl.col("direction").replace_strict(dict(key_frames), default=0, return_dtype=pl.Int64)
    away = pl.col("at").cast(pl.Int64) - pl.when(pl.col("axis") == Axis.frame).then(key).otherwise(0)
    return curves.with_columns(at=away).filter(pl.col("at") != 0, ~pl.col("cut"))


def largest_differences(points: pl.DataFrame, *, by: list[str], level: str) -> pl.DataFrame:
    """Compare the curves of every pair of levels, by (effect.difference) and (effect.common).

    Parameters
    ----------
    points
        Columns of `by`, `level` (sortable), `at`, `u` and `v`, one row per point of a curve, without points at which
        errors are zero by construction.
    by
        Columns whose values are not compared with one another.
    level
        Column whose values are compared.

    Returns
    -------
    polars.DataFrame
        Columns of `by`, `coordinate`, `level_a` before `level_b`, `difference` and `at`, `common`, `effect` (infinite
        where levels differ and nothing varies, 0 where neither), `n_shared`. Pairs that share no place have no row.
    """
    values = points.select(*by, "at", pl.col(level).alias("level"), "u", "v").unpivot(
        ["u", "v"], index=[*by, "at", "level"], variable_name="coordinate", value_name="value"
    )
    both = values.drop_nulls("value").join(values.drop_nulls("value"), on=[*by, "coordinate", "at"], suffix="_b")
    pairs = both.filter(pl.col("level") < pl.col("level_b")).sort("at")
    apart, middle = (pl.col("value") - pl.col("value_b")).abs(), (pl.col("value") + pl.col("value_b")) / 2
    found = pairs.group_by(*by, "coordinate", level_a="level", level_b="level_b").agg(
        difference=apart.max(),
        at=pl.col("at").get(apart.arg_max()),
        common=pl.max_horizontal(middle.max(), 0.0) - pl.min_horizontal(middle.min(), 0.0),
        n_shared=pl.len().cast(pl.Int32),
    )
    return found.with_columns(effect=relative("difference", "common"))


def relative(difference: str, common: str) -> pl.Expr:
    """One column by another: infinite where the second is 0, unless the first is too: nothing differs then."""
    return pl.when(pl.col(difference) == 0).then(0.0).otherwise(pl.col(difference) / pl.col(common))
