"""Noise that an estimator sees in windows of tracks: residuals of a fitted point, and how far its depth errs.

A window holds the first N observations of a track that belong to the population. See
`tracknoise.statistics.noise.windows`.
"""

from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.statistics.definitions import WINDOWS
from tracknoise.statistics.errors.log_histogram import BINS, bin_of
from tracknoise.statistics.grouping import group_rows
from tracknoise.statistics.noise.window_tracks import window_derivatives, window_runs
from tracknoise.statistics.noise.windows import FittedWindows, fit_windows
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.schema import TRIMMING, WINDOW_BLOCKS, WINDOW_NOISE, Schema, check, empty

_AT_ONCE = 1 << 18
"""Observations whose derivatives are held at a time."""
_SUMS = ("n", "n_depth", "squares_u", "freedom_u", "squares_v", "freedom_v", "squares_z")
_KEYS = ("condition", "block", "window")


def window_noise(
    sequence: PreparedSequence, geometry: FrameGeometry, *, population: str, with_depth: bool = True
) -> dict[str, pl.DataFrame]:
    """Sums and histograms of windows by scene and condition, and by blocks of tracks at the slowest speed.

    Parameters
    ----------
    sequence
        Trimmed.
    geometry
        Poses and cameras of its frames.
    population
        Observations that count. A track's window ends before the first one that does not belong to it.
    with_depth
        False where the true points are fitted to the tracks, so that errors of their depth are unknown.

    Returns
    -------
    dict
        Tables ``window_noise`` and ``window_blocks``, of the schemas `WINDOW_NOISE` and `WINDOW_BLOCKS`, sorted.
    """
    parts = [*_windows(sequence, geometry, population)]
    whole, blocks = [empty(WINDOW_NOISE)], [empty(WINDOW_BLOCKS)]
    if parts:
        of_windows = pl.concat(
            part if with_depth else part.with_columns(z=pl.lit(None, dtype=pl.Float64)) for part in parts
        )
        for trimming, chosen in _trimmings(of_windows):
            whole.append(_table(sequence, chosen.with_columns(block=None), trimming, WINDOW_NOISE))
            blocks.append(_table(sequence, chosen.filter("slow"), trimming, WINDOW_BLOCKS))
    return {
        "window_noise": _checked(pl.concat(whole), WINDOW_NOISE, "window noise"),
        "window_blocks": _checked(pl.concat(blocks), WINDOW_BLOCKS, "window blocks"),
    }


def _checked(table: pl.DataFrame, schema: Schema, name: str) -> pl.DataFrame:
    keys = [column for column in schema if column not in (*_SUMS, "residual_counts", "z_counts")]
    return check(table.sort(keys), schema, name)


def _trimmings(windows: pl.DataFrame) -> Iterator[tuple[Trimming, pl.DataFrame]]:
    yield Trimming.untrimmed, windows
    yield Trimming.trimmed, windows.filter("kept")


def _windows(sequence: PreparedSequence, geometry: FrameGeometry, population: str) -> Iterator[pl.DataFrame]:
    """One row per window: condition, block, window, kept, slow, squares, freedom, z; for some tracks at a time."""
    rows, start, length = window_runs(sequence, population)
    for low, high in _chunks(length):
        first, last = start[low], start[high - 1] + length[high - 1]
        chosen = rows[first:last]
        jacobian, ray_m = window_derivatives(sequence, geometry, chosen, start[low:high] - first, length[low:high])
        for window in WINDOWS:
            tracks = np.flatnonzero((length[low:high] >= window) & np.isfinite(ray_m).all(axis=1))
            if len(tracks):
                yield _fitted(sequence, chosen, (start[low:high] - first)[tracks], window, jacobian, ray_m[tracks])


def _fitted(
    sequence: PreparedSequence,
    rows: NDArray[np.intp],
    start: NDArray[np.intp],
    window: int,
    jacobian: NDArray[np.float64],
    ray_m: NDArray[np.float64],
) -> pl.DataFrame:
    places = start[:, None] + np.arange(window)
    observed = rows[places]
    found = fit_windows(sequence.seen.error_px[observed], jacobian[places], ray_m)
    first = observed[:, 0]
    return pl.DataFrame(
        {
            "condition": sequence.seen.condition[first],
            "block": sequence.block[first],
            "window": np.full(len(first), window),
            "kept": sequence.seen.kept[first],
            "slow": sequence.at_slowest[first],
            **_numbers(found),
        }
    ).filter(pl.col("squares_u").is_finite() & pl.col("squares_v").is_finite())


def _numbers(found: FittedWindows) -> Mapping[str, object]:
    return {
        "squares_u": found.squares[:, 0],
        "squares_v": found.squares[:, 1],
        "freedom_u": found.freedom[:, 0],
        "freedom_v": found.freedom[:, 1],
        "z": pl.Series(found.z_px, nan_to_null=True),
    }


def _chunks(length: NDArray[np.intp]) -> Iterator[tuple[int, int]]:
    """First and last (excluded) of consecutive tracks that together have about `_AT_ONCE` observations."""
    if not len(length):
        return
    number = np.cumsum(length) // _AT_ONCE
    cuts = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(length)]
    yield from ((low, high) for low, high in pairwise(cuts) if high > low)


def _table(sequence: PreparedSequence, windows: pl.DataFrame, trimming: Trimming, schema: Schema) -> pl.DataFrame:
    """Sums and histograms of each condition, block and window."""
    groups = group_rows(windows, list(_KEYS))
    z = windows["z"]
    weights = {
        **{name: windows[name].to_numpy() for name in ("squares_u", "squares_v", "freedom_u", "freedom_v")},
        "n": np.ones(windows.height),
        "n_depth": z.is_not_null().to_numpy().astype(np.float64),
        "squares_z": (z**2).fill_null(0.0).to_numpy(),
    }
    sums = {name: np.bincount(groups.index, weights[name], groups.count) for name in _SUMS}
    freedom = weights["freedom_u"] + weights["freedom_v"]
    residual = np.sqrt((weights["squares_u"] + weights["squares_v"]) / freedom)
    counts = {
        "residual_counts": _histograms(groups.index, residual, groups.count),
        "z_counts": _histograms(groups.index, z.abs().to_numpy(), groups.count),
    }
    named = sequence.seen.conditions[groups.keys["condition"].to_numpy()].hstack(groups.keys.drop("condition"))
    made = named.with_columns(pl.lit(trimming, dtype=TRIMMING).alias("trimming"), **sums, **counts)
    return made.select(pl.col(name).cast(kind) for name, kind in schema.items())


def _histograms(group: NDArray[np.intp], values: NDArray[np.float64], count: int) -> pl.Series:
    """Histogram of the values of each group, as lists; missing values are not counted."""
    known = ~np.isnan(values)
    cells = group[known] * BINS + bin_of(values[known])
    counted = np.bincount(cells, minlength=count * BINS).reshape(count, BINS)
    return pl.Series(counted.tolist(), dtype=pl.List(pl.UInt32))
