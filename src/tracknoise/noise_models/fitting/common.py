"""The share of the variance of errors that all features of a frame have in common.

What one half of the tracks of a frame says about the other half is p, the motion of the image by one small error of the
pose (`tracknoise.audit.pose_errors.rigid`). With errors e, means over errors of the same age k, and the number n_k of
predictions,

    share = sum_k n_k mean_k(e' p) / sum_k n_k mean_k(e' e)    (common.share)

The mean of e' p is not changed by noise that is independent from track to track, and that of e' e is without outliers.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.findings.sampling.units import units_of
from tracknoise.noise_models.model import Interval
from tracknoise.tables.enumerations import FittedTo, IntervalKind, Product

Array = NDArray[np.float64]

_COLUMNS = ("predictions", "predicted", "n", "squares")
_LEAST = 50


def fit_common(rigid: pl.DataFrame, sums: pl.DataFrame, *, groups: SceneGroups, level: float) -> Interval | None:
    """Share of the variance that all features of a frame have in common, by (common.share), with its interval.

    Parameters
    ----------
    rigid
        Schema `RIGID`, of one tracker and speed.
    sums
        Schema `NOISE_SUMS`, of the same.
    groups
        Of scenes that are not independent of each other.
    level
        Of the interval.

    Returns
    -------
    Interval or None
        Between 0 and 1; None where it was not measured, as at all speeds but the lowest, or where all errors are 0.
    """
    table = pl.concat([_predictions(rigid), _squares(sums)], how="diagonal").fill_null(0)
    units = units_of(table.drop("block"), table, points=["age"], columns=_COLUMNS, groups=groups)
    whole = units.sums.sum(axis=0).T
    used = (whole[0] >= _LEAST) & (whole[2] >= _LEAST)
    if not used.any() or not (whole[3, used] > 0).any():
        return None
    counts = whole[0, used]

    def shares(sums: Array) -> Array:
        common, every = (_mean(sums, place, used) for place in (0, 2))
        predicted, total = (np.einsum("k,k...->...", counts, means) for means in (common, every))
        return np.asarray(predicted / np.where(total > 0, total, np.nan))[None, None]

    method = Method(IntervalKind.student, level)
    sizes = units.sums[..., 2].sum(axis=1)[None]
    found = pooled(units, np.zeros((0, len(units.sums))), shares, method, sizes=sizes)
    value, low, high = (float(bound[0, 0]) for bound in (found.value, found.low, found.high))
    return Interval(value=_share(value), low=_bound(low), high=_bound(high))


def _predictions(rigid: pl.DataFrame) -> pl.DataFrame:
    own = rigid.filter(pl.col("fitted_to") == FittedTo.own)
    products = pl.col("rigid_uu") + pl.col("rigid_vv")
    return own.select("dataset", "scene", "block", "age", predictions=pl.col("n").cast(pl.Float64), predicted=products)


def _squares(sums: pl.DataFrame) -> pl.DataFrame:
    errors = sums.filter(pl.col("product") == Product.error)
    squares = pl.col("uu") + pl.col("vv")
    return errors.select("dataset", "scene", "block", "age", n=pl.col("n").cast(pl.Float64), squares=squares)


def _mean(sums: Array, place: int, used: NDArray[np.bool_]) -> Array:
    """Mean at each age of the sums after a count, (ages, ...); 0 without any."""
    return np.asarray(sums[place + 1, used] / np.maximum(sums[place, used], 1.0))


def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _bound(value: float) -> float | None:
    return None if np.isnan(value) else _share(value)
