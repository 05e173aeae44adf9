"""Sums that say whether covariances that a tracker predicts for its own observations are right.

An error is the difference of two observed positions, carried along by the scene: that of now, and the first one (or
that of the key frame), where it is zero by construction. The covariance of the error is therefore that of now plus that
of the first position, C = C_now + C_first (relative). The magnification of the image is taken as 1. A first position
without a covariance counts as exact.

With d^2 = e' C^-1 e, coverage counts errors with d^2 <= -2 log(1 - level), the quantile of chi square with two degrees
of freedom. NEES is the mean of d^2 / 2.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.definitions import STEPS
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.schema import COVARIANCE_SUMS, QUALITY_PREFIX, check, covariances

LEVELS = (0.5, 0.9, 0.95, 0.99)
"""Levels of the regions whose coverage is counted."""
_SUMS = [name for name, kind in COVARIANCE_SUMS.items() if kind == pl.Float64]


def own_covariances(columns: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Name of each covariance among the columns of observations, and its columns ``quality_<name>_uu``, _uv and _vv."""
    for names in covariances(name for name in columns if name.startswith(QUALITY_PREFIX)):
        yield names[0].removeprefix(QUALITY_PREFIX).removesuffix("_uu"), list(names)


def relative(entries: NDArray[np.float64], track: NDArray[np.intp], is_first: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Covariances of errors, (n, 3) px^2: uu, uv and vv, NaN where unknown or not positive definite. See (relative).

    Parameters
    ----------
    entries : (n, 3)
        Covariances of observed positions, px^2, NaN where the tracker predicted none.
    track : (n,)
        Number of the track of each, from 0.
    is_first : (n,)
        Whether the error of a track is zero there by construction.
    """
    first = np.zeros((int(track.max(initial=-1)) + 1, 3))
    first[track[is_first]] = np.nan_to_num(entries[is_first])
    summed = entries + first[track]
    return np.where((_definite(entries) & _definite(summed))[:, None], summed, np.nan)


def _definite(entries: NDArray[np.float64]) -> NDArray[np.bool_]:
    uu, uv, vv = entries.T
    return np.asarray((uu > 0.0) & (uu * vv - uv * uv > 0.0) & np.isfinite(uu * vv))


def inside(squared: NDArray[np.float64]) -> list[NDArray[np.bool_]]:
    """Whether errors of squared Mahalanobis distances (n,) lie in the region of each level, (n,) each."""
    return [squared <= -2.0 * np.log1p(-level) for level in LEVELS]


def covariance_sums(sequence: PreparedSequence) -> pl.DataFrame:
    """Sums over the visible observations that have a predicted covariance, before and after trimming.

    Returns schema `COVARIANCE_SUMS`, sorted: rows of the ages of `STEPS`, and of all ages together, whose `at` is null.
    """
    seen = sequence.seen
    zero = sequence.key_frame or 0
    later = seen.visible & (seen.at != zero)
    steps = pl.Series(np.abs(seen.at - zero) / seen.speed).is_in(list(map(float, STEPS)))
    parts = [pl.DataFrame(schema=dict(COVARIANCE_SUMS))]
    for name, columns in own_covariances(sequence.observations.columns):
        entries = sequence.observations.select(pl.col(columns).cast(pl.Float64).fill_null(np.nan)).to_numpy()
        predicted = later & ~np.isnan(entries).any(axis=1)
        if not predicted.any():
            continue
        covariance = relative(entries, sequence.track_row, seen.at == zero)
        for trimming, kept in {Trimming.untrimmed: predicted, Trimming.trimmed: predicted & seen.kept}.items():
            rows = np.flatnonzero(kept)
            table = _values(sequence, rows, covariance[rows])
            by_age, of_all = table.filter(steps[rows]), table.with_columns(at=pl.lit(None, dtype=pl.UInt32))
            for some in (by_age, of_all):
                labels = {"covariance": pl.lit(name), "trimming": pl.lit(str(trimming)), "axis": pl.lit(str(seen.axis))}
                summed = some.group_by("condition", "block", "at").agg(pl.col(_SUMS).sum())
                origin = seen.conditions[summed["condition"].to_numpy()]
                made = origin.hstack(summed.drop("condition")).with_columns(**labels)
                parts.append(made.select(pl.col(key).cast(kind) for key, kind in COVARIANCE_SUMS.items()))
    keys = [key for key in COVARIANCE_SUMS if key not in _SUMS]
    return check(pl.concat(parts).sort(keys), COVARIANCE_SUMS, "sums of covariances")


def _values(sequence: PreparedSequence, rows: NDArray[np.intp], covariance: NDArray[np.float64]) -> pl.DataFrame:
    """What is summed, for each of some rows of the observations; 0 where the covariance is not positive definite."""
    (uu, uv, vv), (du, dv) = covariance.T, sequence.seen.error_px[rows].T
    determinant = uu * vv - uv * uv
    squared = (vv * du * du - 2.0 * uv * du * dv + uu * dv * dv) / determinant
    known = np.isfinite(squared)
    shares = {f"inside_{100 * level:.0f}": held for level, held in zip(LEVELS, inside(squared), strict=True)}
    values = {"n": known, **shares, "squares": squared, "log_det": np.log(determinant), "px2": du * du + dv * dv}
    return pl.DataFrame(
        {
            "condition": sequence.seen.condition[rows],
            "block": sequence.block[rows],
            "at": sequence.seen.at[rows].astype(np.uint32),
            **{name: np.where(known, value, 0.0) for name, value in values.items()},
            "impossible": (~known).astype(np.float64),
        }
    )
