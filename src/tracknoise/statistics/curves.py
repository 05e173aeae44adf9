"""Bias, mean absolute error and spread by age, or by frame, from moments.

With n the features at age k (the paper's Psi(k)) and du_i, dv_i their errors:

- nu_u(k) = sum(du_i) / n, px (nu)
- eta_u(k) = sum(|du_i|) / n, px (eta)
- Phi_uv(k) = sum(du_i dv_i) / n, px^2 (Phi): the second moment about zero, which the paper calls covariance
- central_uv(k) = sum((du_i - nu_u) (dv_i - nu_v)) / (n - 1), px^2: the covariance in the usual sense

If a single scan anchors the features that are visible in its key frame, the same values of the M features in frame t
are called mu_u(t), kappa_u(t) and Sigma_uv(t) (mu), (kappa), (Sigma).

Differences from the paper: it divides Phi by n - 1, its printed sum limit of nu is a misprint for Psi(k), and it has
no central covariance.
"""

from collections.abc import Iterable, Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.checks import require_whole
from tracknoise.statistics.definitions import NAMES, POOLED, UNITS
from tracknoise.statistics.grouping import group_rows, in_chunks, tables_of
from tracknoise.statistics.moments import MOMENT_VALUES, SECOND, merge_groups
from tracknoise.tables.defaults import MIN_FEATURES
from tracknoise.tables.enumerations import Aspect, Axis, Weighting
from tracknoise.tables.findings_schema import ASPECT_CURVES, CURVES
from tracknoise.tables.schema import ASPECTS, MOMENTS, WEIGHTING, Schema, check, empty

_CURVE = [*POOLED, "population", "trimming", "axis"]
_POINT = [*_CURVE, "at"]
_ASPECT = ["aspect", "at_least"]
_COLUMNS = {"mean": ("u", "v"), "absolute": ("u", "v"), "second": ("u", "v", "uv"), "central": ("u", "v", "uv")}
"""Which values each statistic has."""
_MOMENTS = ["n", "mean_u", "mean_v", "m_uu", "m_uv", "m_vv", "mean_abs_u", "mean_abs_v"]
"""Columns of moments that curves are made of."""
CURVE_COLUMNS, ASPECT_COLUMNS = (
    {name: kind for name, kind in schema.items() if name not in MOMENT_VALUES or name in _MOMENTS}
    for schema in (MOMENTS, ASPECTS)
)
"""Columns of `MOMENTS` and of `ASPECTS` without moments of higher orders: curves need no others."""
_HIGHER = [name for name in MOMENT_VALUES if name not in _MOMENTS]
_SUMS = {statistic: [f"{statistic} {column}" for column in columns] for statistic, columns in _COLUMNS.items()}
_SCENES = {statistic: f"{statistic} scenes" for statistic in _COLUMNS}

_Values = dict[str, tuple[NDArray[np.float64], NDArray[np.int64]]]
"""For each statistic: its values, (points, 2 or 3), NaN where undefined; and the number of its scenes, (points,)."""
_SIGNLESS = {names[role] for names in NAMES.values() for role in ("absolute", "second")}
"""Statistics that do not change with the sign of an axis."""


def curves(moments: pl.DataFrame | Iterable[pl.DataFrame], *, min_features: int = MIN_FEATURES) -> pl.DataFrame:
    """Curves of (nu), (eta), (Phi), or (mu), (kappa), (Sigma), and central covariance, pooled over scenes.

    Parameters
    ----------
    moments
        A moments table with one row per scene, condition, population, trimming and age or frame; or any number of such
        tables, which are read a few at a time. `CURVE_COLUMNS` suffice. A scene that a bootstrap drew twice occurs and
        counts twice. The order of rows does not matter. The order and the sizes of tables affect the rounding of
        sums only.
    min_features
        `cut` is set from the first age of a condition at which its scenes together have fewer features than this. On
        an axis of frames it is set outwards from the frame with the most features, on both sides.

    Returns
    -------
    polars.DataFrame
        Schema `CURVES`, sorted by all columns that come before `n`. Weighting `features` pools all features of all
        scenes as the paper does; `scenes` is the mean over scenes of each scene's own statistic. `n` counts the
        features of all scenes in both, `n_scenes` the scenes of the value. Second moments are null if
        n is 1. With weighting `scenes`, they exclude scenes with a single feature.

    Raises
    ------
    SchemaError
        If the table has other columns.
    SettingsError
        If `min_features` is no whole number of at least 1.
    """
    return check(_curves(moments, CURVE_COLUMNS, "moments", [], min_features), CURVES, "curves")


