"""How often a 95 % interval holds the true value, by statistic, number of scenes and kind of interval.

    python -m benchmarks.validity.intervals [--scenes 8 11 28 60] [--runs N] [--spread mild|strong] [--seed N]

Simulated are tracks whose errors walk at random from birth on, in scenes that differ: each has its own bias, scale of
errors, hazard of losing a track, rate of outliers (which differs from frame to frame, too) and number of tracks. What
is true is known: it is that of a whole population of scenes. Tracks are born all along the sequence, and cut by its
end. Beside the share of intervals that hold the true value stand the shares that lie above it and below.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import polars as pl

from tracknoise.analysis.curve_intervals import curve_statistics
from tracknoise.analysis.lifetime_intervals import first_reached, survival
from tracknoise.analysis.scene_spread import Parts, with_biases
from tracknoise.inference.bootstrap import N_DRAWS, draws, interval
from tracknoise.inference.conventions import LEVEL, IntervalKind
from tracknoise.inference.estimates import EstimateArray
from tracknoise.inference.intervals import Sample
from tracknoise.inference.jackknife import acceleration, student_interval
from tracknoise.inference.units import Resampled, Units
from tracknoise.tables.enumerations import Weighting

AGE, FRAMES, TRACKS = 15, 40, 200
HAZARD, STEP_PX, BIAS_PX, OUTLIERS = 0.06, 0.1, 0.2, 0.03
SURVIVES = 10
"""Lifetime beyond which survival is looked at."""
SECOND = 4
"""Row of the second moment of u in `curve_statistics`."""
BATCH = 20
"""Runs that share their draws."""
PLAIN = 10**9
"""So many units want no expansion."""
KINDS = ("plain percentile", "percentile", "bca", "student")
"""The first is the bootstrap of a textbook, without expansion for few units."""


@dataclass(frozen=True)
class Spread:
    """How much scenes differ: standard deviations of the bias, px, and of the logarithms of the others."""

    bias_px: float
    scale: float
    hazard: float
    outliers: float
    tracks: float


SPREADS = {
    "mild": Spread(bias_px=0.15, scale=0.2, hazard=0.2, outliers=0.3, tracks=0.2),
    "strong": Spread(bias_px=0.3, scale=0.4, hazard=0.4, outliers=0.6, tracks=0.4),
}


@dataclass(frozen=True)
class Sums:
    """Of every scene: errors at an age, (scenes, 8), ends, (scenes, lifetimes, 2), and outliers, (scenes, 2)."""

    errors: np.ndarray
    ends: np.ndarray
    outliers: np.ndarray


def simulate(rng: np.random.Generator, n_scenes: int, spread: Spread) -> Sums:
    """Scenes of tracks, and their sums."""
    bias, scale, hazard, rate, size = _scenes(rng, n_scenes, spread)
    there = np.arange(2 * TRACKS) < _tracks(size)[:, None]
    life = rng.geometric(hazard[:, None], there.shape)
    left = FRAMES - rng.integers(0, FRAMES, there.shape)
    alive = there & (np.minimum(life, left) > AGE)
    walk = STEP_PX * rng.normal(size=(np.count_nonzero(alive), AGE, 2)).sum(axis=1)
    scene = np.nonzero(alive)[0]
    u, v = (scale[scene, None] * walk + bias[scene, None]).T
    values = [np.ones(len(u)), u, v, u * u, u * v, v * v, np.abs(u), np.abs(v)]
    errors = np.stack([np.bincount(scene, value, n_scenes) for value in values], axis=-1)
    return Sums(errors, _ends(there, life, left), _outliers(rng, rate, size))


def _scenes(rng: np.random.Generator, n_scenes: int, spread: Spread) -> np.ndarray:
    """Bias, scale, hazard, rate of outliers, and number of tracks relative to the usual one, (5, scenes)."""
    normal = rng.normal(size=(5, n_scenes))
    bias = BIAS_PX + spread.bias_px * normal[0]
    factors = np.exp(np.array([spread.scale, spread.hazard, spread.outliers, spread.tracks])[:, None] * normal[1:])
    return np.stack([bias, factors[0], np.minimum(HAZARD * factors[1], 0.9), OUTLIERS * factors[2], factors[3]])


def _tracks(size: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(TRACKS * size), 5, 2 * TRACKS)


def _ends(there: np.ndarray, life: np.ndarray, left: np.ndarray) -> np.ndarray:
    place = np.arange(len(there))[:, None] * (FRAMES + 1) + np.minimum(life, left)
    ends = (there & (life < left), there & (life >= left))
    counts = [np.bincount(place[chosen], minlength=len(there) * (FRAMES + 1)) for chosen in ends]
    return np.stack(counts, axis=-1).reshape(len(there), FRAMES + 1, 2)[:, 1:].astype(np.float64)


def _outliers(rng: np.random.Generator, rate: np.ndarray, size: np.ndarray) -> np.ndarray:
    offered = rng.poisson(TRACKS * size[:, None], (len(rate), FRAMES))
    by_frame = np.minimum(rate[:, None] * rng.gamma(2.0, 0.5, offered.shape), 1.0)
    return np.stack([offered.sum(axis=1), rng.binomial(offered, by_frame).sum(axis=1)], axis=-1).astype(np.float64)


def truth(spread: Spread) -> dict[str, float]:
    """True values over a population of scenes."""
    _, _, hazard, _, size = _scenes(np.random.default_rng(1), 400_000, spread)
    lives = [np.average((1 - hazard) ** life, weights=_tracks(size)) for life in range(1, FRAMES + 1)]
    second = BIAS_PX**2 + spread.bias_px**2 + np.exp(2 * spread.scale**2) * STEP_PX**2 * AGE
    return {
        "mean": BIAS_PX,
        "second moment": second,
        "mean, scenes": BIAS_PX,
        "second moment, scenes": second,
        "outlier ratio": OUTLIERS * np.exp(spread.outliers**2 / 2),
        "median lifetime": first_reached(np.array(lives), np.arange(1.0, FRAMES + 1), 0.5),
        "survival": lives[SURVIVES - 1],
    }


@dataclass(frozen=True)
class Statistic:
    """Values of all runs, (1 or lifetimes, runs), their scale, and how much each scene holds, (scenes, 1, runs).

    Of second moments, also the sums of each scene and the weighting.
    """

    values: Sample
    scale: str
    sizes: np.ndarray
    biased: tuple[Units, Weighting] | None = None


def statistics(sums: Sums, weights: np.ndarray) -> Iterator[tuple[str, Statistic]]:
    """Every statistic by its name."""
    units = weights.shape[1]
    errors, outliers = sums.errors.reshape(units, -1, 8), sums.outliers.reshape(units, -1, 2)
    own = curve_statistics(errors.transpose(2, 1, 0))
    names = tuple(f"{unit:03}" for unit in range(units))
    every = Units(errors, pl.DataFrame({"run": range(errors.shape[1])}), names, np.arange(units), Resampled.scenes)
    for name, row, scale in (("mean", 0, "linear"), ("second moment", SECOND, "log")):
        pooled = Sample.of(errors, weights, lambda total, row=row: curve_statistics(total)[[row]])
        by = {weighting: (every, weighting) for weighting in Weighting} if row == SECOND else {}
        yield name, Statistic(pooled, scale, errors[:, None, :, 0], by.get(Weighting.features))
        counted = np.stack([np.nan_to_num(own[row]), ~np.isnan(own[row])]).transpose(2, 1, 0)
        alike = Sample.of(counted, weights, _ratio)
        yield f"{name}, scenes", Statistic(alike, scale, counted[:, None, :, 1], by.get(Weighting.scenes))
    ratio = Sample.of(outliers[..., ::-1], weights, _ratio)
    yield "outlier ratio", Statistic(ratio, "logit", outliers[:, None, :, 0])
    runs = errors.shape[1]
    ends = sums.ends.reshape(units, runs, FRAMES, 2).swapaxes(1, 2).reshape(units, FRAMES * runs, 2)
    tracks = sums.ends.sum(axis=(1, 2)).reshape(units, 1, runs)
    yield "survival", Statistic(Sample.of(ends, weights, partial(_survival, runs=runs)), "logit", tracks)


def _ratio(total: np.ndarray) -> np.ndarray:
    return total[:1] / total[1:]


def _survival(sums: np.ndarray, *, runs: int) -> np.ndarray:
    return survival(sums.reshape(2, FRAMES, runs, *sums.shape[2:]))[0]


def bounded(kind: str, statistic: Statistic, n_scenes: int) -> tuple[np.ndarray, np.ndarray]:
    """Low and high of a kind of interval."""
    sample = statistic.values
    drawn, without = np.moveaxis(sample.drawn, -1, 0), np.moveaxis(sample.without, -1, 0)
    if kind == "student":
        bounds = student_interval(sample.whole, without, scale=statistic.scale, sizes=statistic.sizes)
        return bounds if statistic.biased is None else _biased(sample.whole, bounds, *statistic.biased)
    n_units = PLAIN if kind == "plain percentile" else n_scenes
    made, grows = kind.removeprefix("plain "), acceleration(without)
    return interval(sample.whole, drawn, kind=made, n_units=n_units, acceleration=grows)


def _biased(
    value: np.ndarray, bounds: tuple[np.ndarray, np.ndarray], units: Units, weighting: Weighting
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of second moments of u over scenes with biases."""
    both = [np.repeat(array, 2, axis=0) for array in (value, *bounds)]
    count = np.full(both[0].shape, len(units.sums))
    estimates = EstimateArray(*both, count, count, IntervalKind.student, LEVEL)
    found = with_biases(units, Parts.of(units, weighting), estimates, [0, 1])
    return found.low[:1], found.high[:1]


