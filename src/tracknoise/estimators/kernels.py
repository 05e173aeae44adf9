"""Robust losses that were tried on tracks of the run, and the sigma that belongs to each.

A knee in px decides on the poses that a bundle adjustment finds. Sigma scales only what it claims of them: with the
knee kept in px, claimed covariances are in proportion to sigma^2. So each knee has one sigma that makes those of the
newest pose right, and one for all poses,

    sigma^2 = mean over windows of the NEES that 1 px has with this knee    (kernels.sigma)

No formula for independent errors gives it: a robust loss down-weights whole bad tracks, and what remains is alike from
frame to frame. So the errors of sampled tracks of a scene, as they are, are drawn onto the tracks of windows with the
motions, depths and track lengths of the run. Poses and points are found to first order from the truth, by least squares
that are weighted anew until they hardly change.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators import losses
from tracknoise.estimators.linear_window import LinearTracks, determines_poses
from tracknoise.estimators.model import Equivalent, Interval, Kernel, LossKind
from tracknoise.estimators.training import Windows
from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.estimates import EstimateArray
from tracknoise.inference.intervals import Method, column_means, pooled
from tracknoise.inference.units import SceneGroups

Array = NDArray[np.float64]

KNEES = (3.0, 1.0, 0.3)
"""Knees that are tried, over the sigma of innovations. Each starts where the one before ended."""
LENGTH = 11
"""Frames of a window."""
NEWEST = 5
"""Coordinates of the newest pose: three of its rotation, then two of its position."""
_MOST_SCENES, _PER_SCENE = 12, 6
_ENOUGH = 24
"""Windows with drawn errors: few scenes have more of each."""
_LEAST_TRACKS, _LEAST_WINDOWS = 50, 8
_ROUNDS = 5
_COLUMNS = ("nees", "nees_all", "log_ratio")
"""Of one loss: NEES of the newest pose and of all with 1 px, and how the mean logarithm of the newest one's errors
changes by the loss."""


@dataclass(frozen=True, slots=True, eq=False)
class SampledErrors:
    """Errors of sampled tracks of a scene in one camera or in two, px, and the weights of the tracks."""

    errors: Array  # (tracks, observations, cameras, 2), NaN beyond their ends
    length: NDArray[np.int64]  # (tracks,)
    weight: Array  # (tracks,)

    @classmethod
    def of(cls, rows: pl.DataFrame, most_px: float) -> "SampledErrors":
        """From rows of `NOISE_TRACKS` or `PAIR_TRACKS`. A track ends before its first error beyond `most_px`."""
        length = rows["age"].n_unique()
        cameras = [pair for pair in (("first_du_px", "first_dv_px"), ("du_px", "dv_px")) if pair[0] in rows.columns]
        small = pl.all_horizontal((pl.col(u) ** 2 + pl.col(v) ** 2).sqrt() <= most_px for u, v in cameras)
        track = pl.struct("lighting", "camera", "track")
        numbered = rows.with_columns(number=track.rank("dense") - 1).sort("number", "age")
        kept = numbered.filter(small.cast(pl.UInt8).cum_min().over("number") == 1)
        number = kept["number"].rank("dense").to_numpy().astype(np.int64) - 1  # a first error may be too large, too
        place = kept.select(pl.int_range(pl.len()).over("number")).to_series().to_numpy()
        errors = np.full((int(number.max(initial=-1)) + 1, length, len(cameras), 2), np.nan)
        errors[number, place] = kept.select(chain.from_iterable(cameras)).to_numpy().reshape(len(number), -1, 2)
        first = np.searchsorted(number, np.arange(len(errors)))
        return cls(errors, np.bincount(number, minlength=len(errors)), kept["stands_for"].to_numpy()[first])

    def drawn(self, tracks: LinearTracks, random: np.random.Generator) -> Array | None:
        """(tracks, 2 n cameras) px: errors of tracks that are long enough; None where there are none.

        Tracks that begin in the window have errors from their birth, others from a later age on.
        """
        n = tracks.frames.shape[1]
        usable = np.flatnonzero(self.length >= n)
        if not len(usable):
            return None
        weight = self.weight[usable]
        chosen = random.choice(usable, len(tracks.by_point), p=weight / weight.sum())
        latest = self.length[chosen] - n
        begin = np.where(tracks.born, 0, random.integers(0, latest + 1))
        at = begin[:, None] + np.arange(n)
        drawn = self.errors[chosen[:, None], at].swapaxes(1, 2)
        return np.asarray(drawn.reshape(len(chosen), -1), dtype=np.float64)

    def moments(self, n: int, born: NDArray[np.bool_]) -> Array | None:
        """(tracks, m, m) px^2: mean products of the m = 2 n cameras errors of tracks; None where none is long enough.

        `born`: (tracks,), as those of `LinearTracks`. Errors of those begin at birth, of others anywhere later.
        """
        usable = np.flatnonzero(self.length >= n)
        if not len(usable):
            return None
        starts = self.length[usable] - n + 1
        late = np.repeat(usable, starts), np.concatenate([np.arange(one) for one in starts])
        of_kind = [self._moments(n, *begins) for begins in (late, (usable, np.zeros_like(usable)))]
        return np.stack(of_kind)[born.astype(np.intp)]

    def _moments(self, n: int, track: NDArray[np.intp], begin: NDArray[np.intp]) -> Array:
        """Of n errors of tracks from some places on: a track that lives longer is seen at more of them."""
        own = self.errors[track[:, None], begin[:, None] + np.arange(n)].swapaxes(1, 2).reshape(len(track), -1)
        weight = self.weight[track]
        return np.asarray((weight[:, None] * own).T @ own / weight.sum(), dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class DrawnWindow:
    """A window with errors of a scene: (tracks, 2 n) px for each of its groups of tracks."""

    scene: str
    tracks: tuple[LinearTracks, ...]
    errors: tuple[Array, ...]


def tried_kernels(
    drawn: Sequence[DrawnWindow],
    *,
    dataset: str,
    innovations: Equivalent,
    newest: Equivalent,
    every: Equivalent,
    groups: SceneGroups,
    level: float,
) -> tuple[Kernel, ...]:
    """Each loss with each knee; none where there are too few tracks, or no errors.

    `drawn`: of `LENGTH` frames. `innovations`, `newest`, `every`: sigmas for a free landmark in such windows. Intervals
    are over scenes, or groups of them.
    """
    if min(one.sigma.value for one in (innovations, newest, every)) <= 0.0:
        return ()
    if len(drawn) < _LEAST_WINDOWS:
        return ()
    knees = [knee * innovations.sigma.value for knee in KNEES]
    tried = [(kind, knee) for kind in LossKind for knee in knees]
    each = np.empty((len(drawn), len(tried), len(_COLUMNS)))
    for places in _of_same_tracks(drawn):
        errors = [np.stack(own) for own in zip(*(drawn[place].errors for place in places), strict=True)]
        each[places] = _compared(drawn[places[0]].tracks, errors, knees)
    rows = [
        {"scene": one.scene, "number": number, "n": 1.0, **dict(zip(_COLUMNS, values, strict=True))}
        for one, own in zip(drawn, each.tolist(), strict=True)
        for number, values in enumerate(own)
    ]
    table = pl.DataFrame(rows).with_columns(dataset=pl.lit(dataset))
    sums = table.group_by("dataset", "scene", "number").agg(pl.col("n", *_COLUMNS).sum())
    units = units_of(sums, points=["number"], columns=["n", *_COLUMNS], groups=groups)
    method = Method(IntervalKind.student, level)
    found = pooled(units, np.empty((0, len(units.sums))), column_means, method, scales=["log", "log", "linear"])
    return tuple(
        Kernel(
            kind=kind,
            knee_px=knee_px,
            sigma_ratio=_changed(found, (0, place), lambda square: square**0.5 / newest.sigma.value),
            all_poses_ratio=_changed(found, (1, place), lambda square: square**0.5 / every.sigma.value),
            error_ratio=_changed(found, (2, place), lambda log: float(np.exp(log))),
            windows=len(drawn),
        )
        for place, (kind, knee_px) in enumerate(tried)
    )


def drawn_windows(tracks: pl.DataFrame, windows: Windows, most_px: float) -> Iterator[DrawnWindow]:
    """Windows of each scene with errors of its tracks.

    `tracks`: schema `NOISE_TRACKS`, or `PAIR_TRACKS` with windows of both cameras, of one tracker, speed and view.
    `windows`: of `LENGTH` frames. Errors beyond `most_px` are left out, as an estimator's test for outliers would do.
    """
    names = tracks["scene"].unique().sort().to_list()
    scenes = sampled_scenes(tracks, most_px)
    windows_of = {place: windows.of_scene(names[place]) for place in scenes}
    drawn_each = max(_PER_SCENE, -(-_ENOUGH // max(len(scenes), 1)))
    determines = cache(determines_poses)
    for place, scene in scenes.items():
        random = np.random.default_rng(place)
        draws = -(-drawn_each // len(windows_of[place]))
        for window in [windows.each[one] for one in windows_of[place] for _ in range(draws)]:
            drawn = [(group, own) for group in window if (own := scene.drawn(group, random)) is not None]
            groups = tuple(group for group, _ in drawn)
            if any(own.any() for _, own in drawn) and determines(groups):
                yield DrawnWindow(names[place], groups, tuple(own for _, own in drawn))


def sampled_scenes(tracks: pl.DataFrame, most_px: float, most: int = _MOST_SCENES) -> dict[int, SampledErrors]:
    """Errors of some scenes with enough tracks, by the places of their names in order; arguments as above."""
    names = tracks["scene"].unique().sort().to_list()
    places = np.unique(np.linspace(0, len(names) - 1, min(most, len(names))).round().astype(int)).tolist()
    every = {place: SampledErrors.of(tracks.filter(scene=names[place]), most_px) for place in places if names}
    return {place: scene for place, scene in every.items() if len(scene.errors) >= _LEAST_TRACKS}


def _of_same_tracks(drawn: Sequence[DrawnWindow]) -> list[list[int]]:
    """Places of windows that have the same tracks."""
    places = dict[tuple[LinearTracks, ...], list[int]]()
    for place, one in enumerate(drawn):
        places.setdefault(one.tracks, []).append(place)
    return list(places.values())


def _compared(window: Sequence[LinearTracks], errors: Sequence[Array], knees: Sequence[float]) -> Array:
    """For each draw of errors and each loss what `_COLUMNS` says.

    Shapes: errors (draws, tracks, 2 n); returns (draws, losses, columns).
    """
    _, plain, _ = weighted_step(window, errors, [np.ones_like(own) for own in errors])
    found = []
    for kind in LossKind:
        residuals = list(errors)
        for knee in knees:
            loss = losses.Loss(losses.LossKind(kind), knee)
            for _ in range(_ROUNDS):
                weights = [loss.weights(own.reshape(-1, own.shape[2])).reshape(own.shape) for own in residuals]
                residuals, error, claimed = weighted_step(window, errors, weights)
            newest = [
                normalised(*both) for both in zip(error[:, -NEWEST:], claimed[:, -NEWEST:, -NEWEST:], strict=True)
            ]
            every = [normalised(*both) for both in zip(error, claimed, strict=True)]
            found.append(np.stack([newest, every, _log_errors(error) - _log_errors(plain)], axis=1))
    return np.stack(found, axis=1)


def normalised(error: Array, covariance: Array) -> float:
    """Normalised error squared over its degrees of freedom. Shapes: error (n,), covariance (n, n)."""
    return float(error @ np.linalg.solve(covariance, error) / len(error))


def _log_errors(error: Array) -> Array:
    """Mean logarithm of the errors of rotation and position of the newest pose, (draws,)."""
    turned, moved = (np.log(np.linalg.norm(part, axis=1)) for part in (error[:, -NEWEST:-2], error[:, -2:]))
    return np.asarray(0.5 * (turned + moved))


def weighted_step(
    window: Sequence[LinearTracks], errors: Sequence[Array], weights: Sequence[Array]
) -> tuple[list[Array], Array, Array]:
    """Residuals by weighted least squares, and error and claimed covariance of the p numbers of all poses, for 1 px.

    Shapes: errors, weights, residuals (draws, tracks, 2 n), error (draws, p), covariance (draws, p, p); the newest
    pose is last.
    """
    size, draws = window[0].by_pose.shape[2], len(errors[0])
    information, gradient = np.zeros((draws, size, size)), np.zeros((draws, size, 1))
    solved = []
    for tracks, own, weight in zip(window, errors, weights, strict=True):
        by_pose, by_point = tracks.by_pose, weight[..., None] * tracks.by_point
        normal = np.linalg.inv(np.swapaxes(tracks.by_point, 1, 2) @ by_point)
        across = np.swapaxes(by_point, 2, 3) @ by_pose
        of_error = np.swapaxes(by_point, 2, 3) @ own[..., None]
        half = (normal @ across).reshape(draws, -1, size)
        rows = (weight[..., None] * by_pose).reshape(draws, -1, size)
        information += np.swapaxes(rows, 1, 2) @ by_pose.reshape(-1, size)
        information -= np.swapaxes(across.reshape(draws, -1, size), 1, 2) @ half
        gradient += np.swapaxes(rows, 1, 2) @ own.reshape(draws, -1, 1)
        gradient -= np.swapaxes(half, 1, 2) @ of_error.reshape(draws, -1, 1)
        solved.append((normal, across, of_error))
    claimed: Array = np.asarray(np.linalg.inv(information), dtype=np.float64)
    pose = (claimed @ gradient)[:, None]
    residuals = []
    for tracks, own, (normal, across, of_error) in zip(window, errors, solved, strict=True):
        point = normal @ (of_error - across @ pose)
        residuals.append(own - (tracks.by_pose @ pose + tracks.by_point @ point)[..., 0])
    return residuals, pose[:, 0, :, 0], claimed


def _changed(found: EstimateArray, place: tuple[int, int], change: Callable[[float], float]) -> Interval:
    """An increasing function of a value and its bounds."""
    value, *bounds = (float(part[place]) for part in (found.value, found.low, found.high))
    low, high = (None if np.isnan(bound) else change(bound) for bound in bounds)
    return Interval(value=change(value), low=low, high=high)