def aspect_curves(aspects: pl.DataFrame | Iterable[pl.DataFrame], *, min_features: int = MIN_FEATURES) -> pl.DataFrame:
    """Curves of every aspect, pooled over scenes: see `curves`.

    Parameters
    ----------
    aspects
        Schema `ASPECTS`, of any number of scenes; or any number of such tables, read a few at a time. `ASPECT_COLUMNS`
        suffice.
    min_features
        As in `curves`.

    Returns
    -------
    polars.DataFrame
        Schema `ASPECT_CURVES`, sorted by aspect, `at_least`, and then as curves are. u is along and v across the motion
        or the gradient. The gradient has no sign, so that there are no means and central moments along it.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    table = _curves(aspects, ASPECT_COLUMNS, "aspects", _ASPECT, min_features)
    undefined = (pl.col("aspect") == Aspect.gradient) & ~pl.col("statistic").is_in(_SIGNLESS)
    return check(table.filter(~undefined), ASPECT_CURVES, "aspect curves")


def _curves(
    tables: pl.DataFrame | Iterable[pl.DataFrame], schema: Schema, name: str, labels: Sequence[str], min_features: int
) -> pl.DataFrame:
    """Curves for each combination of the columns `labels`, which come first."""
    require_whole("min_features", min_features, 1)
    narrow = (table.drop(_HIGHER, strict=False) for table in tables_of(tables, name))
    points = _pooled(in_chunks(narrow, schema, name), schema, [*labels, *_POINT])
    keys = _with_cuts(points.select(*labels, *_POINT, "n"), [*labels, *_CURVE], min_features)
    weightings = {Weighting.features: _by_features(points), Weighting.scenes: _by_scenes(points)}
    columns = [*labels, *CURVES]
    tables = [
        _table(keys, weighting, statistic, *values[statistic]).select(columns)
        for weighting, values in weightings.items()
        for statistic in UNITS
    ]
    values = ("n", "n_scenes", "unit", "u", "v", "uv", "cut")
    return pl.concat(tables).sort([column for column in columns if column not in values])


def _pooled(chunks: Iterable[pl.DataFrame], schema: Schema, point: list[str]) -> pl.DataFrame:
    """The moments of every point, all scenes together, and the sums over scenes of each one's own statistics."""
    points = _with_sums(empty(schema), point)
    labels = [column for column in schema if column not in MOMENT_VALUES and column not in point]
    for chunk in chunks:
        scenes = chunk.filter(pl.col("n") > 0).sort(labels, maintain_order=True)
        points = _added(pl.concat([points, _with_sums(scenes, point)]), point)
    return points


def _with_sums(scenes: pl.DataFrame, point: list[str]) -> pl.DataFrame:
    """The moments of scenes with their own statistics, 0 where undefined, and for how many scenes these are defined."""
    columns: dict[str, NDArray[np.float64] | NDArray[np.int64]] = {}
    for statistic, values in _statistics(scenes).items():
        columns |= dict(zip(_SUMS[statistic], np.nan_to_num(values).T, strict=True))
        columns[_SCENES[statistic]] = (~np.isnan(values[:, 0])).astype(np.int64)
    return scenes.select(*point, *_MOMENTS).hstack(pl.DataFrame(columns))


def _added(points: pl.DataFrame, point: list[str]) -> pl.DataFrame:
    """The rows of each point, added up in their order; sorted by point."""
    groups = group_rows(points, point)
    totals = [name for statistic in _COLUMNS for name in (*_SUMS[statistic], _SCENES[statistic])]
    added = groups.sums(points, totals).select(pl.col(name).cast(points.schema[name]) for name in totals)
    return merge_groups(points, groups, orders=SECOND).hstack(added)


def _with_cuts(points: pl.DataFrame, curve: list[str], min_features: int) -> pl.DataFrame:
    """Mark where too few features remain, on the way from where the features begin."""
    fullest = pl.col("at").get(pl.col("n").arg_max())
    origin = pl.when(pl.col("axis") == Axis.frame).then(fullest).otherwise(pl.col("at").min()).over(curve)
    away = pl.col("at").cast(pl.Int64) - origin.cast(pl.Int64)
    few = (pl.col("n") < min_features).cast(pl.UInt8).cum_max().over([*curve, "side"], order_by="distance")
    sided = points.with_columns(distance=away.abs(), side=away >= 0)
    return sided.with_columns(cut=few.cast(pl.Boolean)).drop("distance", "side")


def _statistics(moments: pl.DataFrame) -> dict[str, NDArray[np.float64]]:
    """The values of every statistic for each row, (rows, 2 or 3), NaN where undefined."""
    n = moments["n"].to_numpy()[:, None]
    mean, absolute = (
        moments.select(names).to_numpy() for names in (["mean_u", "mean_v"], ["mean_abs_u", "mean_abs_v"])
    )
    central = moments.select("m_uu", "m_vv", "m_uv").to_numpy()
    about_zero = central + n * np.column_stack([mean**2, mean.prod(axis=1)])
    count, freedom = np.where(n > 0, n, np.nan), np.where(n > 1, n - 1.0, np.nan)
    return {"mean": mean, "absolute": absolute, "second": about_zero / count, "central": central / freedom}


def _by_features(points: pl.DataFrame) -> _Values:
    n_scenes = points[_SCENES["mean"]].to_numpy()
    return {statistic: (values, n_scenes) for statistic, values in _statistics(points).items()}


def _by_scenes(points: pl.DataFrame) -> _Values:
    return {statistic: _mean_over_scenes(points, statistic) for statistic in _COLUMNS}


def _mean_over_scenes(points: pl.DataFrame, statistic: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    n = points[_SCENES[statistic]].to_numpy()
    sums = points.select(_SUMS[statistic]).to_numpy()
    return np.where(n[:, None] > 0, sums, np.nan) / np.maximum(n, 1)[:, None], n


def _table(
    keys: pl.DataFrame, weighting: str, statistic: str, values: NDArray[np.float64], n_scenes: NDArray[np.int64]
) -> pl.DataFrame:
    named_values = zip(_COLUMNS[statistic], values.T, strict=True)
    columns = {name: pl.Series(column).fill_nan(None) for name, column in named_values}
    names = {axis: called[statistic] for axis, called in NAMES.items()}
    table = keys.with_columns(
        pl.lit(None, dtype=pl.Float64).alias("uv"),
        weighting=pl.lit(weighting, dtype=WEIGHTING),
        statistic=pl.col("axis").cast(pl.String).replace_strict(names, return_dtype=pl.String),
        n_scenes=pl.Series(n_scenes, dtype=pl.Int32),
        unit=pl.lit(UNITS[statistic]),
    )
    return table.with_columns(**columns)
