"""How often a factor is said to matter, or not to, whose effect is known: worlds of scenes with effects of their own.

    python -m benchmarks.validity.dependence [--runs N] [--draws N] [--seed N] [--only WORLD]

Every scene has a bias and a scale of its own at all levels, another share of the features, and at each level something
of its own that wanders with age. Between the levels the curves differ by `effect`, relative to their middle, at the
oldest age. Printed is how often a world is said to have an effect above the margin of 10 % (yes), or below it (no), and
how often the interval misses the effect to either side. `plug-in` is how often the estimate itself is above the margin.
The verdicts are of a single question, so that no multiplicity is taken into account.

Two worlds have no bias: in `none` nothing is common to the levels' mean errors, so that their effect is 0 where they do
not differ, and infinite where they do (`own`, by a hundredth of what scenes vary by).
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from tracknoise.findings.factors.largest import largest
from tracknoise.findings.factors.paired import Levels, pair_curves

from tracknoise.findings.factors.rotation import rotations

MARGIN, LEVEL = 0.10, 0.95
STATISTICS = ("nu", "eta", "Phi", "central")


@dataclass(frozen=True)
class World:
    """What differs between levels, and how scenes scatter."""

    effect: float
    scenes: int
    levels: int = 2
    ages: int = 25
    bias: float = 0.5
    """Of the oldest age, relative to the scale of errors there."""
    scene_bias: float = 0.2
    scene_scale: float = 0.3
    """Standard deviations of the scenes' own bias and of the logarithm of their scale, the same at all levels."""
    wandering: bool = False
    """Whether a scene's own bias changes with age, or is the same at all."""
    own: float = 0.05
    """Standard deviation of what a scene has of its own at each level."""
    sizes: float = 0.5
    """Standard deviation of the logarithm of a scene's number of features."""
    memory: float = 0.95
    """Correlation of what is a level's own from one age to the next."""
    shape: str = "growing"
    """Of the curves: `growing` with the square root of age, or `flat`."""
    everywhere: bool = True
    """Whether the levels differ at every age and in both coordinates, or at the oldest age in u only."""
    unbiased_difference: float = 0.0
    """Constant difference of the mean error where there is no bias."""


def simulate(world: World, rng: np.random.Generator) -> Levels:
    """Sums of the scenes of one world."""
    age = np.arange(1, world.ages + 1)
    curve = np.sqrt(age / world.ages) if world.shape == "growing" else np.ones(world.ages)
    factor = np.ones((2, world.levels, world.ages))
    there = (slice(None), slice(None)) if world.everywhere else (0, -1)
    factor[:, 0][there], factor[:, -1][there] = 1 - world.effect / 2, 1 + world.effect / 2
    shape = (world.scenes, world.levels, world.ages)
    n = np.ceil(500 * np.exp(world.sizes * rng.standard_normal((world.scenes, 1, 1)) - age / world.ages) + 20)
    n = np.broadcast_to(n, shape)
    scale = np.exp(world.scene_scale * rng.standard_normal((world.scenes, 1, 1)) - world.scene_scale**2 / 2)
    columns = []
    for coordinate in range(2):
        of_scene = replace(world, levels=1, own=world.scene_bias, memory=world.memory if world.wandering else 1.0)
        away = _wander(of_scene, rng) + _wander(world, rng)
        apart = world.unbiased_difference * np.arange(world.levels)[:, None] * (coordinate == 0)
        mean = (world.bias * factor[coordinate] + away) * curve + apart
        absolute = (scale * (factor[coordinate] + _wander(world, rng))) * curve
        second = (scale**2 * (factor[coordinate] + _wander(world, rng))) * curve**2
        columns.append((mean, absolute, second))
    sums = np.stack([columns[c][kind] for kind in range(3) for c in range(2)], axis=-1) * n[..., None]
    return Levels(n.astype(np.float64), sums, np.ones((world.scenes, world.levels), dtype=np.bool_))


