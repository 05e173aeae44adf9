"""The law by which the error of the relative pose of two frames grows, fitted to (pose.growth) of all scenes.

Pose errors that are independent from frame to frame have relative errors of the same size at every distance. Those of a
random walk grow with its root. Of each coordinate of the rotation and of the translation, at k frames,

    mean square = 2 white^2 + walk^2 k    (pose.law)

is fitted by least squares with weights 1/k and no negative part.
"""

from collections.abc import Iterable

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.intervals.condition_table import USUAL, Sampling, estimated
from tracknoise.findings.sampling.bounds import Method, pooled
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.units import units_of
from tracknoise.tables.findings_schema import POSE_LAW
from tracknoise.tables.schema import POSE_GROWTH, VIEW, check, empty

LARGEST_LAG = 24
"""Largest distance of two frames to which the law is fitted, frames of the nominal sequence."""
_KEYS = ["dataset", *VIEW]
_LABELS = pl.DataFrame(
    {
        "motion": ["rotation", "rotation", "translation", "translation"],
        "law": ["white", "random walk", "white", "random walk"],
        "unit": ["deg", "deg per sqrt(frame)", "m", "m per sqrt(frame)"],
    }
)


def pose_law(growth: Iterable[pl.DataFrame], sampling: Sampling = USUAL) -> pl.DataFrame:
    """White and walking part of the pose errors of each dataset and view, with intervals over scenes.

    Parameters
    ----------
    growth
        Tables of all scenes, schema `POSE_GROWTH`.
    sampling
        How scenes are resampled. A part that is 0 has no smooth statistic, so that ``bca`` takes the place of
        ``student``.

    Returns
    -------
    polars.DataFrame
        Schema `POSE_LAW`, sorted. Bounds are null where scenes are too few.

    Raises
    ------
    SchemaError
        If a table has other columns.
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    method = Method(sampling.kind, sampling.level).by_bootstrap()
    tables = [empty(POSE_GROWTH), *(check(table, POSE_GROWTH, "pose growth") for table in growth)]
    near = pl.concat(tables).filter(pl.col("lag") <= LARGEST_LAG).sort(*_KEYS, "scene", "lag")
    parts = [empty(POSE_LAW)]
    for key, part in near.partition_by(_KEYS, as_dict=True, maintain_order=True).items():
        draws = sampling.draws({str(key[0]): part["scene"].unique()})[str(key[0])]
        names = [pl.lit(value, dtype=POSE_LAW[name]).alias(name) for name, value in zip(_KEYS, key, strict=True)]
        table = _rows(part, draws, method).with_columns(names)
        parts.append(table.select(pl.col(name).cast(dtype) for name, dtype in POSE_LAW.items()))
    return check(pl.concat(parts), POSE_LAW, "pose law")


def _rows(growth: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per motion and part of the law."""
    sums = growth.with_columns(
        turned=pl.col("n") * pl.mean_horizontal("^rotation_.._deg2$"),
        moved=pl.col("n") * pl.mean_horizontal("^translation_.._m2$"),
    )
    units = units_of(sums, points=["lag"], columns=["n", "turned", "moved"], groups=draws.groups)
    lag = units.points["lag"].to_numpy().astype(np.float64)
    sizes = units.sums[..., 0].sum(axis=1)[None]
    found = pooled(units, draws.weights(units), lambda sums: _fitted(sums, lag), method, sizes=sizes)
    return estimated(_LABELS, found, units, POSE_LAW, value="value").with_columns(
        pl.col("low", "high").fill_nan(None), n=pl.lit(int(sums["n"].sum()))
    )


def _fitted(sums: NDArray[np.float64], lag: NDArray[np.float64]) -> NDArray[np.float64]:
    """White and walking part of rotation and translation, (4, 1, ...), of sums (3, lags, ...)."""
    count = sums[0]
    known = count > 0
    by_lag = lag.reshape(-1, *[1] * (count.ndim - 1))
    weight = np.where(known, 1.0 / by_lag, 0.0)
    parts = [_two_parts(weight, by_lag, total / np.where(known, count, 1.0)) for total in sums[1:]]
    return np.concatenate(parts)[:, None]


def _two_parts(
    weight: NDArray[np.float64], lag: NDArray[np.float64], square: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Roots of the two coefficients that fit 2 a + b k to mean squares without being negative, (2, ...)."""
    two_two, two_k, k_k = (np.sum(weight * product, axis=0) for product in (4.0 + 0 * lag, 2.0 * lag, lag * lag))
    two_y, k_y = np.sum(weight * 2.0 * square, axis=0), np.sum(weight * lag * square, axis=0)
    determinant = two_two * k_k - two_k * two_k
    safe = np.where(determinant > 0.0, determinant, 1.0)
    white, walk = (k_k * two_y - two_k * k_y) / safe, (two_two * k_y - two_k * two_y) / safe
    only_white, only_walk = two_y / np.where(two_two > 0.0, two_two, 1.0), k_y / np.where(k_k > 0.0, k_k, 1.0)
    single = determinant <= 0.0
    found_white = np.where(walk < 0.0, only_white, np.where(single, only_white, white))
    found_walk = np.where(white < 0.0, only_walk, np.where(single, 0.0, walk))
    return np.asarray(np.sqrt(np.maximum(np.stack([found_white, found_walk]), 0.0)))
