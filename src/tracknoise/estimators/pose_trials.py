"""What was tried on tracks of the run: the gate of a filter, and one pose from points that are known.

**The gate.** A gate that passes four of five good tracks keeps those with small errors. The others then claim too much
uncertainty: with Gaussian noise in each frame, the NEES is .87 where sigma is right for all tracks. How much that is
with the tracks of a run is tried on drawn windows (`tracknoise.estimators.kernels`). A track passes by its innovations
at true poses, as in (advice.gate). Sigma stays as it is, because the errors of a filter are larger than these: it
linearises, and predicts with an inertial sensor.

**Known points.** In one frame, errors of different points are independent. With many of them, a pose under a robust
loss with weights w(r) of residuals r px has the NEES (loss.nees) over sigma^2. So sigma is the root of the mean of

    E[w] E[w^2 r^2] / 2 / E[w + r w' / 2]^2    (known.sigma)

over scenes, with the errors about the first position of each scene at ages 1 to the length of the window, as often as
its tracks have them. Without a loss this is their mean square. A motion of the whole image is two of the six numbers of
a pose or less, and passes a loss as it is. With the variances of (common.parts), divided as A and W, each feature adds

    E[w] (white W / (A + W) + white A / (A + W) / window + walk mean min(j, k)) / 3    (known.common)

to sigma^2, for ages j, k from 1 to the length of the window, of which each is as frequent.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators import losses
from tracknoise.estimators.advice import LEVEL, chi_square, rms_about_first, track_gate, usual_knee
from tracknoise.estimators.equivalents import white_parts
from tracknoise.estimators.errors_in_common import CommonErrors
from tracknoise.estimators.kernels import NEWEST, DrawnWindow, normalised, weighted_step
from tracknoise.estimators.linear_window import without
from tracknoise.estimators.model import Equivalent, Interval, KnownPoints, LossKind, Tails, TriedGate
from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.intervals import Method, column_means, pooled
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.inference.units import SceneGroups

Array = NDArray[np.float64]

_REJECTED = 1e-9
"""Weight of what a gate rejects."""
_LEAST_WINDOWS, _LEAST_ERRORS = 8, 50
_STEP_PX = 1e-6
"""Of the derivative of a weight."""


def tried_gate(
    drawn: Sequence[DrawnWindow],
    newest: Equivalent,
    *,
    dataset: str,
    groups: SceneGroups,
    level: float,
    cameras: int = 1,
) -> TriedGate | None:
    """NEES of the newest pose with its gate, over that without; None with too few windows.

    `newest`: for a free landmark, in such windows, of so many cameras. Its sigma makes the NEES without a gate 1.
    """
    if len(drawn) < _LEAST_WINDOWS or newest.sigma.value <= 0.0 or newest.gate_80 is None:
        return None
    factor = track_gate(newest.gate_80, newest.window, cameras)
    rows = [
        {"dataset": dataset, "scene": one.scene, "windows": 1.0, **_gated(one, newest.sigma.value, factor)}
        for one in drawn
    ]
    known = pl.DataFrame(rows).filter(pl.col("gated").is_finite())
    if known.height < _LEAST_WINDOWS:
        return None
    nees = over_scenes(known, "gated", "all", "log", groups, level)
    passed = over_scenes(known, "passed", "windows", "logit", groups, level)
    return TriedGate(nees=nees, passed=passed, window=newest.window, windows=known.height)


def _gated(one: DrawnWindow, sigma: float, factor: float) -> dict[str, float]:
    """NEES of the newest pose from tracks that pass, NaN where they do not determine it, and from all; share passed."""
    errors, passed = [own[None] for own in one.errors], []
    for tracks, own in zip(one.tracks, one.errors, strict=True):
        span, freedom = np.linalg.qr(tracks.by_point)[0], own.shape[1] - losses.OF_POINT
        squares = np.square(without(own[:, :, None] / sigma, span)).sum(axis=(1, 2))
        passed.append(squares <= factor * chi_square(LEVEL, freedom))
    found = {"passed": float(np.concatenate(passed).mean())}
    every = [np.ones(len(own), dtype=np.bool_) for own in passed]
    for name, chosen in (("gated", passed), ("all", every)):
        found[name] = _nees(one, errors, [np.where(own, 1.0, _REJECTED) for own in chosen])
    return found


def _nees(one: DrawnWindow, errors: Sequence[Array], weights: Sequence[Array]) -> float:
    """Of the newest pose with a sigma of 1 px, by weights of tracks, (tracks,) each; NaN where it is not determined."""
    spread = [np.broadcast_to(own[None, :, None], each.shape) for own, each in zip(weights, errors, strict=True)]
    try:
        _, error, claimed = weighted_step(one.tracks, errors, spread)
        np.linalg.cholesky(claimed[0])
    except np.linalg.LinAlgError:
        return math.nan
    return normalised(error[0, -NEWEST:], claimed[0, -NEWEST:, -NEWEST:])


def over_scenes(rows: pl.DataFrame, value: str, per: str, scale: str, groups: SceneGroups, level: float) -> Interval:
    """Sum of a column over that of another one, with its interval over scenes. `rows`: also dataset and scene."""
    sums = rows.group_by("dataset", "scene").agg(pl.col(per, value).sum()).sort("scene")
    units = units_of(sums, points=[], columns=[per, value], groups=groups)
    method = Method(IntervalKind.student, level)
    found = pooled(units, np.empty((0, len(units.sums))), column_means, method, scales=[scale])
    return Interval.of(*(float(bound[0, 0]) for bound in (found.value, found.low, found.high)))


def known_points(
    tracks: pl.DataFrame,
    noise: TrackNoise,
    tails: Tails,
    *,
    lengths: Sequence[int],
    speed: int,
    most_px: float,
    common: CommonErrors | None = None,
    groups: SceneGroups,
    level: float,
) -> tuple[KnownPoints, ...]:
    """Sigmas for one pose from known points, without a loss and with each; none with too few tracks.

    `tracks`: schema `NOISE_TRACKS`, of one tracker, speed and view. `noise`: per frame of the recording.
    """
    length = (pl.col("du_px").cast(pl.Float64).pow(2) + pl.col("dv_px").cast(pl.Float64).pow(2)).sqrt()
    errors = tracks.select("dataset", "scene", "stands_for", frames=pl.col("age") / speed, r=length)
    good = errors.filter(pl.col("frames") >= 1, pl.col("r") <= most_px)
    found = tuple(_known_points(good, noise.per_frames(speed), tails, lengths, groups, level))
    return found if common is None else tuple(_with_common(found, good, noise, speed, common))


def _with_common(
    found: Sequence[KnownPoints], errors: pl.DataFrame, noise: TrackNoise, speed: int, common: CommonErrors
) -> Iterator[KnownPoints]:
    """The same with what a feature adds, by (known.common)."""
    first, white = white_parts(noise)
    for one in found:
        loss = _loss(one.kernel, one.knee_px or math.inf)
        some = errors.filter(pl.col("frames") <= one.window)
        weight = float(np.average(_weight(loss, some["r"].to_numpy()), weights=some["stands_for"].to_numpy()))
        ages = np.arange(1.0, one.window + 1.0)
        by_walk = speed * float(np.minimum.outer(ages, ages).mean())
        shared = [weight / 3.0 * part for part in (white + first / one.window, by_walk)]
        yield replace(one, per_feature=common.variances(shared[:1], shared[1:])[0])


def _loss(kernel: LossKind | None, knee_px: float) -> losses.Loss:
    return losses.PLAIN if kernel is None else losses.Loss(losses.LossKind(kernel), knee_px)


def _known_points(
    errors: pl.DataFrame,
    noise: TrackNoise,
    tails: Tails,
    lengths: Sequence[int],
    groups: SceneGroups,
    level: float,
) -> Iterator[KnownPoints]:
    for length in lengths:
        some = errors.filter(pl.col("frames") <= length)
        knee_px = usual_knee(tails, rms_about_first(noise, length))
        if some.height < _LEAST_ERRORS or knee_px <= 0.0:
            continue
        for kernel in (None, *LossKind):
            loss = _loss(kernel, knee_px)
            rows = [
                {"dataset": own["dataset"][0], "scene": scene, "n": 1.0, "square": _square(own, loss)}
                for (scene,), own in some.group_by("scene", maintain_order=True)
            ]
            square = over_scenes(pl.DataFrame(rows), "square", "n", "log", groups, level)
            if square.value > 0.0:
                yield KnownPoints(
                    window=length, kernel=kernel, knee_px=None if kernel is None else knee_px, sigma=square.root()
                )


def _square(errors: pl.DataFrame, loss: losses.Loss) -> float:
    """(known.sigma) of one scene, px^2."""
    r, share = errors["r"].to_numpy(), errors["stands_for"].to_numpy().astype(np.float64)
    weight, slope = _weight(loss, r), (_weight(loss, r + _STEP_PX) - _weight(loss, r - _STEP_PX)) / (2.0 * _STEP_PX)
    mean = [
        float(np.average(values, weights=share)) for values in (weight, (weight * r) ** 2, weight + 0.5 * r * slope)
    ]
    return mean[0] * mean[1] / 2.0 / mean[2] ** 2


def _weight(loss: losses.Loss, r: Array) -> Array:
    """Of residuals of these lengths."""
    return loss.weights(np.stack([r, np.zeros_like(r)], axis=1))[:, 0]
