"""Differences between levels in what single scenes counted: outlier ratios, and lifetimes to a common horizon.

- An outlier ratio is (outliers + 1/2) / (offered + 1) (scene ratio), and levels differ by its logarithm. A scene takes
  no part in a pair if its counts are too small: if both levels had the same ratio, at least `LEAST_OUTLIERS` outliers
  must be expected at each of them. A level with fewer than `SCARCE` outliers per scene is scarce: the 1/2 makes its
  ratio too large, so that the other level may differ by more than any bound.
- A lifetime is the mean of min(lifetime, horizon) by Kaplan and Meier, in frames that the tracker saw (scene lifetime),
  and levels differ by its logarithm. The horizon is the largest lifetime up to which all scenes of a pair have
  follow-up at both levels. Without it, a lifetime would depend on where sequences end. Scenes whose follow-up is less
  than `LEAST_FOLLOW_UP` of the longest lifetimes of a typical scene take no part. Lifetimes are not alike because most
  tracks outlive a short horizon: nothing is shown then.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.factors.differences import Differences, at_both, none_scarce, pairs_of
from tracknoise.findings.sampling.units import MIN_SCENES
from tracknoise.statistics.grouping import total_if_known
from tracknoise.statistics.tracks.lifetimes import follow_up, restricted_mean

LEAST_OUTLIERS = 2.0
SCARCE = 5.0
_FEW = "too few outliers for an upper bound"
LEAST_FOLLOW_UP = 0.5
_LEAST_HORIZON = 2.0
"""Every track has a lifetime of one frame, so that a horizon of one frame compares nothing."""
_MOST_ALIVE = 0.5
"""Share of tracks that may live to the last frame of a horizon, where lifetimes up to it show that levels are alike."""
_OUTLIVED = "more than half of the tracks live to the common horizon"


def outlier_differences(tables: Sequence[pl.DataFrame], scenes: Sequence[str]) -> Differences:
    """Differences between the logarithms of (scene ratio), with a single point.

    Parameters
    ----------
    tables
        `FRAME_COUNTS` of each level. A level whose tracker does not report outliers takes no part.
    scenes
        Names of all scenes of the dataset, sorted.
    """
    counts = [total_if_known(name, pl.col(name).cast(pl.Int64).sum()) for name in ("offered", "outliers")]
    sums = [table.group_by("scene").agg(counts) for table in tables]
    offered, outliers = (_of_scenes(sums, name, scenes) for name in ("offered", "outliers"))
    pairs = pairs_of(len(tables))
    log_ratio = np.log((outliers + 0.5) / (offered + 1))
    ratio = outliers[:, pairs].sum(axis=2) / np.maximum(offered[:, pairs].sum(axis=2), 1)
    expected = ratio * offered[:, pairs].min(axis=2)
    values = np.where(expected >= LEAST_OUTLIERS, log_ratio[:, pairs[:, 0]] - log_ratio[:, pairs[:, 1]], np.nan)
    measured = np.stack([_are_in(table, scenes) for table in tables], axis=1)
    found = _of_numbers(values, measured, np.full(len(pairs), np.nan))
    scarce = np.asarray(_mean_of_scenes(outliers[:, pairs], ~np.isnan(values)) < SCARCE, dtype=np.bool_)
    return replace(found, scarce=scarce, gap=_FEW if scarce.any() else None)


def lifetime_differences(tables: Sequence[pl.DataFrame], scenes: Sequence[str]) -> Differences:
    """Differences between the logarithms of (scene lifetime), with a single point.

    Parameters
    ----------
    tables
        `ENDS` of each level.
    scenes
        Names of all scenes of the dataset, sorted.
    """
    lifetimes = np.unique(np.concatenate([table["lifetime"].to_numpy() for table in tables]))
    ended, censored = (_by_lifetime(tables, name, scenes, lifetimes) for name in ("n_ended", "n_censored"))
    known = follow_up(ended, censored, lifetimes=lifetimes)
    measured = np.asarray(~np.isnan(known), dtype=np.bool_)
    pairs = pairs_of(len(tables))
    longest = ((ended + censored > 0) * lifetimes).max(axis=2, initial=0)
    reached = known[:, pairs].min(axis=2)
    compared = _long_enough(reached, longest[:, pairs].min(axis=2), at_both(measured))
    limits = np.where(compared, reached, np.inf).min(axis=0, initial=np.inf)
    horizon = np.minimum(limits, lifetimes.max(initial=0))
    compared = np.asarray(compared & (horizon >= _LEAST_HORIZON), dtype=np.bool_)
    until = [
        _until(ended[:, pair], censored[:, pair], frames, lifetimes)
        for pair, frames in zip(pairs, horizon, strict=True)
    ]
    means, alive = np.array(until).reshape(len(pairs), 2, len(scenes), 2).transpose(1, 2, 0, 3)
    logs = np.log(np.where(compared[..., None], means, np.nan))
    found = _of_numbers(logs[..., 0] - logs[..., 1], measured, horizon)
    outlived = (_mean_of_scenes(alive, compared) > _MOST_ALIVE).any()
    return replace(found, gap=_OUTLIVED if outlived else None)


def _long_enough(
    reached: NDArray[np.float64], longest: NDArray[np.float64], both: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Scenes that take part (scenes, pairs): all, if enough of them do not have a follow-up that is not too short."""
    typical = [
        np.median(column[there]) if there.any() else 0.0 for column, there in zip(longest.T, both.T, strict=True)
    ]
    enough = both & (reached >= LEAST_FOLLOW_UP * np.array(typical))
    return np.asarray(np.where(enough.sum(axis=0) >= MIN_SCENES, enough, both), dtype=np.bool_)


