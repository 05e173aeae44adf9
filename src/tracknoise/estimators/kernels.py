"""Robust losses that were tried on tracks of the run, and the sigma that belongs to each.

A knee in px decides on the poses that a bundle adjustment finds. Sigma scales only what it claims of them: with the
knee kept in px, claimed covariances are in proportion to sigma^2. So each knee has one sigma that makes them right,

    sigma^2 = mean over windows of the NEES of the newest pose that 1 px has with this knee    (kernels.sigma)

No formula for independent errors gives it: a robust loss down-weights whole bad tracks, and what remains is alike from
frame to frame. So the errors of sampled tracks of a scene, as they are, are drawn onto the tracks of windows with the
motions, depths and track lengths of the run. Poses and points are found to first order from the truth, by least squares
that are weighted anew until they hardly change.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators import bundle
from tracknoise.estimators.linear_window import LinearTracks, determines_poses
from tracknoise.estimators.model import Equivalent, Interval, Kernel, LossKind
from tracknoise.estimators.trial import NEWEST, normalised
from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.estimates import EstimateArray
from tracknoise.inference.intervals import Method, column_means, pooled
from tracknoise.inference.units import SceneGroups

Array = NDArray[np.float64]

KNEES = (3.0, 1.0, 0.3)
"""Knees that are tried, over the sigma of innovations. Each starts where the one before ended."""
LENGTH = 11
"""Frames of a window."""
_MOST_SCENES, _PER_SCENE = 12, 3
_LEAST_TRACKS, _LEAST_WINDOWS = 50, 8
_ROUNDS = 5


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """Errors of sampled tracks of a scene: (tracks, observations, 2) px, NaN beyond their ends, and their weights."""

    errors: Array
    length: NDArray[np.int64]
    weight: Array

    @classmethod
    def of(cls, rows: pl.DataFrame, most_px: float) -> "_Scene":
        """From rows of `NOISE_TRACKS`. A track ends before its first error beyond `most_px`."""
        length = rows["age"].n_unique()
        small = (pl.col("du_px") ** 2 + pl.col("dv_px") ** 2).sqrt() <= most_px
        track = pl.struct("lighting", "camera", "track")
        numbered = rows.with_columns(number=track.rank("dense") - 1).sort("number", "age")
        kept = numbered.filter(small.cast(pl.UInt8).cum_min().over("number") == 1)
        number = kept["number"].rank("dense").to_numpy().astype(np.int64) - 1  # a first error may be too large, too
        place = kept.select(pl.int_range(pl.len()).over("number")).to_series().to_numpy()
        errors = np.full((int(number.max(initial=-1)) + 1, length, 2), np.nan)
        errors[number, place] = kept.select("du_px", "dv_px").to_numpy()
        first = np.searchsorted(number, np.arange(len(errors)))
        return cls(errors, np.bincount(number, minlength=len(errors)), kept["stands_for"].to_numpy()[first])

    def drawn(self, tracks: LinearTracks, random: np.random.Generator) -> Array | None:
        """(tracks, 2 n) px: errors of tracks that are long enough; None where there are none.

        Tracks that begin in the window have errors from their birth, others from a later age on.
        """
        n = tracks.by_point.shape[1] // 2
        usable = np.flatnonzero(self.length >= n)
        if not len(usable):
            return None
        weight = self.weight[usable]
        chosen = random.choice(usable, len(tracks.by_point), p=weight / weight.sum())
        latest = self.length[chosen] - n
        begin = np.where(tracks.born, 0, random.integers(0, latest + 1))
        at = begin[:, None] + np.arange(n)
        return np.asarray(self.errors[chosen[:, None], at].reshape(len(chosen), -1), dtype=np.float64)


def tried_kernels(
    tracks: pl.DataFrame,
    windows: Sequence[Sequence[LinearTracks]],
    *,
    innovations: Equivalent,
    newest: Equivalent,
    most_px: float,
    groups: SceneGroups,
    level: float,
) -> tuple[Kernel, ...]:
    """Each loss with each knee; none where there are too few tracks, or no errors.

    `tracks`: schema `NOISE_TRACKS`, of one tracker, speed and view. `windows`: of `LENGTH` frames. `innovations`,
    `newest`: sigmas for a free landmark in such windows. Errors beyond `most_px` are left out, as an estimator's test
    for outliers would do. Intervals are over scenes, or groups of them.
    """
    if innovations.sigma.value <= 0.0 or newest.sigma.value <= 0.0:
        return ()
    drawn = list(_windows(tracks, windows, most_px))
    if len(drawn) < _LEAST_WINDOWS:
        return ()
    tried = [(kind, knee * innovations.sigma.value) for kind in LossKind for knee in KNEES]
    rows = [
        {"scene": scene, "number": number, "n": 1.0, "nees": nees, "log_ratio": log_error - plain}
        for scene, window, errors in drawn
        for plain in [_plain(window, errors)]
        for number, (nees, log_error) in enumerate(
            each
            for kind in LossKind
            for each in _robust(window, errors, bundle.LossKind(kind), [px for own, px in tried if own is kind])
        )
    ]
    table = pl.DataFrame(rows).with_columns(dataset=pl.lit(tracks["dataset"][0]))
    sums = table.group_by("dataset", "scene", "number").agg(pl.col("n", "nees", "log_ratio").sum())
    units = units_of(sums, points=["number"], columns=["n", "nees", "log_ratio"], groups=groups)
    method = Method(IntervalKind.student, level)
    found = pooled(units, np.empty((0, len(units.sums))), column_means, method, scales=["log", "linear"])
    return tuple(
        Kernel(
            kind=kind,
            knee_px=knee_px,
            sigma_ratio=_changed(found, (0, place), lambda square: square**0.5 / newest.sigma.value),
            error_ratio=_changed(found, (1, place), lambda log: float(np.exp(log))),
            windows=len(drawn),
        )
        for place, (kind, knee_px) in enumerate(tried)
    )


def _windows(
    tracks: pl.DataFrame, windows: Sequence[Sequence[LinearTracks]], most_px: float
) -> Iterator[tuple[str, Sequence[LinearTracks], Sequence[Array]]]:
    """Windows with drawn errors, and the scene that these are of."""
    scenes = tracks["scene"].unique().sort().to_list()
    places = np.unique(np.linspace(0, len(scenes) - 1, min(_MOST_SCENES, len(scenes))).round().astype(int))
    for place in places.tolist() if scenes else []:
        scene = _Scene.of(tracks.filter(scene=scenes[place]), most_px)
        if len(scene.errors) < _LEAST_TRACKS:
            continue
        random = np.random.default_rng(place)
        for window in [one for one in windows for _ in range(_PER_SCENE)]:
            drawn = [(group, own) for group in window if (own := scene.drawn(group, random)) is not None]
            groups = [group for group, _ in drawn]
            if any(own.any() for _, own in drawn) and determines_poses(groups):
                yield scenes[place], groups, [own for _, own in drawn]


def _plain(window: Sequence[LinearTracks], errors: Sequence[Array]) -> float:
    """Mean logarithm of the errors of the newest pose by least squares."""
    _, error, _ = _step(window, errors, [np.ones_like(own) for own in errors])
    return _log_error(error)


def _robust(
    window: Sequence[LinearTracks], errors: Sequence[Array], kind: bundle.LossKind, knees: Sequence[float]
) -> list[tuple[float, float]]:
    """For each knee the NEES of the newest pose with 1 px, and the mean logarithm of its errors."""
    residuals, found = list(errors), list[tuple[float, float]]()
    for knee in knees:
        loss = bundle.Loss(kind, knee)
        for _ in range(_ROUNDS):
            residuals, error, claimed = _step(window, errors, [loss.weights(own) for own in residuals])
        found.append((normalised(error, claimed), _log_error(error)))
    return found


def _log_error(error: Array) -> float:
    return 0.5 * float(np.log(np.linalg.norm(error[:-2])) + np.log(np.linalg.norm(error[-2:])))


def _step(
    window: Sequence[LinearTracks], errors: Sequence[Array], weights: Sequence[Array]
) -> tuple[list[Array], Array, Array]:
    """Residuals by weighted least squares, and error and claimed covariance of the newest pose, for 1 px."""
    size = window[0].by_pose.shape[2]
    information, gradient = np.zeros((size, size)), np.zeros(size)
    solved = []
    for tracks, own, weight in zip(window, errors, weights, strict=True):
        by_pose, by_point = tracks.by_pose, weight[:, :, None] * tracks.by_point
        normal = np.linalg.inv(np.swapaxes(tracks.by_point, 1, 2) @ by_point)
        across = np.swapaxes(by_point, 1, 2) @ by_pose
        rows = weight[:, :, None] * by_pose
        of_error = np.einsum("tni,tn->ti", by_point, own)
        half = normal @ across
        information += rows.reshape(-1, size).T @ by_pose.reshape(-1, size)
        information -= across.reshape(-1, size).T @ half.reshape(-1, size)
        gradient += rows.reshape(-1, size).T @ own.ravel() - half.reshape(-1, size).T @ of_error.ravel()
        solved.append((normal, across, of_error))
    claimed: Array = np.asarray(np.linalg.inv(information), dtype=np.float64)
    pose = claimed @ gradient
    residuals = []
    for tracks, own, (normal, across, of_error) in zip(window, errors, solved, strict=True):
        point = np.einsum("tij,tj->ti", normal, of_error - across @ pose)
        residuals.append(own - tracks.by_pose @ pose - np.einsum("tni,ti->tn", tracks.by_point, point))
    return residuals, pose[-NEWEST:], claimed[-NEWEST:, -NEWEST:]


def _changed(found: EstimateArray, place: tuple[int, int], change: Callable[[float], float]) -> Interval:
    """An increasing function of a value and its bounds."""
    value, *bounds = (float(part[place]) for part in (found.value, found.low, found.high))
    low, high = (None if np.isnan(bound) else change(bound) for bound in bounds)
    return Interval(value=change(value), low=low, high=high)
