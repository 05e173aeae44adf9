"""A sample of tracks with all that their points' depths depend on, to try covariances of whole tracks on.

What a covariance of a whole track makes of its depth cannot be added up over tracks before the covariance is known. So
some tracks of each condition are kept: up to `MOST` of each class of lengths at the slowest speed, spread evenly over
the class. Long tracks are rarer than short ones, and the longest windows consist of them alone.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.statistics.noise.true_points import true_points
from tracknoise.statistics.noise.window_tracks import window_derivatives, window_runs
from tracknoise.statistics.noise.windows import directions
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.schema import NOISE_TRACKS, check

MOST = 96
"""Tracks of a sequence, condition and class of lengths that are kept."""
LENGTHS = (5, 10, 15)
"""Lengths of the windows that are cut from them, in observations: each begins a class."""
_DERIVATIVES = ("across_u", "across_v", "other_u", "other_v", "depth_u", "depth_v")


def noise_tracks(sequence: PreparedSequence, geometry: FrameGeometry, *, population: str) -> pl.DataFrame:
    """First observations of some tracks of every condition: errors, and derivatives of the true positions.

    Parameters
    ----------
    sequence
        Trimmed. `slowest` is the speed of the tracks.
    geometry
        Poses and cameras of its frames.
    population
        Observations that count. A track ends before the first one that does not belong to it.

    Returns
    -------
    polars.DataFrame
        Schema `NOISE_TRACKS`, sorted.
    """
    rows, start, length = window_runs(sequence, population)
    chosen, stands_for = _spread(sequence, rows[start], length)
    taken = np.minimum(length[chosen], max(LENGTHS))
    first = np.cumsum(taken) - taken
    observed = rows[np.repeat(start[chosen] - first, taken) + np.arange(taken.sum())]
    jacobian, ray_m = window_derivatives(sequence, geometry, observed, first, taken)
    bases = np.concatenate([directions(ray_m)[0], ray_m[:, :, None]], axis=2)
    derivatives = np.swapaxes(jacobian @ np.repeat(bases, taken, axis=0), 1, 2).reshape(-1, len(_DERIVATIVES))
    seen = sequence.seen
    columns = {
        "block": sequence.block[observed],
        "track": seen.track[observed],
        "stands_for": np.repeat(stands_for, taken),
        "kept": seen.kept[observed],
        "age": seen.age[observed],
        **dict(zip(("du_px", "dv_px"), seen.error_px[observed].T, strict=True)),
        "magnification": _magnification(sequence, geometry, observed, first, taken),
        **dict(zip(_DERIVATIVES, derivatives.T, strict=True)),
    }
    table = seen.conditions[seen.condition[observed]].hstack(pl.DataFrame(columns))
    typed = _finite(table).select(pl.col(name).cast(kind) for name, kind in NOISE_TRACKS.items())
    keys = [*seen.conditions.columns, "track", "age"]
    return check(typed.sort(keys), NOISE_TRACKS, "noise tracks")


def _spread(
    sequence: PreparedSequence, born: NDArray[np.intp], length: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Places of the tracks that are kept, and how many tracks each of them stands for."""
    condition = sequence.seen.condition[born]
    kind = np.where(sequence.at_slowest[born], np.searchsorted(LENGTHS, length, side="right"), 0)
    group = condition * (len(LENGTHS) + 1) + kind
    places, weights = [np.empty(0, np.intp)], [np.empty(0)]
    for one in np.unique(group[kind > 0]):
        own = np.flatnonzero(group == one)
        count = min(len(own), MOST)
        places.append(own[np.arange(count) * len(own) // count])
        weights.append(np.full(count, len(own) / count))
    return np.concatenate(places), np.concatenate(weights)


def _magnification(
    sequence: PreparedSequence,
    geometry: FrameGeometry,
    rows: NDArray[np.intp],
    first: NDArray[np.intp],
    length: NDArray[np.intp],
) -> NDArray[np.float64]:
    """(n,) float64: Z_0 / Z_k; NaN where the point is not in front of both cameras."""
    points = np.repeat(true_points(sequence, geometry, rows[first]), length, axis=0)
    depth = geometry.to_camera(sequence.seen.frame[rows], points)[:, 2]
    born = np.repeat(depth[first], length)
    known = (depth > 0.0) & (born > 0.0)
    return np.where(known, born, np.nan) / np.where(known, depth, 1.0)


def _finite(table: pl.DataFrame) -> pl.DataFrame:
    """Rows of each track before the first one that has an unknown number."""
    known = pl.all_horizontal(pl.col("du_px", "dv_px", "magnification", *_DERIVATIVES).is_finite())
    before = known.cast(pl.UInt8).cum_min().over("tracker", "speed", "track") == 1
    return table.filter(before)
