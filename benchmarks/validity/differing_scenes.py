"""How often intervals hold the true value when scenes differ much, have unequal sizes, or come in groups.

    python -m benchmarks.validity.differing_scenes [--runs N] [--scenes 8 11 28] [--seed N]

In every scene errors are Gaussian with a scale and a bias of its own. Worlds:

- log sd S: the scale is lognormal; its logarithm has the standard deviation S, that of second moments twice as much.
- unequal: the same with S = 0.7, and numbers of tracks whose logarithm has a standard deviation of 0.8.
- biases: Gaussian, or Student's t with 3 or 5 degrees of freedom, of standard deviation 0.3 px; the scale is 0.1 px, or
  0.3 px where it says wide.
- groups: S = 0.7, and the correlation of log scales and of biases within a group is .9 or .5. The next scene is of
  another group, or of one of these if they are fewer than six. `ignored` takes the scenes for independent.

Printed are the shares of 95 % intervals that hold the true value: of the mean and the second moment by weighting
(features, scenes), of the geometric mean of second moments, and of the prediction for the next scene, for its second
moment and for its mean. With scenes resampled within groups, the truth is that of these groups.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from tracknoise.analysis.curve_intervals import curve_logarithms, curve_statistics
from tracknoise.analysis.scene_spread import Parts, with_biases
from tracknoise.inference.intervals import Method, averaged, geometric, pooled
from tracknoise.inference.next_scene import next_scene
from tracknoise.inference.units import MIN_SCENES, Resampled, Units, scheme
from tracknoise.tables.enumerations import Weighting

TRACKS, BIAS_PX = 150, 0.3
MEAN, SECOND = 0, 4
SCALES = ["linear"] * 4 + ["log"] + ["linear"] * 5
COLUMNS = (
    *("mean, features", "mean, scenes", "second, features", "second, scenes", "second, geometric"),
    *("next scene", "next mean"),
)


@dataclass(frozen=True)
class World:
    """Standard deviations between scenes of log scales, biases (px) and log numbers of tracks, and groups of scenes."""

    log_scale: float = 0.0
    bias_px: float = BIAS_PX
    freedom: float = np.inf
    scale_px: float = 1.0
    tracks: float = 0.3
    groups: int | None = None
    correlation: float = 0.0
    ignored: bool = False


WORLDS = {
    **{f"log sd {sd}": World(sd, 0.0) for sd in (0.0, 0.2, 0.4, 0.7, 1.1)},
    "unequal": World(0.7, 0.0, tracks=0.8),
    "Gaussian biases": World(scale_px=0.1),
    "t5 biases": World(scale_px=0.1, freedom=5),
    "t3 biases": World(scale_px=0.1, freedom=3),
    "Gaussian biases, wide": World(scale_px=0.3),
    "t3 biases, wide": World(scale_px=0.3, freedom=3),
}
GROUPED = {
    (8, 4): (0.9, 0.5),
    (11, 4): (0.9,),
    (28, 14): (0.9, 0.5),
    (28, 4): (0.9,),
}


@dataclass(frozen=True)
class Runs:
    """Sums of many runs, and true values: of the mean, and of arithmetic and geometric means of second moments."""

    units: Units
    mean: np.ndarray
    second: np.ndarray
    geometric: np.ndarray
    next_second: np.ndarray
    next_mean: np.ndarray


def simulate(rng: np.random.Generator, n_scenes: int, world: World, runs: int) -> Runs:
    """Scenes of a world, each run a point of one condition."""
    group = np.arange(n_scenes + 1) % (world.groups or n_scenes + 1)
    group[-1] = rng.integers(world.groups) if world.groups and world.groups < MIN_SCENES else group.max() + 1
    common, own = (np.sqrt(part) for part in (world.correlation, 1 - world.correlation))
    shape = (n_scenes + 1, runs)  # the last is the next scene
    shared = rng.normal(size=(group.max() + 1, runs)), rng.normal(size=(group.max() + 1, runs))
    log_scale = world.log_scale * (common * shared[0][group] + own * rng.normal(size=shape))
    bias = world.bias_px * (common * shared[1][group] + own * _standard(rng, shape, world.freedom))
    tracks = np.clip(np.rint(TRACKS * np.exp(world.tracks * rng.normal(size=shape))), 10, None)
    sums, second = _sums(rng, bias, world.scale_px * np.exp(log_scale), tracks)
    units = _units(sums[:n_scenes], group[:n_scenes], world)
    if units.resampled != Resampled.within:
        shared = np.zeros((1, 1)), np.zeros((1, 1))
        left = 1.0
    else:
        shared, left = tuple(part[group[:n_scenes]] for part in shared), 1 - world.correlation
    middle = world.log_scale * common * shared[0]
    variance = 2 * world.log_scale**2 * left
    biases = np.mean((world.bias_px * common * shared[1]) ** 2, axis=0) + world.bias_px**2 * left
    return Runs(
        units,
        np.mean(world.bias_px * common * shared[1], axis=0),
        biases + world.scale_px**2 * np.mean(np.exp(2 * middle), axis=0) * np.exp(variance),
        world.scale_px**2 * np.exp(2 * np.mean(middle, axis=0)),
        second[n_scenes],
        sums[n_scenes, :, 1] / sums[n_scenes, :, 0],
    )


def _standard(rng: np.random.Generator, shape: tuple[int, int], freedom: float) -> np.ndarray:
    """Values of variance 1."""
    if np.isinf(freedom):
        return rng.normal(size=shape)
    return rng.standard_t(freedom, size=shape) / np.sqrt(freedom / (freedom - 2))


def _sums(
    rng: np.random.Generator, bias: np.ndarray, scale: np.ndarray, tracks: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Sums of each scene, (scenes, runs, 8), whose u has the bias and the scale, and second moments of u."""
    mean = bias + scale * rng.normal(size=bias.shape) / np.sqrt(tracks)
    second = mean**2 + scale**2 * rng.chisquare(tracks - 1) / tracks
    zero = np.zeros_like(mean)
    return tracks[..., None] * np.stack([zero + 1, mean, zero, second, zero, second, zero, zero], axis=-1), second


