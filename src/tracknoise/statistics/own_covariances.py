"""Sums that say whether covariances that a tracker predicts for its own observations are right.

An error is the difference of two observed positions, carried along by the scene: that of now, and the first one (or
that of the key frame), where it is zero by construction. The covariance of the error is therefore that of now plus that
of the first position, C = C_now + M^2 C_first (relative). M = Z_0 / Z_k is the magnification of the image since then,
which is taken as 1 where depths are not known and where a key frame fixes true positions. A first position without a
covariance counts as exact.

Whitened errors z = C^(-1/2) e show whether the shape of C is right: in no frame of axes are they larger along one axis
than along the other. Axes are those of the image, of C itself, and along and across the motion of the true position.

With d^2 = e' C^-1 e, coverage counts errors with d^2 <= -2 log(1 - level), the quantile of chi square with two degrees
of freedom. NEES is the mean of d^2 / 2.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.projection import FrameGeometry
from tracknoise.statistics.definitions import STEPS
from tracknoise.statistics.noise_sums import magnifications
from tracknoise.statistics.prepared import PreparedSequence, track_runs
from tracknoise.tables.schema import COVARIANCE_SUMS, QUALITY_PREFIX, covariances, empty, typed

LEVELS = (0.5, 0.9, 0.95, 0.99)
"""Levels of the regions whose coverage is counted."""
_LEAST_MOTION_PX = 0.01
"""Motions from frame to frame that are smaller have no direction."""
_SAME = 1e-6
"""Relative difference of variances that counts as none."""
_SUMS = [name for name, kind in COVARIANCE_SUMS.items() if kind == pl.Float64]


def own_covariances(columns: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Name of each covariance among the columns of observations, and its columns ``quality_<name>_uu``, _uv and _vv."""
    for names in covariances(name for name in columns if name.startswith(QUALITY_PREFIX)):
        yield names[0].removeprefix(QUALITY_PREFIX).removesuffix("_uu"), list(names)


def relative(
    entries: NDArray[np.float64],
    track: NDArray[np.intp],
    is_first: NDArray[np.bool_],
    magnification: NDArray[np.float64] | float = 1.0,
) -> NDArray[np.float64]:
    """Covariances of errors, (n, 3) px^2: uu, uv and vv, NaN where unknown or not positive definite. See (relative).

    Parameters
    ----------
    entries : (n, 3)
        Covariances of observed positions, px^2, NaN where the tracker predicted none.
    track : (n,)
        Number of the track of each, from 0.
    is_first : (n,)
        Whether the error of a track is zero there by construction.
    magnification : (n,)
        Of the image since then.
    """
    first = np.zeros((int(track.max(initial=-1)) + 1, 3))
    first[track[is_first]] = np.nan_to_num(entries[is_first])
    summed = entries + (np.broadcast_to(magnification, len(track)) ** 2)[:, None] * first[track]
    return np.where((_definite(entries) & _definite(summed))[:, None], summed, np.nan)


def _definite(entries: NDArray[np.float64]) -> NDArray[np.bool_]:
    uu, uv, vv = entries.T
    return np.asarray((uu > 0.0) & (uu * vv - uv * uv > 0.0) & np.isfinite(uu * vv))


def inside(squared: NDArray[np.float64]) -> list[NDArray[np.bool_]]:
    """Whether errors of squared Mahalanobis distances (n,) lie in the region of each level, (n,) each."""
    return [squared <= -2.0 * np.log1p(-level) for level in LEVELS]


def covariance_sums(sequence: PreparedSequence, geometry: FrameGeometry | None = None) -> pl.DataFrame:
    """Sums over the visible observations that have a predicted covariance, before and after trimming.

    `geometry`: of the frames, by which the image is magnified.

    Returns schema `COVARIANCE_SUMS`, sorted: rows of the ages of `STEPS`, and of all ages together, whose `at` is null.
    """
    seen, named = sequence.seen, list(own_covariances(sequence.observations.columns))
    if not named:
        return empty(COVARIANCE_SUMS)
    zero = sequence.key_frame or 0
    later = seen.visible & (seen.at != zero)
    steps = pl.Series(np.abs(seen.at - zero) / seen.speed).is_in(list(map(float, STEPS)))
    parts, motion = [pl.DataFrame(schema=dict(COVARIANCE_SUMS))], _directions(sequence)
    magnification = 1.0 if geometry is None or sequence.key_frame is not None else _magnified(sequence, geometry)
    for name, columns in named:
        entries = sequence.observations.select(pl.col(columns).cast(pl.Float64).fill_null(np.nan)).to_numpy()
        predicted = later & ~np.isnan(entries).any(axis=1)
        if not predicted.any():
            continue
        covariance = relative(entries, sequence.track_row, seen.at == zero, magnification)
        for trimming, kept in seen.by_trimming(predicted).items():
            rows = np.flatnonzero(kept)
            table = _values(sequence, rows, covariance[rows], motion[rows])
            by_age, of_all = table.filter(steps[rows]), table.with_columns(at=pl.lit(None, dtype=pl.UInt32))
            for part in (by_age, of_all):
                labels = {"covariance": pl.lit(name), "trimming": pl.lit(str(trimming)), "axis": pl.lit(str(seen.axis))}
                summed = part.group_by("condition", "block", "at").agg(pl.col(_SUMS).sum())
                parts.append(typed(seen.with_conditions(summed).with_columns(**labels), COVARIANCE_SUMS))
    keys = [key for key in COVARIANCE_SUMS if key not in _SUMS]
    return pl.concat(parts).sort(keys)


