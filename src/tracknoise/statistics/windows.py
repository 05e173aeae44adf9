"""Windows of tracks, as an estimator sees them, and the noise in them that no fitted point absorbs.

Windows and their points
------------------------

A window holds the first N observations of a track that belong to the population. Errors e about the true point X are
2 N numbers. The point that least squares fit to the observations, with the true poses, absorbs the part F dX, where F
are the derivatives of the true positions by X. To first order the residuals are

    r = (I - F F^+) e    (window.residual)

They do not depend on the error of the first position, which moves all true positions by F dX, too. The point is moved
across the ray of its first observation, in two directions, and along it, by a share of its distance. With g for the
part of the derivative by this share that the other two cannot replace, the distance errs by

    (g e) / (g g) = z / |g|,  z = (g e) / |g|    (window.depth)

For independent noise of s px in each coordinate, z has the standard deviation s, whatever the motion. |g| is the
parallax of the window, px: the noise of s px leaves the distance uncertain by the share s / |g|. Where it is below
`LEAST_PARALLAX_PX` the window does not show the depth. Two degrees of freedom are then absorbed, else three.

Sampled tracks
--------------

What a covariance of a whole track makes of its depth cannot be added up over tracks before the covariance is known. So
some tracks of each condition are kept, with all that the depths of their points depend on, to try covariances of whole
tracks on: up to `MOST` of each class of lengths at the slowest speed, spread evenly over the class. Long tracks are
rarer than short ones, and the longest windows consist of them alone.

Fitted true positions
---------------------

The errors of a track of N observations whose point was fitted have 2 N - 3 degrees of freedom. For white noise of
variance s^2, the square of an error in u has the expectation s^2 (1 - H_uu), where H is the covariance of the true
position for noise of 1 px. So

    s_u^2 = sum du^2 / sum (1 - H_uu),  s^2 = sum (du^2 + dv^2) / sum (2 N - 3)    (noise.triangulated)

and likewise in v. For distances d from epipolar lines, of variance w for noise of 1 px,

    s^2 = sum d^2 / w / n    (noise.epipolar)

The table has the sums. Both are free of what the fit absorbs, and have no bias for white noise. Neither sees errors
along the epipolar line.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.projection import FrameGeometry
from tracknoise.statistics.definitions import LENGTHS, WINDOWS
from tracknoise.statistics.grouping import group_rows
from tracknoise.statistics.histograms import listed
from tracknoise.statistics.noise_sums import magnifications, true_points
from tracknoise.statistics.prepared import PreparedSequence, track_runs
from tracknoise.tables.enumerations import FittedMeasure, Trimming
from tracknoise.tables.schema import (
    EPIPOLAR,
    FITTED_MEASURE,
    FITTED_NOISE,
    LEVERAGE,
    NOISE_TRACKS,
    ORIGIN,
    PAIR_TRACKS,
    TRIMMING,
    WINDOW_BLOCKS,
    WINDOW_NOISE,
    Schema,
    empty,
    typed,
)

LEAST_PARALLAX_PX = 1.0
"""Parallax |g| of a window that shows the depth of its point, px: noise of 1 px leaves it uncertain by 100 %."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedWindows:
    """Windows of N observations each, after the fit of their points."""

    squares: NDArray[np.float64]  # (windows, 2): sums of the squared residuals in u and v, px^2
    # (windows, 2): their degrees of freedom; 2 N - 3 in all, or 2 N - 2 where the window does not show the depth
    freedom: NDArray[np.float64]
    z_px: NDArray[np.float64]  # (windows,): (window.depth), px; NaN where the window does not show the depth


def fit_windows(
    errors_px: NDArray[np.float64], jacobian: NDArray[np.float64], ray_m: NDArray[np.float64]
) -> FittedWindows:
    """Fit a point to each window, (window.residual) and (window.depth).

    Shapes: errors_px (windows, N, 2), jacobian (windows, N, 2, 3) px per metre, ray_m (windows, 3).
    """
    across, along = directions(ray_m)
    lateral = np.linalg.qr((jacobian @ across[:, None]).reshape(len(ray_m), -1, 2))[0]
    depth = (jacobian @ along[:, None, :, None]).reshape(len(ray_m), -1)
    errors = errors_px.reshape(len(ray_m), -1)
    g = _without(depth, lateral)
    parallax_px = np.linalg.norm(g, axis=1)
    shown = parallax_px >= LEAST_PARALLAX_PX
    unit = g / np.where(shown, parallax_px, 1.0)[:, None]
    left = _without(errors, lateral)
    z_px = np.einsum("wi,wi->w", unit, left)
    left = np.where(shown[:, None], left - z_px[:, None] * unit, left)
    leverage = np.square(lateral).sum(axis=2) + np.where(shown[:, None], unit**2, 0.0)
    return FittedWindows(_by_axis(left**2), _by_axis(1.0 - leverage), np.where(shown, z_px, np.nan))