def _units(sums: np.ndarray, group: np.ndarray, world: World) -> Units:
    alone = np.arange(len(group))
    used = alone if world.ignored or world.groups is None else group
    points = pl.DataFrame({"run": range(sums.shape[1])})
    scenes = tuple(f"{place:02d}" for place in alone)
    return Units(sums, points, scenes, alone, scheme(used), used)


def coverage(n_scenes: int, world: World, *, runs: int, seed: int) -> Iterator[tuple[str, float]]:
    """Share of intervals that hold the true value, by what they are of."""
    simulated = simulate(np.random.default_rng(seed), n_scenes, world, runs)
    units, method, none = simulated.units, Method(), np.empty((0, n_scenes))
    for name, estimated in (("features", pooled), ("scenes", averaged)):
        found = estimated(units, none, curve_statistics, method, scales=SCALES)
        found = with_biases(units, Parts.of(units, Weighting(name)), found, [SECOND, SECOND + 1])
        yield f"mean, {name}", _held(found.low[MEAN], found.high[MEAN], simulated.mean)
        yield f"second, {name}", _held(found.low[SECOND], found.high[SECOND], simulated.second)
    if world.bias_px == 0 or world.groups:  # otherwise the geometric mean is not known in closed form
        unbiased = replace(units, sums=units.sums.copy())
        n, u = unbiased.sums[..., 0], unbiased.sums[..., 1]
        unbiased.sums[..., 3] = (unbiased.sums[..., 3] - u**2 / n) * n / (n - 1)
        found = geometric(unbiased, none, _log_second, method)
        yield "second, geometric", _held(found.low[0], found.high[0], simulated.geometric)
    own = curve_statistics(np.transpose(units.sums, (2, 1, 0)))[[SECOND, MEAN]]
    ahead = next_scene(units, own, ["log", "linear"], level=method.level)
    if not np.isnan(ahead.low).all():
        yield "next scene", _held(ahead.low[0], ahead.high[0], simulated.next_second)
        yield "next mean", _held(ahead.low[1], ahead.high[1], simulated.next_mean)


def _log_second(sums: np.ndarray) -> np.ndarray:
    return curve_logarithms(sums)[[2]]


def _held(low: np.ndarray, high: np.ndarray, true: np.ndarray) -> float:
    return float(np.mean((low <= true) & ~(high < true)))


def cases(scenes: Sequence[int]) -> Iterator[tuple[int, str, World]]:
    """Numbers of scenes, and worlds by their names."""
    for n_scenes in scenes:
        yield from ((n_scenes, name, world) for name, world in WORLDS.items())
        for (count, groups), correlations in GROUPED.items():
            for correlation in correlations if count == n_scenes else ():
                world = World(0.7, groups=groups, correlation=correlation)
                yield n_scenes, f"{groups} groups, {correlation}", world
                yield n_scenes, f"{groups} groups, {correlation}, ignored", replace(world, ignored=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, nargs="+", default=[8, 11, 28])
    parser.add_argument("--runs", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    print(f"{'scenes':>6} {'world':<24}", *(f"{name:>17}" for name in COLUMNS))
    for n_scenes, name, world in cases(arguments.scenes):
        held = dict(coverage(n_scenes, world, runs=arguments.runs, seed=arguments.seed))
        shown = (f"{100 * held[column]:16.1f}%" if column in held else f"{'':17}" for column in COLUMNS)
        print(f"{n_scenes:>6} {name:<24}", *shown, flush=True)


if __name__ == "__main__":
    main()