def _wander(world: World, rng: np.random.Generator) -> np.ndarray:
    """What is a level's own in each scene, with memory from age to age: (scenes, levels, ages)."""
    steps = rng.standard_normal((world.ages, world.scenes, world.levels))
    path = [steps[0]]
    for step in steps[1:]:
        path.append(world.memory * path[-1] + np.sqrt(1 - world.memory**2) * step)
    return world.own * np.moveaxis(np.stack(path), 0, -1)


def rates(world: World, *, runs: int, draws: int, seed: int) -> dict[str, tuple[float, ...]]:
    """For each statistic how often: yes, no, interval too high, too low, and plug-in above the margin."""
    rng = np.random.default_rng([seed, world.scenes, world.levels, world.ages])
    counts = {name: np.zeros(5) for name in STATISTICS}
    for run in range(runs):
        ratios = pair_curves(simulate(world, rng)).ratios
        directions = rotations(world.scenes, n_draws=draws, seed=seed + run)
        for name, points in zip(STATISTICS, ratios, strict=True):
            found = largest(points, directions, margin=MARGIN, level=LEVEL)
            true = _true(world, name)
            counts[name] += [
                found.low > MARGIN, found.high < MARGIN, found.low > true, found.high < true, found.effect > MARGIN
            ]  # fmt: skip
    return {name: tuple(count / runs) for name, count in counts.items()}


def _true(world: World, statistic: str) -> float:
    if statistic == "nu" and not world.bias:
        return float("inf") if world.unbiased_difference else 0.0
    if statistic != "central":
        return world.effect
    factors = (1 + world.effect / 2, 1 - world.effect / 2)
    a, b = (np.exp(world.scene_scale**2) * factor - (world.bias * factor) ** 2 for factor in factors)
    return abs(a - b) / ((a + b) / 2)


def worlds() -> Iterator[tuple[str, World]]:
    """What is tried."""
    for scenes in (6, 8, 11, 28, 60):
        for effect in (0.0, MARGIN, 0.3):
            yield "plain", World(effect, scenes)
    for scenes in (6, 11, 28):
        for levels in (5, 19):
            yield f"{levels} levels", World(0.0, scenes, levels=levels)
            yield f"{levels} levels", World(MARGIN, scenes, levels=levels)
    for scenes in (6, 11, 28):
        for effect in (0.0, MARGIN):
            yield "one place", World(effect, scenes, everywhere=False)
            yield "short memory", World(effect, scenes, memory=0.3)
            yield "flat", World(effect, scenes, shape="flat")
            yield "well paired", World(effect, scenes, own=0.005)
            yield "flat, well paired", World(effect, scenes, own=0.005, shape="flat", memory=0.3)
            yield "no scene effects", World(effect, scenes, own=0.1, scene_bias=0.0, scene_scale=0.0)
            yield "sizes", World(effect, scenes, sizes=1.2)
    for scenes in (6, 11, 28):
        nothing = World(0.0, scenes, bias=0.0)
        yield "none", nothing
        yield "none, own", replace(nothing, own=0.0005, unbiased_difference=0.002)
        for memory in (0.3, 0.95):
            wandering = World(0.0, scenes, memory=memory, wandering=True, shape="flat")
            yield "wandering", replace(wandering, effect=MARGIN)
            yield "none, wandering", replace(wandering, bias=0.0, own=0.0005, unbiased_difference=0.002)
            yield "wandering, well paired", replace(wandering, effect=MARGIN, own=0.0005)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="worlds of this name")
    arguments = parser.parse_args()
    columns = ("yes", "no", "too high", "too low", "plug-in")
    print(f"{'world':<24}{'scenes':>7}{'levels':>7}{'effect':>7}  {'':<8}" + "".join(f"{name:>9}" for name in columns))
    for name, world in worlds():
        if arguments.only is not None and name != arguments.only:
            continue
        found = rates(world, runs=arguments.runs, draws=arguments.draws, seed=arguments.seed)
        for statistic, values in found.items():
            start = f"{name:<24}{world.scenes:>7}{world.levels:>7}{_true(world, statistic):>7.2f}  {statistic:<8}"
            print(start + "".join(f"{value:>9.4f}" for value in values), flush=True)


if __name__ == "__main__":
    main()
