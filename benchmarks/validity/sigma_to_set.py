"""How often the interval of the sigma to set holds the one that is right for windows of such scenes.

    python -m benchmarks.validity.sigma_to_set [--runs N] [--scenes 6 8 12 28] [--worlds NAME ...] [--seed N]

Scenes are drawn from a population of `benchmarks.validity.sigma_worlds`: each has its own noise, motion, depths and
lengths of tracks, and one window is taken from each. Right is the root of the mean NEES of the newest pose, over other
windows of the whole population, of an estimator that assumes 1 px. Printed are the shares of 95 % intervals that hold
it, in brackets those that lie below it; the mean of the squared estimates over the square of the right one; and the
median ratio of upper and lower bounds.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from benchmarks.validity.sigma_worlds import FRAMES, WORLDS, World, scene, squared_sigma
from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators.components import COLUMNS, fit_components
from tracknoise.estimators.equivalents import MeanSquares
from tracknoise.estimators.linear_window import LinearTracks
from tracknoise.estimators.model import Interval, Purpose
from tracknoise.estimators.training import Windows, windows_of

LENGTH, WINDOWS = 11, 4
"""Frames of a window, and windows of each scene that the right sigma is of."""


@dataclass(frozen=True)
class Member:
    """A scene of a population: what a run knows of it, and its mean squared sigma, px^2; NaN without windows."""

    window: Sequence[LinearTracks] | None
    sums: pl.DataFrame
    square: float


def population(world: World, size: int, random: np.random.Generator) -> list[Member]:
    """Scenes, with what is right for each."""
    found = []
    for number in range(size):
        own, name = scene(world, random), f"{number:04}"
        starts = random.integers(0, FRAMES - LENGTH + 1, WINDOWS).tolist()
        squares = [one for start in starts if (one := squared_sigma(own, start, LENGTH)) is not None]
        square = float(np.mean(squares)) if squares else np.nan
        window = next(windows_of(own.recording(name), speed=1, length=LENGTH, count=1), None)
        found.append(Member(window, own.sums(name, random, world.nu), square))
    return found


def sigma_to_set(members: Sequence[Member]) -> Interval:
    """As a run of these scenes says."""
    names = [f"{place:02}" for place in range(len(members))]
    table = pl.concat([one.sums.with_columns(scene=pl.lit(name)) for name, one in zip(names, members, strict=True)])
    units = units_of(table.drop("block"), table, points=["product", "age"], columns=COLUMNS)
    known = [(one.window, name) for one, name in zip(members, names, strict=True) if one.window is not None]
    windows = Windows(*zip(*known, strict=True))
    mean = MeanSquares.of(fit_components(units, level=0.95), windows, 1)
    return mean.sigmas(None)[Purpose.NEWEST_POSE]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--scenes", type=int, nargs="+", default=[6, 8, 12, 28])
    parser.add_argument("--worlds", nargs="+", choices=WORLDS, default=list(WORLDS))
    parser.add_argument("--population", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for name in given.worlds:
        random = np.random.default_rng([given.seed, list(WORLDS).index(name)])
        members = population(WORLDS[name], given.population, random)
        right = float(np.sqrt(np.nanmean([one.square for one in members])))
        print(f"{name}: right is {right:.4f} px", flush=True)
        for n_scenes in given.scenes:
            chosen = [random.choice(len(members), n_scenes) for _ in range(given.runs)]
            found = [sigma_to_set([members[place] for place in places]) for places in chosen]
            low, high, value = (np.array([getattr(one, key) for one in found]) for key in ("low", "high", "value"))
            held, below = np.mean((low <= right) & (right <= high)), np.mean(high < right)
            bias, width = np.mean(value**2) / right**2, np.median(high / low)
            print(
                f"  {n_scenes:2} scenes {100 * held:5.1f} ({100 * below:.1f}), squares {bias:.3f}, width {width:.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
