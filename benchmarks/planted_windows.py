"""Windows of tracks with planted noise, and null controls: changes after which a gain has to vanish.

One control hands covariates to other tracks. Another hands errors to other tracks of equal length, for each observation
on its own, so that the variance at each age stays and correlation in time is lost.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.noise.arms import TEXTURE, Beliefs, PlantedNoise
from benchmarks.noise.windows import Problem, TrackGroup, errors_of, images, magnification_of
from tracknoise.estimators.linear_window import (
    CAMERA,
    Motion,
    PointTracks,
    simulated_tracks,
    trajectory,
)


def with_permuted_covariates(problems: Sequence[Problem], *, seed: int = 0) -> list[Problem]:
    """Control N2: each covariate belongs to another track of the same length."""
    random = np.random.default_rng(seed)
    return [
        replace(
            problem,
            groups=tuple(_with_permuted_quality(group, random) for group in problem.groups),
        )
        for problem in problems
    ]


def _with_permuted_quality(group: TrackGroup, random: np.random.Generator) -> TrackGroup:
    order = random.permutation(len(group.points))
    return replace(group, quality={name: values[order] for name, values in group.quality.items()})


def with_permuted_errors(problems: Sequence[Problem], *, seed: int = 0) -> list[Problem]:
    """Control N3: each error belongs to another track of the same length, at the same place in the track."""
    random = np.random.default_rng(seed)
    changed = []
    for problem in problems:
        uv = []
        for group, errors in zip(problem.groups, errors_of(problem), strict=True):
            order = np.argsort(random.random(errors.shape[:2]), axis=0)
            uv.append(group.uv - errors + np.take_along_axis(errors, order[:, :, None], axis=0))
        changed.append(problem.with_uv(tuple(uv)))
    return changed


def with_noise_of(beliefs: Beliefs, other: Beliefs) -> Beliefs:
    """Control N4: the noise model of another tracker."""
    return replace(beliefs, noise=other.noise, by_quality=other.by_quality)


def with_drift_reversed(beliefs: Beliefs) -> Beliefs:
    """Control N5: the mean drift has the opposite sign."""
    return replace(beliefs, drift_px=-beliefs.drift_px)


_TEXTURES = 0.5
"""Standard deviation of the logarithm of the texture of tracks."""


def simulated_problem(
    motion: Motion,
    planted: PlantedNoise,
    *,
    scene: str = "simulated",
    n_frames: int = 11,
    n_tracks: int = 80,
    lengths: NDArray[np.int64] | None = None,
    seed: int = 0,
) -> Problem:
    """A window with its own points and noise."""
    poses = trajectory(motion, n_frames)
    tracks = simulated_tracks(poses, n_tracks=n_tracks, lengths=lengths, seed=seed)
    return noisy(scene, poses, tracks, planted, seed=seed)


def noisy(
    scene: str,
    world_from_camera: NDArray[np.float64],
    tracks: Sequence[PointTracks],
    planted: PlantedNoise,
    *,
    seed: int = 0,
) -> Problem:
    """Tracks of points, seen by `CAMERA` from poses (frames, 4, 4), with planted noise."""
    random = np.random.default_rng((seed, 1))
    exact = Problem(
        scene, CAMERA, world_from_camera, tuple(_exact(random, world_from_camera, group) for group in tracks)
    )
    shared = random.standard_normal((len(world_from_camera), 2))
    steps = np.random.default_rng((seed, 3)).standard_normal(shared.shape)
    uv = tuple(group.uv + _errors(random, exact, group, planted, shared, steps) for group in exact.groups)
    return exact.with_uv(uv)


def _exact(random: np.random.Generator, poses: NDArray[np.float64], tracks: PointTracks) -> TrackGroup:
    count = len(tracks.points)
    texture = np.exp(_TEXTURES * random.standard_normal((count, 1)))
    born, quality = np.ones(count, dtype=bool), {TEXTURE: np.broadcast_to(texture, tracks.frames.shape)}
    return TrackGroup(tracks.frames, images(CAMERA, poses, tracks), tracks.points, born, quality)


def _errors(
    random: np.random.Generator,
    problem: Problem,
    group: TrackGroup,
    planted: PlantedNoise,
    shared: NDArray[np.float64],
    steps: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(tracks, n, 2) px: errors about the true positions."""
    magnification = magnification_of(problem, group)[:, :, None]
    ages = group.ages
    a, w, q, d = (
        _drawn(random, ages.shape, planted.student_nu) @ _root(part).T
        for part in (planted.noise.first, planted.noise.white, planted.noise.walk, planted.noise.drift)
    )
    own, common = np.sqrt(1.0 - planted.common_share), np.sqrt(planted.common_share)
    w = own * w + common * shared[group.frames] @ _root(planted.noise.white).T
    q = own * q + common * steps[group.frames] @ _root(planted.noise.walk).T
    w *= (group.quality[TEXTURE] ** -planted.texture_exponent)[:, :, None]
    q[:, 0] = 0.0
    walked = magnification * np.cumsum(q / magnification, axis=1)
    later = w + walked + ages[:, :, None] * (d[:, :1] + planted.bias_px_per_frame)
    errors = np.where(ages[:, :, None] == 0, a, later)
    if not np.isfinite(planted.track_nu):
        return errors
    return np.asarray(errors / np.sqrt(random.chisquare(planted.track_nu, (len(ages), 1, 1)) / planted.track_nu))


def _root(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Symmetric square root."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)


def _drawn(random: np.random.Generator, shape: tuple[int, ...], nu: float) -> NDArray[np.float64]:
    """(..., 2): of covariance 1, Gaussian or Student."""
    normal = random.standard_normal((*shape, 2))
    if not np.isfinite(nu):
        return normal
    return np.asarray(normal * np.sqrt((nu - 2.0) / random.chisquare(nu, shape))[..., None])
