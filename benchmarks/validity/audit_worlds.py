"""Made-up recordings with known faults of the truth, for tests and benchmarks of the audit.

Points lie at random depths before a camera that moves smoothly at random. Positions follow from the model of the audit,
whose predictions are tested against other code; what is tried here is the statistics: noise that walks within tracks,
outliers, trackers of different quality, and biases of trackers.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera, KnownCamera
from tracknoise.inference.units import Resampled
from tracknoise.truth_faults.audit_samples import AuditSamples, Paths
from tracknoise.truth_faults.corrected_positions import predict
from tracknoise.truth_faults.fault_parameters import COUNT, SLICES, Parameter

AGES = np.array([1, 2, 3, 4, 6, 8, 12, 16, 24])
CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)


@dataclass(frozen=True, slots=True)
class World:
    """What recordings are like.

    Parameters
    ----------
    n_scenes, n_frames
        Scenes, and frames of each.
    per_scene
        Observations of each tracker in each scene.
    noise_px
        Of each tracker: white noise and steps of a random walk of this size, each a half of the variance at age 1.
    outliers
        Share of observations that are wrong by up to 30 px.
    bias_px, drift_px_per_frame
        Of each tracker, in u and v.
    drift_of_scene
        Size of random drifts per frame of each tracker in each scene, px.
    wobble
        Size of random turns and moves from frame to frame, radians and metres.
    lively
        How many scenes have them; by default all.
    steady_m
        Added to the move from each frame to the next, along x, y and z of the world, metres.
    freedom
        Factors of the random moves along x, y and z.
    depth_m
        Nearest and farthest depth.
    camera, readout
        The camera, and the stated readout of its shutter in frames.
    """

    n_scenes: int = 8
    n_frames: int = 80
    per_scene: int = 400
    noise_px: tuple[float, ...] = (0.3, 0.5)
    outliers: float = 0.03
    bias_px: tuple[tuple[float, float], ...] = ((0.0, 0.0), (0.0, 0.0))
    drift_px_per_frame: tuple[tuple[float, float], ...] = ((0.0, 0.0), (0.0, 0.0))
    drift_of_scene: float = 0.0
    wobble: tuple[float, float] = (0.01, 0.02)
    lively: int | None = None
    steady_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    freedom: tuple[float, float, float] = (1.0, 1.0, 1.0)
    depth_m: tuple[float, float] = (1.0, 5.0)
    camera: KnownCamera = field(default=CAMERA)
    readout: float = 0.0


def theta_of(faults: Mapping[Parameter, float | tuple[float, ...]]) -> NDArray[np.float64]:
    """Numbers of all parameters, those that are not named 0."""
    theta = np.zeros(COUNT)
    for parameter, value in faults.items():
        theta[SLICES[parameter]] = value
    return theta


def make_samples(rng: np.random.Generator, world: World, theta: NDArray[np.float64]) -> AuditSamples:
    """Observations of a world whose stated truth lacks the corrections `theta`."""
    samples = _stated(rng, world)
    true = predict(samples, theta).uv
    good = np.isfinite(true).all(axis=1) & (np.abs(true - samples.stated).max(axis=1) < 200.0)
    samples = samples.chosen(np.flatnonzero(good))
    return _observed(rng, world, samples, true[good])


def _stated(rng: np.random.Generator, world: World) -> AuditSamples:
    n_trackers = len(world.noise_px)
    n = world.n_scenes * world.per_scene * n_trackers
    scene = np.repeat(np.arange(world.n_scenes), world.per_scene * n_trackers)
    age = rng.choice(AGES, n)
    birth = rng.integers(0, world.n_frames - age) + scene * world.n_frames
    uv = rng.uniform((0.0, 0.0), (world.camera.width - 1.0, world.camera.height - 1.0), (n, 2))
    frames = world.n_scenes * world.n_frames
    within = (birth % world.n_frames) * 8 // world.n_frames
    block = np.unique(scene * 8 + within, return_inverse=True)[1]
    few = world.n_scenes < 6
    samples = AuditSamples(
        trackers=tuple(f"tracker {number}" for number in range(n_trackers)),
        tracker=np.tile(np.arange(n_trackers), n // n_trackers),
        age=age,
        cluster=block if few else scene,
        block=block,
        resampled=Resampled.blocks if few else Resampled.scenes,
        n_scenes=world.n_scenes,
        birth=birth,
        now=birth + age,
        uv_at_birth=uv,
        observed=np.zeros((n, 2)),
        stated=uv,
        depth=rng.uniform(*world.depth_m, n),
        paths=_paths(rng, world),
        cameras=(world.camera,),
        camera=np.zeros(frames, np.intp),
        readout_of=np.full(frames, world.readout),
        axis_of=np.ones(frames, np.intp),
        interval_s=1.0 / 30.0,
    )
    stated = predict(samples, np.zeros(COUNT)).uv
    seen = np.flatnonzero(world.camera.contains(stated))
    return replace(samples, stated=stated).chosen(seen)


def _paths(rng: np.random.Generator, world: World) -> Paths:
    """Smooth paths: turns and moves that change slowly, different in each scene."""
    poses, times, number = [], [], []
    for scene in range(world.n_scenes):
        is_lively = world.lively is None or scene < world.lively
        steps = [_smooth(rng, world.n_frames) * (is_lively * size) for size in world.wobble]
        at = np.tile(np.eye(4), (world.n_frames, 1, 1))
        at[:, :3, :3] = Rotation.from_rotvec(np.cumsum(steps[0], axis=0)).as_matrix()
        at[:, :3, 3] = np.cumsum(steps[1] * world.freedom + world.steady_m, axis=0)
        poses.append(at)
        times.append(np.arange(world.n_frames, dtype=np.float64))
        number.append(np.full(world.n_frames, scene))
    return Paths.of(np.concatenate(times), np.concatenate(poses), np.concatenate(number))


def _smooth(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    """(n, 3): noise of unit variance with a memory of about 8 frames."""
    kernel = np.hanning(17)
    white = rng.normal(size=(n + 16, 3))
    return np.stack([np.convolve(column, kernel / np.linalg.norm(kernel), "valid") for column in white.T], axis=1)


def _observed(rng: np.random.Generator, world: World, samples: AuditSamples, true: NDArray[np.float64]) -> AuditSamples:
    n = len(samples.age)
    sigma = np.array(world.noise_px)[samples.tracker, None]
    noise = sigma * np.sqrt(0.5 + 0.5 * samples.age[:, None]) * rng.standard_normal((n, 2))
    drift = np.array(world.drift_px_per_frame)[samples.tracker] * samples.age[:, None].astype(np.float64)
    if world.drift_of_scene:
        of_scene = world.drift_of_scene * rng.standard_normal((samples.n_scenes, len(samples.trackers), 2))
        scene = samples.birth // world.n_frames
        drift = drift + of_scene[scene, samples.tracker] * samples.age[:, None]
    wrong = (rng.random(n) < world.outliers)[:, None] * rng.uniform(-30.0, 30.0, (n, 2))
    observed = true + noise + drift + np.array(world.bias_px)[samples.tracker] + wrong
    return replace(samples, observed=observed)