def directions(ray_m: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two directions across each ray (n, 3), as columns (n, 3, 2), metres, as long as the ray; and the ray itself."""
    length = np.linalg.norm(ray_m, axis=1)
    least = np.argmin(np.abs(ray_m), axis=1)
    axis = np.eye(3)[least]
    first = np.cross(ray_m, axis)
    first *= (length / np.linalg.norm(first, axis=1))[:, None]
    second = np.cross(ray_m, first) / length[:, None]
    return np.stack([first, second], axis=2), ray_m


def _without(values: NDArray[np.float64], basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (windows, n) without their parts in the span of orthonormal ones (windows, n, k)."""
    parts = np.einsum("wnk,wn->wk", basis, values)
    left: NDArray[np.float64] = values - np.einsum("wnk,wk->wn", basis, parts)
    return left


def _by_axis(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums over the observations of windows, (windows, 2 N) with u and v in turn, by axis: (windows, 2)."""
    return np.asarray(values.reshape(len(values), -1, 2).sum(axis=1))


def window_runs(
    sequence: PreparedSequence, population: str
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Observations of windows, track by track in order of frames, where each track begins, and how many it has.

    Only tracks whose first observation belongs to the population, and as many observations as a window can have.
    Returns rows (n,), start, length (tracks,). `rows`: of the observations table.
    """
    rows = sequence.ordered
    new, length = track_runs(sequence.track_row[rows])
    place = np.arange(len(rows)) - np.repeat(new, length)
    member = sequence.seen.members(population)[rows]
    outside = np.where(member, len(rows), place)
    until = np.minimum.reduceat(outside, new) if len(new) else np.empty(0, np.intp)
    n_used = np.minimum(np.minimum(length, until), max(WINDOWS))
    n_used = np.where(n_used >= min(WINDOWS), n_used, 0)
    kept = place < np.repeat(n_used, length)
    n_used = n_used[n_used > 0]
    return rows[kept], np.cumsum(n_used) - n_used, n_used


def window_derivatives(
    sequence: PreparedSequence,
    geometry: FrameGeometry,
    rows: NDArray[np.intp],
    start: NDArray[np.intp],
    length: NDArray[np.intp],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Derivatives of the true positions of tracks by their points, and the rays to these.

    Returns jacobian (n, 2, 3) px per metre, ray_m (tracks, 3). `jacobian`: NaN where the depth is unknown. `ray_m`:
    from the camera of the first observation to the point, metres.
    """
    frame, born = sequence.seen.frame[rows], rows[start]
    birth = sequence.seen.frame[born]
    points = true_points(sequence, geometry, born)
    ray_m = points - geometry.world_from_camera[birth, :3, 3]
    return geometry.jacobian(frame, np.repeat(points, length, axis=0)), ray_m


_AT_ONCE = 1 << 18
"""Observations whose derivatives are held at a time."""
_WINDOW_NOISE_SUMS = ("n", "n_depth", "squares_u", "freedom_u", "squares_v", "freedom_v", "squares_z")
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
    scenes, blocks = [empty(WINDOW_NOISE)], [empty(WINDOW_BLOCKS)]
    if parts:
        of_windows = pl.concat(
            part if with_depth else part.with_columns(z=pl.lit(None, dtype=pl.Float64)) for part in parts
        )
        for trimming, chosen in _trimmings(of_windows):
            scenes.append(_table(sequence, chosen.with_columns(block=None), trimming, WINDOW_NOISE))
            blocks.append(_table(sequence, chosen.filter("slow"), trimming, WINDOW_BLOCKS))
    return {"window_noise": _sorted(scenes, WINDOW_NOISE), "window_blocks": _sorted(blocks, WINDOW_BLOCKS)}


def _sorted(parts: Sequence[pl.DataFrame], schema: Schema) -> pl.DataFrame:
    keys = [column for column in schema if column not in (*_WINDOW_NOISE_SUMS, "residual_counts", "z_counts")]
    return pl.concat(parts).sort(keys)


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
    fits = fit_windows(sequence.seen.error_px[observed], jacobian[places], ray_m)
    first = observed[:, 0]
    return pl.DataFrame(
        {
            "condition": sequence.seen.condition[first],
            "block": sequence.block[first],
            "window": np.full(len(first), window),
            "kept": sequence.seen.kept[first],
            "slow": sequence.at_slowest[first],
            **_numbers(fits),
        }
    ).filter(pl.col("squares_u").is_finite() & pl.col("squares_v").is_finite())


def _numbers(fits: FittedWindows) -> Mapping[str, object]:
    return {
        "squares_u": fits.squares[:, 0],
        "squares_v": fits.squares[:, 1],
        "freedom_u": fits.freedom[:, 0],
        "freedom_v": fits.freedom[:, 1],
        "z": pl.Series(fits.z_px, nan_to_null=True),
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
    sums = {name: np.bincount(groups.index, weights[name], groups.count) for name in _WINDOW_NOISE_SUMS}
    freedom = weights["freedom_u"] + weights["freedom_v"]
    residual = np.sqrt((weights["squares_u"] + weights["squares_v"]) / freedom)
    counts = {
        "residual_counts": listed(groups.index, residual, groups.count),
        "z_counts": listed(groups.index, z.abs().to_numpy(), groups.count),
    }
    named = sequence.seen.with_conditions(groups.keys)
    labelled = named.with_columns(pl.lit(trimming, dtype=TRIMMING).alias("trimming"), **sums, **counts)
    return typed(labelled, schema)


MOST = 96
"""Tracks of a sequence, condition and class of lengths that are kept."""
SAMPLED_LENGTHS = (5, 10, 15)
"""Lengths of the windows that are cut from them, in observations: each begins a class."""
MOST_OF_PAIR = 60
"""Observations of a track whose errors in both cameras are kept: errors of both grow apart over its life."""
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
    observed, counts, stands_for = _sample(sequence, population, max(SAMPLED_LENGTHS))
    first = np.cumsum(counts) - counts
    jacobian, ray_m = window_derivatives(sequence, geometry, observed, first, counts)
    bases = np.concatenate([directions(ray_m)[0], ray_m[:, :, None]], axis=2)
    derivatives = np.swapaxes(jacobian @ np.repeat(bases, counts, axis=0), 1, 2).reshape(-1, len(_DERIVATIVES))
    seen = sequence.seen
    columns = {
        "block": sequence.block[observed],
        "track": seen.track[observed],
        "stands_for": stands_for,
        "kept": seen.kept[observed],
        "age": seen.age[observed],
        **dict(zip(("du_px", "dv_px"), seen.error_px[observed].T, strict=True)),
        "magnification": magnifications(sequence, geometry, observed, first, counts),
        **dict(zip(_DERIVATIVES, derivatives.T, strict=True)),
    }
    table = seen.conditions[seen.condition[observed]].hstack(pl.DataFrame(columns))
    keys = [*seen.conditions.columns, "track", "age"]
    return typed(_finite(table), NOISE_TRACKS).sort(keys)


def pair_tracks(sequence: PreparedSequence, *, population: str) -> pl.DataFrame:
    """Errors in both cameras of the tracks that `noise_tracks` has, which may be longer here.

    Parameters
    ----------
    sequence, population
        As there; of trackers of a second camera, whose observations have `PAIR`. Tracks are left out that have an
        observation without an error in the first camera.

    Returns
    -------
    polars.DataFrame
        Schema `PAIR_TRACKS`, sorted.
    """
    observed, counts, stands_for = _sample(sequence, population, MOST_OF_PAIR)
    table = sequence.observations[observed].with_columns(stands_for=stands_for)
    track = pl.Series(np.repeat(np.arange(len(counts)), counts))
    known = table.filter(pl.all_horizontal(pl.col("first_du_px", "first_dv_px").is_not_null()).all().over(track))
    return typed(known, PAIR_TRACKS).sort(*ORIGIN, "track", "age")


def _sample(
    sequence: PreparedSequence, population: str, most: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """First observations of some tracks of every condition, at most so many of each.

    Returns their rows, track by track; how many there are of each track; and how many tracks that of each row stands
    for.
    """
    rows, start, length = window_runs(sequence, population)
    chosen, stands_for = _spread(sequence, rows[start], length)
    counts = np.minimum(length[chosen], most)
    first = np.cumsum(counts) - counts
    observed = rows[np.repeat(start[chosen] - first, counts) + np.arange(counts.sum())]
    return observed, counts, np.repeat(stands_for, counts)


def _spread(
    sequence: PreparedSequence, born: NDArray[np.intp], length: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Places of the tracks that are kept, and how many tracks each of them stands for."""
    condition = sequence.seen.condition[born]
    kind = np.where(sequence.at_slowest[born], np.searchsorted(SAMPLED_LENGTHS, length, side="right"), 0)
    group = condition * (len(SAMPLED_LENGTHS) + 1) + kind
    places, weights = [np.empty(0, np.intp)], [np.empty(0)]
    for number in np.unique(group[kind > 0]):
        members = np.flatnonzero(group == number)
        count = min(len(members), MOST)
        places.append(members[np.arange(count) * len(members) // count])
        weights.append(np.full(count, len(members) / count))
    return np.concatenate(places), np.concatenate(weights)


def _finite(table: pl.DataFrame) -> pl.DataFrame:
    """Rows of each track before the first one that has an unknown number."""
    is_known = pl.all_horizontal(pl.col("du_px", "dv_px", "magnification", *_DERIVATIVES).is_finite())
    before = is_known.cast(pl.UInt8).cum_min().over("tracker", "speed", "track") == 1
    return table.filter(before)


_FITTED_NOISE_SUMS = ("n", "squares_u", "freedom_u", "squares_v", "freedom_v", "squares", "freedom")


def fitted_noise(sequence: PreparedSequence) -> pl.DataFrame:
    """Sums of squared errors and distances, and their degrees of freedom.

    Returns schema `FITTED_NOISE`, sorted by its columns before `n`, with one row for each combination that has an
    observation. Without rows unless true positions are triangulated.
    """
    if not {*EPIPOLAR, *LEVERAGE} <= set(sequence.observations.columns):
        return empty(FITTED_NOISE)
    length_low = _length_class(sequence)
    parts = [
        _summed(sequence, length_low, measure, trimming, values)
        for measure, values in zip(FittedMeasure, (_triangulated(sequence), _epipolar(sequence)), strict=True)
        for trimming in Trimming
    ]
    keys = [name for name in FITTED_NOISE if name not in _FITTED_NOISE_SUMS]
    return pl.concat([empty(FITTED_NOISE), *parts]).sort(keys)


def _length_class(sequence: PreparedSequence) -> NDArray[np.int64]:
    """Shortest length of the class of each observation's track, (rows,): lengths count observations with a pose."""
    posed = sequence.observations["truth"].to_numpy() != "no_pose"
    length = np.bincount(sequence.track_row, posed, minlength=sequence.tracks.height)[sequence.track_row]
    lowest = np.array([low for low, _ in LENGTHS])
    return np.asarray(lowest[np.maximum(np.searchsorted(lowest, length, side="right") - 1, 0)])


def _triangulated(sequence: PreparedSequence) -> NDArray[np.float64]:
    """Values of `_SUMS` of each observation, (rows, sums); NaN where it does not count."""
    leverage = sequence.observations.select("leverage_uu", "leverage_vv").to_numpy()
    squares, freedom = np.square(sequence.seen.error_px), 1.0 - leverage
    squares[~sequence.seen.visible] = np.nan
    (of_u, of_v), (free_u, free_v) = squares.T, freedom.T
    return np.column_stack([np.ones(len(of_u)), of_u, free_u, of_v, free_v, of_u + of_v, free_u + free_v])


def _epipolar(sequence: PreparedSequence) -> NDArray[np.float64]:
    distance, variance = sequence.observations.select(*EPIPOLAR).to_numpy().T
    squares, ones, zeros = np.square(distance) / variance, np.ones(len(distance)), np.zeros(len(distance))
    return np.column_stack([ones, zeros, zeros, zeros, zeros, squares, ones])


def _summed(
    sequence: PreparedSequence,
    length_low: NDArray[np.int64],
    measure: FittedMeasure,
    trimming: Trimming,
    values: NDArray[np.float64],
) -> pl.DataFrame:
    """Sums by scene, condition, block and class of lengths."""
    is_known = ~np.isnan(values).any(axis=1)
    rows = np.flatnonzero(is_known & sequence.seen.kept if trimming == Trimming.trimmed else is_known)
    keys = {"condition": sequence.seen.condition[rows], "block": sequence.block[rows], "length_low": length_low[rows]}
    groups = group_rows(pl.DataFrame(keys), list(keys))
    sums = {
        name: np.bincount(groups.index, values[rows, place], groups.count)
        for place, name in enumerate(_FITTED_NOISE_SUMS)
    }  # fmt: skip
    named = sequence.seen.with_conditions(groups.keys)
    return typed(named.with_columns(*_labels(measure, trimming), **sums), FITTED_NOISE)


def _labels(measure: FittedMeasure, trimming: Trimming) -> Iterator[pl.Expr]:
    yield pl.lit(measure, dtype=FITTED_MEASURE).alias("measure")
    yield pl.lit(trimming, dtype=TRIMMING).alias("trimming")
    highest = {low: high for low, high in LENGTHS if high is not None}
    yield pl.col("length_low").replace_strict(highest, default=None, return_dtype=pl.UInt32).alias("length_high")