def _magnified(sequence: PreparedSequence, geometry: FrameGeometry) -> NDArray[np.float64]:
    """Magnification of the image since each track began, (rows,); 1 where it is unknown."""
    rows = sequence.ordered
    magnified = np.ones(len(rows))
    known = magnifications(sequence, geometry, rows, *track_runs(sequence.track_row[rows]))
    magnified[rows] = np.nan_to_num(known, nan=1.0)
    return magnified


def _directions(sequence: PreparedSequence) -> NDArray[np.float64]:
    """Cosine and sine of twice the angle of the motion of each true position, (rows, 2); NaN where it does not move."""
    rows = sequence.ordered
    du, dv = np.diff(sequence.true_px[rows], axis=0, prepend=np.nan).T
    begins = np.diff(sequence.track_row[rows], prepend=-1) != 0
    square = np.where(begins, np.nan, du * du + dv * dv)
    directions = np.full((len(sequence.track_row), 2), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        directions[rows] = np.where(
            (square > _LEAST_MOTION_PX**2)[:, None], np.stack([du * du - dv * dv, 2 * du * dv], 1), np.nan
        )
        directions[rows] /= square[:, None]
    return directions


def _values(
    sequence: PreparedSequence,
    rows: NDArray[np.intp],
    covariance: NDArray[np.float64],
    motion: NDArray[np.float64],
) -> pl.DataFrame:
    """What is summed, for each of some rows of the observations; 0 where the covariance is not positive definite."""
    error, condition = sequence.seen.error_px[rows], sequence.seen.condition[rows]
    valid, values = _of_errors(covariance, error, motion, condition)
    return pl.DataFrame(
        {
            "condition": condition,
            "block": sequence.block[rows],
            "at": sequence.seen.at[rows].astype(np.uint32),
            **{name: np.where(valid, value, 0.0) for name, value in values.items()},
            "impossible": (~valid).astype(np.float64),
        }
    )


def sums_of_covariances(covariance: NDArray[np.float64], error_px: NDArray[np.float64]) -> dict[str, float]:
    """Sums of `COVARIANCE_SUMS` over errors (n, 2) without a known motion. `covariance`: (n, 3) px^2, all possible."""
    nothing = np.full(error_px.shape, np.nan)
    _, values = _of_errors(covariance, error_px, nothing, np.zeros(len(error_px), dtype=np.intp))
    return {name: float(np.sum(value)) for name, value in values.items()}


def _of_errors(
    covariance: NDArray[np.float64],
    error_px: NDArray[np.float64],
    motion: NDArray[np.float64],
    condition: NDArray[np.intp],
) -> tuple[NDArray[np.bool_], dict[str, NDArray[Any]]]:
    """Whether the covariance of each error is possible, and what is summed."""
    (uu, uv, vv), (du, dv) = covariance.T, error_px.T
    determinant = uu * vv - uv * uv
    squared = (vv * du * du - 2.0 * uv * du * dv + uu * dv * dv) / determinant
    valid, length = np.isfinite(squared), np.hypot(du, dv)
    shares = {f"inside_{100 * level:.0f}": held for level, held in zip(LEVELS, inside(squared), strict=True)}
    values = {"n": valid, **shares, "squares": squared, "log_det": np.log(determinant), "px2": length**2}
    values |= _shapes(covariance, (du, dv), squared, motion) | _ranks(uu + vv, length, np.where(valid, condition, -1))
    return valid, values


def _shapes(
    covariance: NDArray[np.float64],
    error: tuple[NDArray[np.float64], NDArray[np.float64]],
    squared: NDArray[np.float64],
    motion: NDArray[np.float64],
) -> dict[str, NDArray[np.float64]]:
    """Of whitened errors, in each frame of axes. Arguments are of as many rows."""
    (uu, uv, vv), (du, dv) = covariance.T, error
    root = np.sqrt(uu * vv - uv * uv)
    scale = root * np.sqrt(uu + vv + 2.0 * root)  # the root of C is (C + sqrt(det C)) over that of its trace + 2 root
    z_u, z_v = ((vv + root) * du - uv * dv) / scale, ((uu + root) * dv - uv * du) / scale
    along, turned = z_u**2 - z_v**2, 2.0 * z_u * z_v
    elongated = np.stack([uu - vv, 2.0 * uv], axis=1) / (uu + vv)[:, None]
    frames = {"image": np.array([1.0, 0.0]), "own": elongated, "motion": np.nan_to_num(motion)}
    terms = {"elongation": np.hypot(*elongated.T), "fourth": squared**2}
    for name, axes in frames.items():
        cosine, sine = axes.T
        terms[f"{name}_total"] = np.hypot(cosine, sine) * squared
        terms[f"{name}_along"] = cosine * along + sine * turned
        terms[f"{name}_turned"] = cosine * turned - sine * along
    return terms


def _ranks(
    trace: NDArray[np.float64], length: NDArray[np.float64], condition: NDArray[np.intp]
) -> dict[str, NDArray[np.float64]]:
    """Errors that are predicted to be large, and small ones, beside the geometric mean of their condition.

    `condition`: -1 for those without a covariance.
    """
    size = np.log(np.where(condition >= 0, trace, 1.0))
    counts = np.bincount(condition + 1)
    mean = (np.bincount(condition + 1, size) / np.maximum(counts, 1))[condition + 1]
    is_large, is_small = size > mean + _SAME, size < mean - _SAME
    return {
        "n_large": is_large.astype(np.float64),
        "large_px": np.where(is_large, length, 0.0),
        "n_small": is_small.astype(np.float64),
        "small_px": np.where(is_small, length, 0.0),
    }
