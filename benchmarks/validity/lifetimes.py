"""Lifetimes: which number depends on the length of sequences, and how often intervals hold the true value.

    python -m benchmarks.validity.lifetimes [--runs N] [--scenes 8 11 28] [--spread 0.4 0.7] [--seed N]

First table: half of the tracks end with a hazard of 0.3 per frame, half with 0.02. Tracks begin in any frame. They are
cut by the end of sequences of 120, 60, 30 and 15 frames. Shown are the mean lifetime, frames per end, and the mean
restricted to 15 frames. The last column is its standard error.

Second table: tracks are masked, or rejected as outliers, with hazards of their own in each scene. The logarithms of
both hazards differ between scenes with the stated standard deviation. Shown is how often 95 % intervals hold the value
of the population of scenes, and how often they lie above it and below.
"""

import argparse

import numpy as np

from tracknoise.analysis.lifetime_intervals import cumulative_incidence, survival, survival_until_failure
from tracknoise.inference.intervals import Sample
from tracknoise.inference.jackknife import student_interval
from tracknoise.inference.survival import area_under, restricted_mean

LENGTHS, HORIZON, HAZARDS = (120, 60, 30, 15), 15, (0.3, 0.02)
FRAMES, TRACKS, TO, AT = 40, 200, 20, 10
OUTLIER, MASKED = 0.05, 0.06
BATCH = 50
LIFETIMES = np.arange(1.0, FRAMES + 1)
_OUTLIERS, _MASKED = 2, 4
"""Place of the two causes among the columns censored, lost, outlier, displaced, masked."""


def by_length(rng: np.random.Generator, tracks: int) -> list[tuple[int, float, float, float, float]]:
    """Length, mean lifetime, frames per end, restricted mean and its standard error, for each length."""
    rows = []
    for length in LENGTHS:
        life = rng.geometric(np.where(rng.random(tracks) < 0.5, *HAZARDS))
        left = length - rng.integers(0, length, tracks)
        ended, found = life < left, np.minimum(life, left)
        counts = [np.bincount(found[part], minlength=length + 1)[1:] for part in (ended, ~ended)]
        per_end = (found.sum() - np.count_nonzero(~ended)) / np.count_nonzero(ended)
        halves = [restricted_mean(*np.array(parts), HORIZON) for parts in _parts(found, ended, length)]
        error = float(np.std(halves, ddof=1) / np.sqrt(len(halves)))
        rows.append((length, float(found.mean()), float(per_end), float(restricted_mean(*counts, HORIZON)), error))
    return rows


def _parts(found: np.ndarray, ended: np.ndarray, length: int, n: int = 20) -> list[list[np.ndarray]]:
    """Counts of n parts of the tracks."""
    of = np.arange(len(found)) % n
    return [
        [np.bincount(found[kind & (of == part)], minlength=length + 1)[1:] for kind in (ended, ~ended)]
        for part in range(n)
    ]


def simulate(rng: np.random.Generator, n_scenes: int, runs: int, spread: float) -> np.ndarray:
    """Counts by scene, (scenes, lifetimes * runs, 5): censored, lost, outlier, displaced, masked."""
    shape = (n_scenes, runs, 1)
    outlier, masked = (_hazards(rng, mean, shape, spread) for mean in (OUTLIER, MASKED))
    by_mask, by_test = (rng.geometric(hazard, (n_scenes, runs, TRACKS)) for hazard in (masked, outlier))
    left = FRAMES - rng.integers(0, FRAMES, by_mask.shape)
    life = np.minimum(np.minimum(by_mask, by_test), left)
    kind = np.where(life == left, 0, np.where(by_mask <= by_test, _MASKED, _OUTLIERS))  # masked tracks are not tested
    place = ((np.arange(n_scenes)[:, None, None] * FRAMES + life - 1) * runs + np.arange(runs)[:, None]) * 5 + kind
    counts = np.bincount(place.ravel(), minlength=n_scenes * FRAMES * runs * 5)
    return counts.reshape(n_scenes, FRAMES * runs, 5).astype(np.float64)


