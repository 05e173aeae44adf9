"""Windows of tracks with planted noise, on simulated geometry."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tracknoise.noise_models.linear_window import CAMERA, Motion, PointTracks, simulated_tracks, trajectory
from tracknoise.noise_models.track_noise import TrackNoise
from tracknoise.proof.bundle import Start
from tracknoise.proof.problem import Problem, TrackGroup, images, magnification_of

_PERTURBED_RAD, _PERTURBED_SHARE = 0.002, 0.02
"""How wrong an estimator starts: rotations, and the share by which positions and inverse depths err."""
_TEXTURES = 0.5
"""Standard deviation of the logarithm of the texture of tracks."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlantedNoise:
    """The noise of simulated tracks.

    Parameters
    ----------
    noise
        Components of the errors.
    student_nu
        Degrees of freedom of Student's distribution of every part of an error, above 2. Covariances stay the same.
    bias_px_per_frame
        Mean drift of all tracks along u and v, px per frame since birth.
    common_share
        Share of the independent variance W that all tracks of a frame have in common, from 0 to 1.
    texture_exponent
        The independent variance is multiplied by texture^(-2 exponent), where the logarithm of the texture is Gaussian
        with mean 0 and standard deviation 0.5.
    """

    noise: TrackNoise = field(default_factory=TrackNoise)
    student_nu: float = np.inf
    bias_px_per_frame: tuple[float, float] = (0.0, 0.0)
    common_share: float = 0.0
    texture_exponent: float = 0.0


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
    """A window with its own points and noise.

    Parameters
    ----------
    motion
        Of the camera.
    planted
        Noise of the tracks.
    scene
        Name of its scene.
    n_frames, n_tracks, lengths
        As in `tracknoise.noise_models.linear_window.simulated_tracks`.
    seed
        Of points and noise.
    """
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
    uv = tuple(group.uv + _errors(random, exact, group, planted, shared) for group in exact.groups)
    return exact.with_uv(uv)


def _exact(random: np.random.Generator, poses: NDArray[np.float64], tracks: PointTracks) -> TrackGroup:
    count = len(tracks.points)
    texture = _TEXTURES * random.standard_normal(count)
    return TrackGroup(tracks.frames, images(CAMERA, poses, tracks), tracks.points, np.ones(count, dtype=bool), texture)


def _errors(
    random: np.random.Generator,
    problem: Problem,
    group: TrackGroup,
    planted: PlantedNoise,
    shared: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(tracks, n, 2) px: errors about the true positions."""
    magnification = magnification_of(problem, group)[:, :, None]
    ages = group.ages
    a, w, q, d = (
        _drawn(random, ages.shape, planted.student_nu) @ _root(part).T
        for part in (planted.noise.first, planted.noise.white, planted.noise.walk, planted.noise.drift)
    )
    common = shared[group.frames] @ _root(planted.noise.white).T
    w = np.sqrt(1.0 - planted.common_share) * w + np.sqrt(planted.common_share) * common
    w *= np.exp(-planted.texture_exponent * group.covariate)[:, None, None]
    q[:, 0] = 0.0
    walked = magnification * np.cumsum(q / magnification, axis=1)
    later = w + walked + ages[:, :, None] * (d[:, :1] + planted.bias_px_per_frame)
    return np.where(ages[:, :, None] == 0, a, later)


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


def perturbed(problem: Problem, *, seed: int = 0) -> Start:
    """The true poses and points, a little wrong; the same for everything that is tried on a problem."""
    random = np.random.default_rng((seed, 2))
    true = problem.world_from_camera
    baseline_m = float(np.linalg.norm(true[-1, :3, 3] - true[0, :3, 3]))
    scale = np.tile(np.repeat((_PERTURBED_RAD, _PERTURBED_SHARE * baseline_m), 3), len(true))
    gauge = problem.gauge
    poses = gauge.moved(true, gauge.free(scale * random.standard_normal(scale.shape)))
    points = []
    for group in problem.groups:
        eye = true[group.frames[:, 0], :3, 3]
        share = np.exp(_PERTURBED_SHARE * random.standard_normal((len(eye), 1)))
        points.append(eye + share * (group.points - eye))
    return Start(poses, tuple(points))