def _until(
    ended: NDArray[np.float64], censored: NDArray[np.float64], horizon: float, lifetimes: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Restricted means to a horizon, and shares of tracks that live to its last frame, (2, scenes, levels)."""
    before, mean = (restricted_mean(ended, censored, frames, lifetimes=lifetimes) for frames in (horizon - 1, horizon))
    return np.stack([mean, mean - before])


def _mean_of_scenes(values: NDArray[np.float64], there: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Means of values (scenes, pairs, 2) over the scenes that are there, (pairs, 2); 0 without any."""
    count = np.maximum(there.sum(axis=0), 1)[:, None]
    return np.asarray(np.where(there[..., None], values, 0.0).sum(axis=0) / count)


def _of_numbers(values: NDArray[np.float64], measured: NDArray[np.bool_], horizon: NDArray[np.float64]) -> Differences:
    """Differences (scenes, pairs) that have a single point."""
    pairs = pairs_of(measured.shape[1])
    unlike = np.zeros((len(pairs), 1), dtype=np.bool_)
    return Differences(values[..., None], pairs, at_both(measured), unlike, horizon, none_scarce(pairs))


def _numbers(table: pl.DataFrame, scenes: Sequence[str]) -> NDArray[np.int64]:
    """Place of the scene of each row."""
    return table["scene"].cast(pl.Enum(scenes)).to_physical().to_numpy().astype(np.int64)


def _are_in(table: pl.DataFrame, scenes: Sequence[str]) -> NDArray[np.bool_]:
    found = np.zeros(len(scenes), dtype=np.bool_)
    found[_numbers(table, scenes)] = True
    return found


def _of_scenes(tables: Sequence[pl.DataFrame], column: str, scenes: Sequence[str]) -> NDArray[np.float64]:
    """Counts of a column, (scenes, levels)."""
    counts = np.zeros((len(scenes), len(tables)))
    for level, table in enumerate(tables):
        counts[_numbers(table, scenes), level] = table[column].to_numpy()
    return counts


def _by_lifetime(
    tables: Sequence[pl.DataFrame], column: str, scenes: Sequence[str], lifetimes: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Counts of a column, (scenes, levels, lifetimes), blocks added up."""
    shape = len(scenes), len(lifetimes)
    counts = np.empty((shape[0], len(tables), shape[1]))
    for level, table in enumerate(tables):
        place = _numbers(table, scenes) * shape[1] + np.searchsorted(lifetimes, table["lifetime"].to_numpy())
        counts[:, level] = np.bincount(place, table[column].to_numpy(), shape[0] * shape[1]).reshape(shape)
    return counts