def _hazards(rng: np.random.Generator, mean: float, shape: tuple[int, ...], spread: float) -> np.ndarray:
    return np.minimum(mean * np.exp(spread * rng.normal(size=shape) - spread**2 / 2), 0.9)


def statistics(sums: np.ndarray) -> np.ndarray:
    """Statistics (5, ...) of counts (5, lifetimes, ...)."""
    ends = np.stack([sums[1:].sum(axis=0), sums[0], sums[1] + sums[2]])
    curves = [np.moveaxis(curve(ends)[0], 0, -1) for curve in (survival, survival_until_failure)]
    means = [area_under(curve, LIFETIMES, TO) / TO for curve in curves]  # as shares of the horizon
    incidence = cumulative_incidence(sums)
    return np.stack([*means, curves[0][..., AT - 1], incidence[1, AT - 1], incidence[3, AT - 1]])


NAMES = {
    f"mean restricted to {TO} frames": "logit",
    "the same until failure": "logit",
    f"survival beyond {AT}": "logit",
    f"incidence of outliers at {AT}": "logit",
    f"incidence of masking at {AT}": "logit",
}


def truth(spread: float) -> np.ndarray:
    """Values of the population of scenes: expected counts of very many, without censoring."""
    rng = np.random.default_rng(1)
    outlier, masked = (_hazards(rng, mean, (400_000,), spread) for mean in (OUTLIER, MASKED))
    sums = np.zeros((5, FRAMES))
    alive = np.ones_like(outlier)
    for place in range(FRAMES):
        sums[_MASKED, place] = np.mean(alive * masked)
        sums[_OUTLIERS, place] = np.mean(alive * (1 - masked) * outlier)
        alive *= (1 - masked) * (1 - outlier)
    sums[0, -1] = alive.mean()  # alive beyond the last lifetime
    return statistics(sums)


def coverage(rng: np.random.Generator, n_scenes: int, spread: float, runs: int) -> np.ndarray:
    """Shares of intervals that hold the true value, lie above it, and below, (5, 3)."""
    true, found = truth(spread), np.zeros((5, 3))
    for _ in range(batches := -(-runs // BATCH)):
        counts = simulate(rng, n_scenes, BATCH, spread)
        sample = Sample.of(counts, np.empty((0, n_scenes)), _by_run)
        sizes = counts.sum(axis=2).reshape(n_scenes, FRAMES, BATCH).sum(axis=1)
        for row, scale in enumerate(NAMES.values()):
            without = np.moveaxis(sample.without[row], -1, 0)
            low, high = student_interval(sample.whole[row], without, scale=scale, sizes=sizes)
            above, below = np.mean(low > true[row]), np.mean(high < true[row])
            found[row] += np.array([1 - above - below, above, below]) / batches
    return found


def _by_run(sums: np.ndarray) -> np.ndarray:
    return statistics(sums.reshape(5, FRAMES, BATCH, *sums.shape[2:]))


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--tracks", type=int, default=1_000_000, help="of the first table")
    parser.add_argument("--scenes", type=int, nargs="+", default=[8, 11, 28])
    parser.add_argument("--spread", type=float, nargs="+", default=[0.4, 0.7])
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    print(f"{'frames':>8}{'mean':>8}{'per end':>10}{'restricted':>12}{'error':>8}")
    for length, mean, per_end, restricted, error in by_length(rng, arguments.tracks):
        print(f"{length:>8}{mean:>8.2f}{per_end:>10.2f}{restricted:>12.3f}{error:>8.3f}")
    print(f"\n{arguments.runs} runs; held (above, below)")
    for spread in arguments.spread:
        for n_scenes in arguments.scenes:
            found = coverage(rng, n_scenes, spread, arguments.runs)
            for name, (held, above, below) in zip(NAMES, found, strict=True):
                where = f"log sd {spread}, {n_scenes:>2} scenes"
                print(f"{where}  {name:<32} {held:6.1%}  ({above:.1%}, {below:.1%})", flush=True)


if __name__ == "__main__":
    main()
