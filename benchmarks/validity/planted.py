"""Scenes of tracks whose errors are planted: what is true is known, and the package's simulators have no part in it.

Tracks are born all along a scene of `FRAMES` frames, and are followed for at most `AGES` - 1 of them. The error of a
track at age k, in u and in v, is

    white e_k + walk (sum of k steps) + drift d k + ar a_k, times the scales of the scene, the tracker and the track

with independent e, steps and d of variance 1, and a an autoregression of coefficient `phi` from 0 on. In a burst, which
every tenth frame of a scene is, e and the steps of all tracks are three times as large. At birth the error is zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import special

Array = np.ndarray
FRAMES, AGES, TRACKS, AT = 40, 16, 150, 10
"""`AT` is the age at which errors are looked at."""
HAZARD, BURSTS, TIMES = 0.06, 0.1, 3.0
OUTLIERS = 0.03
LOST = 2.5
"""Where losses depend on errors: in so many times the RMS at age 5 of a track of usual scale."""


@dataclass(frozen=True)
class World:
    """What is planted.

    `scale`: how scenes differ: the standard deviation of the logarithm of their scale, or the degrees of freedom of an
    inverse gamma distribution of their squared scale where it is 2 or more. `tracker`: the standard deviation of
    the logarithm of a scale that each tracker has in each scene. `freedom`: of the scale of tracks, as that of scenes.
    `noise`: degrees of freedom of e and of the steps, which have Student's distribution.
    `lives`: equal, geometric, unequal (hazards that differ by scene) or lost (where errors are large).
    """

    white: float = 0.2
    walk: float = 0.0
    drift: float = 0.0
    ar: float = 0.0
    phi: float = 0.8
    bias: float = 0.0
    scale: float = 0.0
    tracker: float = 0.0
    freedom: float = np.inf
    noise: float = np.inf
    bursts: bool = False
    lives: str = "geometric"
    groups: bool = False

    def is_gaussian(self) -> bool:
        """Whether errors of a scene at one age are Gaussian."""
        return np.isinf(self.freedom) and np.isinf(self.noise) and not self.bursts

    def squared_scale(self) -> float:
        """Mean squared scale of scenes, trackers and tracks together."""
        of_tracks = 1.0  # tracks have variance 1 by construction
        return mean_power(self.scale, 2) * mean_power(self.tracker, 2) * of_tracks

    def log_scale(self) -> float:
        """Mean logarithm of the scale of scenes."""
        if self.scale < 2:
            return 0.0
        return float(np.log(self.scale / 2) - special.digamma(self.scale / 2)) / 2

    def burst(self) -> float:
        """By how much bursts raise the variance of noise and of steps."""
        return 1 + BURSTS * (TIMES**2 - 1) if self.bursts else 1.0

    def sizes(self) -> dict[str, float]:
        """Sizes of the terms in a scene of scale 1."""
        root = self.burst() ** 0.5
        return {"white": self.white * root, "walk": self.walk * root, "drift": self.drift}

    def second(self, age: int = AT) -> float:
        """Second moment of u at an age in a scene of scale 1, where losses do not depend on errors."""
        known = self.burst() * (self.white**2 + self.walk**2 * age) + self.drift**2 * age**2 + self.bias**2
        return known + self.ar**2 * (1 - self.phi ** (2 * age))

    def rise(self, first: int = 1, last: int = AT) -> float:
        """RMS at the last age over that at the first."""
        return float(np.sqrt(self.second(last) / self.second(first)))


def mean_power(scale: float, power: float) -> float:
    """Mean power of a scale."""
    if scale < 2:
        return float(np.exp((power * scale) ** 2 / 2))
    half = scale / 2
    return float(np.exp((power / 2) * np.log(half) + special.gammaln(half - power / 2) - special.gammaln(half)))


WORLDS: Mapping[str, World] = {
    "white": World(),
    "walk": World(white=0.0, walk=0.1),
    "white and walk": World(walk=0.05),
    "white and walk, alike": World(walk=0.1),
    "drift": World(white=0.05, drift=0.03),
    "AR(1), .8": World(white=0.0, ar=0.2),
    "biased": World(walk=0.1, bias=0.1),
    "log sd .7": World(walk=0.1, scale=0.7),
    "log sd .7, white": World(scale=0.7),
    "scenes t3": World(walk=0.1, scale=3),
    "tracks t3": World(walk=0.1, freedom=3),
    "noise t3": World(walk=0.1, noise=3),
    "bursts": World(walk=0.1, bursts=True),
    "groups": World(walk=0.1, scale=0.7, groups=True),
    "own scale": World(walk=0.1, scale=0.7, tracker=0.35),
    "equal lives": World(walk=0.1, lives="equal"),
    "unequal lives": World(walk=0.1, scale=0.35, lives="unequal"),
    "lost if large": World(white=0.05, walk=0.1, lives="lost"),
}


@dataclass(frozen=True)
class Scenes:
    """Errors (scenes, tracks, ages, 2), px, which of them were seen (scenes, tracks, ages), the others are not there.

    `ended` (scenes, tracks): whether a track was lost, not cut by the end of its scene. `outliers` (scenes, frames, 2):
    features that were offered, and rejected. `group` (scenes,). `birth` (scenes, tracks): first frame.
    """

    errors: Array
    alive: Array
    ended: Array
    outliers: Array
    group: Array
    birth: Array


def draw(world: World, n_scenes: int, rng: np.random.Generator, *, tracks: int = TRACKS) -> Scenes:
    """Scenes of a world."""
    shape = (n_scenes, tracks)
    group = np.arange(n_scenes) // 2 if world.groups else np.arange(n_scenes)
    of_scene = _scales(world.scale, n_scenes, group, rng) * np.exp(world.tracker * rng.normal(size=n_scenes))
    of_track = np.ones(shape) if np.isinf(world.freedom) else _t_scales(world.freedom, shape, rng)
    birth = rng.integers(0, FRAMES - 1, shape)
    burst = np.where(rng.random((n_scenes, FRAMES + AGES)) < BURSTS, TIMES, 1.0) if world.bursts else None
    frames = birth[..., None] + np.arange(AGES)
    now = 1.0 if burst is None else np.take_along_axis(burst[:, None], frames, axis=2)[..., None]
    errors = np.zeros((*shape, AGES, 2))
    if world.white:
        errors += world.white * now * _noise(world.noise, errors.shape, rng)
    if world.walk:
        errors += world.walk * _summed(now * _noise(world.noise, errors.shape, rng))
    if world.drift:
        errors += world.drift * rng.normal(size=(*shape, 1, 2)) * np.arange(AGES)[:, None]
    if world.ar:
        errors += world.ar * _chain(world.phi, rng.normal(size=errors.shape))
    errors = of_scene[:, None, None, None] * of_track[..., None, None] * errors + world.bias
    errors[:, :, 0] = 0.0
    left = np.minimum(FRAMES - birth, AGES)
    life = _lives(world, errors / of_scene[:, None, None, None], rng)
    alive = np.arange(AGES) < np.minimum(life, left)[..., None]
    return Scenes(errors, alive, life < left, _outliers(n_scenes, rng), group, birth)


def _scales(scale: float, n_scenes: int, group: Array, rng: np.random.Generator) -> Array:
    if scale >= 2:
        return np.sqrt(scale / rng.chisquare(scale, n_scenes))
    common = rng.normal(size=n_scenes)[group]
    alone = rng.normal(size=n_scenes)
    shared = 0.9 if group.max() + 1 < n_scenes else 0.0
    return np.exp(scale * (np.sqrt(shared) * common + np.sqrt(1 - shared) * alone))


def _t_scales(freedom: float, shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """Of squared mean 1."""
    return np.sqrt((freedom - 2) / rng.chisquare(freedom, shape))


def _noise(freedom: float, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Of variance 1."""
    if np.isinf(freedom):
        return rng.normal(size=shape)
    return rng.standard_t(freedom, size=shape) / np.sqrt(freedom / (freedom - 2))