def coverage(
    n_scenes: int, *, runs: int, spread: Spread, seed: int, kinds: Sequence[str] = KINDS
) -> dict[tuple[str, str], np.ndarray]:
    """Of every kind and statistic: shares of intervals that hold the true value, lie above it, and below."""
    rng, true = np.random.default_rng(seed), truth(spread)
    n_draws = N_DRAWS if set(kinds) != {"student"} else 0
    counts = {(kind, name): np.zeros(3) for kind in kinds for name in true}
    batches = -(-runs // BATCH)
    for batch in range(batches):
        sums = simulate(rng, n_scenes * BATCH, spread)
        weights = draws(n_scenes, n_draws=n_draws, seed=batch)
        for name, statistic in statistics(sums, weights):
            for kind in kinds:
                for called, low, high in _read(name, *bounded(kind, statistic, n_scenes)):
                    above, below = np.mean(low > true[called]), np.mean(high < true[called])
                    counts[kind, called] += np.array([1 - above - below, above, below]) / batches
    return counts


def _read(name: str, low: np.ndarray, high: np.ndarray) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Bounds (runs,) of a statistic; of survival, at one lifetime, and those of the median lifetime."""
    if name != "survival":
        return [(name, low[0], high[0])]
    lifetimes = np.arange(1.0, FRAMES + 1)
    medians = [np.array([first_reached(curve, lifetimes, 0.5) for curve in bound.T]) for bound in (low, high)]
    return [(name, low[SURVIVES - 1], high[SURVIVES - 1]), ("median lifetime", medians[0], medians[1])]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, nargs="+", default=[6, 8, 11, 28, 60])
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--spread", choices=SPREADS, default="mild")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    options = {"runs": arguments.runs, "spread": SPREADS[arguments.spread], "seed": arguments.seed}
    print(f"{arguments.runs} runs, level {LEVEL:.0%}, scenes differ: {arguments.spread}; held (above, below)")
    for n_scenes in arguments.scenes:
        found = coverage(n_scenes, kinds=arguments.kinds, **options)
        for (kind, name), (held, above, below) in found.items():
            print(f"{n_scenes:>4} scenes  {kind:<17} {name:<22} {held:6.1%}  ({above:.1%}, {below:.1%})", flush=True)


if __name__ == "__main__":
    main()
