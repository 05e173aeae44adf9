"""Bias, mean absolute error and spread by age, or by frame, from moments.

With n the features at age k (the paper's Psi(k)) and du_i, dv_i their errors:

- nu_u(k) = sum(du_i) / n, px (nu)
- eta_u(k) = sum(|du_i|) / n, px (eta)
- Phi_uv(k) = sum(du_i dv_i) / (n - 1), px^2 (Phi): the second moment about zero, which the paper calls covariance
- central_uv(k) = sum((du_i - nu_u) (dv_i - nu_v)) / (n - 1), px^2: the covariance in the usual sense

Where a single scan fixes the features that are visible in its key frame, the same of the M features in frame t are
called mu_u(t), kappa_u(t) and Sigma_uv(t) (mu), (kappa), (Sigma).

Differences from the paper: its printed sum limit of nu is a slip for Psi(k), and it has no central covariance.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.grouping import POOLED, Groups, group_rows
from tracknoise.statistics.moments import merge
from tracknoise.tables.schema import CURVES, MOMENTS, WEIGHTING, check

UNITS = {"mean": "px", "absolute": "px", "second": "px^2", "central": "px^2"}
"""Every statistic and its unit."""
NAMES = {
    "age": {"mean": "nu", "absolute": "eta", "second": "Phi", "central": "central"},
    "frame": {"mean": "mu", "absolute": "kappa", "second": "Sigma", "central": "central"},
}
"""What each statistic is called, by the axis it runs along."""
_CURVE = [*POOLED, "population", "trimming", "axis"]
_POINT = [*_CURVE, "at"]
_COLUMNS = ["u", "v", "uv"]

_Values = dict[str, tuple[NDArray[np.float64], NDArray[np.int64]]]
"""For each statistic: u, v and uv, (points, 3), NaN where undefined; and the scenes it rests on, (points,)."""


def curves(moments: pl.DataFrame, *, min_features: int = 100) -> pl.DataFrame:
    """Curves of (nu), (eta), (Phi), or (mu), (kappa), (Sigma), and central covariance, pooled over scenes.

    Parameters
    ----------
    moments
        A moments table with one row a scene, condition, population, trimming and age or frame. A scene that was drawn
        twice, as bootstrap does, stands in it twice and counts twice.
    min_features
        `cut` is set from the first age on, of those that a condition has, at which its scenes together have fewer
        features than this; with frames, from the frame of most features outwards, on either side.

    Returns
    -------
    polars.DataFrame
        Schema `CURVES`, sorted by all columns that come before `n`. Weighting `features` pools all features of all
        scenes as the paper does; `scenes` is the mean over scenes of each scene's own statistic. `n` counts the
        features of all scenes in both, `n_scenes` the scenes that the value rests on. Second moments are null where
        n is 1; with weighting `scenes` a scene with one feature does not enter them.

    Raises
    ------
    SchemaError
        If the table has other columns.
    """
    scenes = check(moments, MOMENTS, "moments").filter(pl.col("n") > 0).sort(*MOMENTS)
    points = group_rows(scenes, _POINT)
    pooled = merge(scenes, by=_POINT)
    keys = _with_cuts(pooled.select(*_POINT, "n"), min_features)
    weightings = {"features": _by_features(pooled, points), "scenes": _by_scenes(scenes, points)}
    tables = [
        _table(keys, weighting, statistic, *values[statistic])
        for weighting, values in weightings.items()
        for statistic in UNITS
    ]
    sorting = [column for column in CURVES if column not in ("n", "n_scenes", "unit", *_COLUMNS, "cut")]
    return check(pl.concat(tables).sort(sorting), CURVES, "curves")


def _with_cuts(points: pl.DataFrame, min_features: int) -> pl.DataFrame:
    """Mark where too few features remain, on the way from where the features begin."""
    fullest = pl.col("at").get(pl.col("n").arg_max())
    origin = pl.when(pl.col("axis") == "frame").then(fullest).otherwise(pl.col("at").min()).over(_CURVE)
    away = pl.col("at").cast(pl.Int64) - origin.cast(pl.Int64)
    few = (pl.col("n") < min_features).cast(pl.UInt8).cum_max().over([*_CURVE, "side"], order_by="distance")
    sided = points.with_columns(distance=away.abs(), side=away >= 0)
    return sided.with_columns(cut=few.cast(pl.Boolean)).drop("distance", "side")


def _statistics(moments: pl.DataFrame) -> dict[str, NDArray[np.float64]]:
    """u, v and uv of every statistic for each row, (rows, 3), NaN where undefined."""
    n = moments["n"].to_numpy()[:, None]
    mean, absolute = (
        moments.select(names).to_numpy() for names in (["mean_u", "mean_v"], ["mean_abs_u", "mean_abs_v"])
    )
    central = moments.select("m_uu", "m_vv", "m_uv").to_numpy()
    about_zero = central + n * np.column_stack([mean**2, mean.prod(axis=1)])
    divisor = np.where(n > 1, n - 1.0, np.nan)
    undefined = np.full(len(n), np.nan)
    return {
        "mean": np.column_stack([mean, undefined]),
        "absolute": np.column_stack([absolute, undefined]),
        "second": about_zero / divisor,
        "central": central / divisor,
    }


def _by_features(pooled: pl.DataFrame, points: Groups) -> _Values:
    n_scenes = np.bincount(points.index, minlength=points.count)
    return {statistic: (values, n_scenes) for statistic, values in _statistics(pooled).items()}


def _by_scenes(scenes: pl.DataFrame, points: Groups) -> _Values:
    return {statistic: _mean_over_scenes(values, points) for statistic, values in _statistics(scenes).items()}


def _mean_over_scenes(values: NDArray[np.float64], points: Groups) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    defined = ~np.isnan(values)
    sums = [np.bincount(points.index, column, points.count) for column in np.where(defined, values, 0.0).T]
    counts = [np.bincount(points.index[rows], minlength=points.count) for rows in defined.T]
    n = np.stack(counts, axis=1)
    return np.where(n > 0, np.stack(sums, axis=1), np.nan) / np.maximum(n, 1), n[:, 0]


def _table(
    keys: pl.DataFrame, weighting: str, statistic: str, values: NDArray[np.float64], n_scenes: NDArray[np.int64]
) -> pl.DataFrame:
    columns = {name: pl.Series(values[:, place]).fill_nan(None) for place, name in enumerate(_COLUMNS)}
    names = {axis: called[statistic] for axis, called in NAMES.items()}
    table = keys.with_columns(
        weighting=pl.lit(weighting, dtype=WEIGHTING),
        statistic=pl.col("axis").cast(pl.String).replace_strict(names, return_dtype=pl.String),
        n_scenes=pl.Series(n_scenes, dtype=pl.Int32),
        unit=pl.lit(UNITS[statistic]),
        **columns,
    )
    return table.select(*CURVES)