def _summed(steps: Array) -> Array:
    steps[:, :, 0] = 0.0
    return np.cumsum(steps, axis=2)


def _chain(phi: float, steps: Array) -> Array:
    values = np.zeros_like(steps)
    for age in range(1, AGES):
        values[:, :, age] = phi * values[:, :, age - 1] + np.sqrt(1 - phi**2) * steps[:, :, age]
    return values


def _lives(world: World, errors: Array, rng: np.random.Generator) -> Array:
    """Number of observations of each track, if its scene does not end."""
    n_scenes, tracks = errors.shape[:2]
    if world.lives == "equal":
        return np.full((n_scenes, tracks), AGES)
    hazard = np.full(n_scenes, HAZARD)
    if world.lives == "unequal":
        hazard = np.minimum(HAZARD * np.exp(0.5 * rng.normal(size=n_scenes)), 0.5)
    life = rng.geometric(hazard[:, None], (n_scenes, tracks)) + 1
    if world.lives == "lost":
        beyond = np.sqrt((errors**2).sum(axis=3)) > LOST * np.sqrt(2 * world.second(5))
        first = np.where(beyond.any(axis=2), beyond.argmax(axis=2), AGES)
        life = np.minimum(life, np.maximum(first, 2))
    return life


def _outliers(n_scenes: int, rng: np.random.Generator) -> Array:
    rate = OUTLIERS * np.exp(0.6 * rng.normal(size=(n_scenes, 1)))
    offered = rng.poisson(TRACKS, (n_scenes, FRAMES))
    by_frame = np.minimum(rate * rng.gamma(2.0, 0.5, offered.shape), 1.0)
    return np.stack([offered, rng.binomial(offered, by_frame)], axis=-1)
