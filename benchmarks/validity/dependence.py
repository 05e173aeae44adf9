"""How often a factor is said to change a statistic, or not to, where the truth is known.

    python -m benchmarks.validity.dependence [--runs N] [--draws N] [--seed N] [--only WORLD]

Printed is how often a single question is answered yes (p_yes <= 5 %) and no (p_no <= 2.5 %). A verdict is corrected for
all questions about its factor, six for one tracker. `1 of 6` is how often it is yes if nothing else has an effect, and
`3 of 6` if two other questions are answered as clearly, as those about sizes of errors mostly are. `t test` is how
often a plain paired t test of the log ratios (mean over ages and coordinates) finds a difference from 1, `covers` how
often the interval of the overall ratio holds the true ratio. The margin is a ratio of 1.1.

Worlds: `independent` and `shared` have scenes whose scales differ (log sd 0.7), at each level anew or at all levels
alike, and curves that wander with age. `crossing` has a ratio of 2 at young and of 1/2 at old ages; `one age` differs
at the last age only. `sizes` are errors of tracks in scenes of very unequal size, `lost` those of two trackers whose
errors have one distribution and whose tracks are lost at different rates: `gauss` independent, `t3` heavy-tailed,
`walk` random walks. Their statistics are second moment (2) and core (c). `hazards` and `mixture` are lifetimes with the
same hazards in sequences of different length; `outliers` are outlier ratios of unequal numbers of features.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import polars as pl
from scipy import stats

from tracknoise.analysis.factor_values import LEAST_FEATURES, lifetime_differences, outlier_differences
from tracknoise.analysis.factors import Question, answer
from tracknoise.inference.multiple_tests import rotations
from tracknoise.inference.paired_differences import Differences, differences
from tracknoise.inference.units import Resampled
from tracknoise.statistics.scales import PER_MEDIAN
from tracknoise.tables.schema import ENDS, FRAME_COUNTS

MARGIN, LEVEL, AGES = np.log(1.1), 0.95, 12
CORRECTED = {"3 of 6": 3 / 6, "1 of 6": 1 / 6}
"""By Benjamini and Hochberg: the share of 5 % that as many clear answers of six may have."""
Array = np.ndarray
Draw = Callable[[np.random.Generator], Differences]


@dataclass(frozen=True)
class World:
    """What is drawn, and the true log ratio of the last to the first level (None: there is none overall)."""

    name: str
    scenes: int
    levels: int
    ratio: float | None
    draw: Draw


def curves(scenes: int, levels: int, effect: Array, *, shared: bool, own: float = 0.1) -> Draw:
    """Log curves (scenes, levels, ages, 2) of which the last level differs by `effect`, (ages,) or a number."""

    def draw(rng: np.random.Generator) -> Differences:
        scale = 0.7 * rng.standard_normal((scenes, 1 if shared else levels, 1, 1))
        steps = own * rng.standard_normal((scenes, levels, AGES, 2))
        values = scale + 0.3 * np.cumsum(steps, axis=2) + steps
        values[:, -1] += np.broadcast_to(effect, AGES)[:, None]
        return differences(values.reshape(scenes, levels, -1), np.ones((scenes, levels), bool), logarithms=True)

    return draw


def tracks(scenes: int, features: Array, losses: tuple[float, float], kind: str, statistic: str) -> Draw:
    """Errors of tracks at two levels, lost at different rates, with one distribution; scenes differ (log sd 0.7)."""

    def draw(rng: np.random.Generator) -> Differences:
        values = np.full((scenes, 2, AGES, 2), np.nan)
        for scene in range(scenes):
            scale = np.exp(0.7 * rng.standard_normal())
            for level, loss in enumerate(losses):
                n = int(features[scene])
                life = rng.geometric(loss, n)
                noise = rng.standard_t(3, (n, AGES, 2)) if kind == "t3" else rng.standard_normal((n, AGES, 2))
                error = scale * (np.cumsum(noise, axis=1) if kind == "walk" else noise)
                for age in range(AGES):
                    values[scene, level, age] = _log(error[life > age, age], statistic)
        return differences(values.reshape(scenes, 2, -1), np.ones((scenes, 2), bool), logarithms=True)

    return draw


def _log(error: Array, statistic: str) -> Array | float:
    if len(error) < LEAST_FEATURES["core" if statistic == "c" else "second"]:
        return np.nan
    if statistic == "c":
        return np.log(PER_MEDIAN * np.median(np.abs(error), axis=0))
    return np.log((error**2).sum(axis=0) / (len(error) - 1))


def lifetimes(scenes: int, lengths: tuple[int, int], hazards: tuple[float, ...], factor: float = 1.0) -> Draw:
    """Tracks whose hazards are a mixture, alike at both levels but for a factor, in sequences of two lengths."""
    names = [f"s{scene:02}" for scene in range(scenes)]

    def draw(rng: np.random.Generator) -> Differences:
        columns: list[list[tuple[list[str], Array, Array, Array]]] = [[], []]
        for name in names:
            of_scene = np.exp(0.3 * rng.standard_normal())
            for level, length in enumerate(lengths):
                n = int(300 * np.exp(0.5 * rng.standard_normal()))
                own = np.exp(0.05 * rng.standard_normal()) * of_scene * (factor if level else 1.0)
                life = rng.geometric(np.minimum(rng.choice(hazards, n) * own, 0.9))
                at_most = rng.integers(1, length + 1, n)
                ended = np.bincount(life[life < at_most], minlength=length + 1)
                alive = np.bincount(at_most[life >= at_most], minlength=length + 1)
                there = np.flatnonzero(ended + alive)
                columns[level].append(([name] * len(there), there, ended[there], alive[there]))
        kinds = {column: ENDS[column] for column in ("scene", "lifetime", "n_ended", "n_censored")}
        tables = [[np.concatenate(column) for column in zip(*level, strict=True)] for level in columns]
        return lifetime_differences([pl.DataFrame(table, schema=[*kinds]).cast(kinds) for table in tables], names)

    return draw


def outliers(scenes: int, shares: tuple[float, float], offered: tuple[int, int]) -> Draw:
    """Counts of outliers that scatter from scene to scene (log sd 0.7, and 0.2 at each level)."""
    names = [f"s{scene:02}" for scene in range(scenes)]
    kinds = {column: FRAME_COUNTS[column] for column in ("scene", "offered", "outliers")}

    def draw(rng: np.random.Generator) -> Differences:
        scale = np.exp(0.7 * rng.standard_normal(scenes))
        tables = []
        for share, n in zip(shares, offered, strict=True):
            rate = np.minimum(share * scale * np.exp(0.2 * rng.standard_normal(scenes)), 0.9)
            counts = {"scene": names, "offered": [n] * scenes, "outliers": rng.binomial(n, rate)}
            tables.append(pl.DataFrame(counts).cast(kinds))
        return outlier_differences(tables, names)

    return draw


def rates(world: World, *, runs: int, draws: int, seed: int) -> dict[str, float]:
    """How often: yes (alone, and corrected), no, t test, and the interval of the overall ratio holds the true one."""
    rng = np.random.default_rng([seed, world.scenes, world.levels, *map(ord, world.name)])
    counts = np.zeros(7)
    for run in range(runs):
        asked = world.draw(rng)
        directions = rotations(world.scenes, n_draws=draws, seed=seed + run)
        question = Question(MARGIN, LEVEL, np.arange(world.scenes), Resampled.scenes, directions)
        found = answer(asked, question)
        if found is None:
            continue
        yes, no = found.p_yes <= 1 - LEVEL, found.p_no <= (1 - LEVEL) / 2
        overall = world.ratio is not None and found.point is None
        held = overall and found.low <= _signed(world, asked.pairs[found.pair]) <= found.high
        corrected = [found.p_yes <= (1 - LEVEL) * share for share in CORRECTED.values()]
        counts += [yes, no, _t_test(asked), overall, held, *corrected]
    return {
        "yes": counts[0] / runs,
        **dict(zip(CORRECTED, counts[5:] / runs, strict=True)),
        "no": counts[1] / runs,
        "t test": counts[2] / runs,
        "covers": counts[4] / counts[3] if counts[3] else np.nan,
    }


def _signed(world: World, pair: Array) -> float:
    """True difference of a pair of levels: the last level differs from all others, which are alike."""
    last = world.levels - 1
    return (world.ratio or 0.0) * (float(pair[0] == last) - float(pair[1] == last))


def _t_test(asked: Differences) -> bool:
    """Whether the first pair's log ratios, averaged over what each scene has, differ from 0."""
    values = asked.values[:, 0]
    known = values[~np.isnan(values).all(axis=1)]
    return len(known) > 2 and stats.ttest_1samp(np.nanmean(known, axis=1), 0.0).pvalue <= 1 - LEVEL


def worlds() -> Iterator[World]:
    """What is tried."""
    crossing = np.where(np.arange(AGES) < AGES / 2, np.log(2), -np.log(2))
    single = np.where(np.arange(AGES) == AGES - 1, np.log(2), 0.0)
    for scenes in (8, 11, 28):
        for name, shared in (("independent", False), ("shared", True)):
            for effect in (0.0, MARGIN, np.log(2), np.log(4)):
                yield World(name, scenes, 2, effect, curves(scenes, 2, effect, shared=shared))
        for effect in (0.0, MARGIN, np.log(2)):
            yield World("many levels", scenes, 10, effect, curves(scenes, 10, effect, shared=True))
        yield World("exact", scenes, 2, 0.0, curves(scenes, 2, 0.0, shared=True, own=0.01))
        yield World("exact", scenes, 2, MARGIN, curves(scenes, 2, MARGIN, shared=True, own=0.01))
        yield World("crossing", scenes, 2, None, curves(scenes, 2, crossing, shared=True))
        yield World("one age", scenes, 2, None, curves(scenes, 2, single, shared=True))
        unequal = np.geomspace(60, 2000, scenes)
        equal = np.full(scenes, 300)
        for statistic in "2c":
            yield World(f"sizes {statistic}", scenes, 2, 0.0, tracks(scenes, unequal, (0.05, 0.05), "walk", statistic))
            for kind in ("gauss", "t3", "walk"):
                lost = tracks(scenes, equal, (0.02, 0.2), kind, statistic)
                yield World(f"lost {kind} {statistic}", scenes, 2, 0.0, lost)
        yield World("hazards", scenes, 2, 0.0, lifetimes(scenes, (60, 15), (0.1,)))
        yield World("mixture", scenes, 2, 0.0, lifetimes(scenes, (120, 15), (0.3, 0.02)))
        yield World("hazards x 1.5", scenes, 2, None, lifetimes(scenes, (60, 60), (0.1,), 1.5))
        yield World("outliers", scenes, 2, 0.0, outliers(scenes, (0.01, 0.01), (300, 5000)))
        yield World("outliers x 2", scenes, 2, np.log(2), outliers(scenes, (0.01, 0.02), (5000, 5000)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=400)
    parser.add_argument("--draws", type=int, default=499)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="worlds of this name")
    arguments = parser.parse_args()
    columns = ("yes", *CORRECTED, "no", "t test", "covers")
    print(f"{'world':<16}{'scenes':>7}{'levels':>7}{'ratio':>7}" + "".join(f"{name:>9}" for name in columns))
    for world in worlds():
        if arguments.only is not None and world.name != arguments.only:
            continue
        found = rates(world, runs=arguments.runs, draws=arguments.draws, seed=arguments.seed)
        ratio = "" if world.ratio is None else f"{np.exp(world.ratio):.2f}"
        start = f"{world.name:<16}{world.scenes:>7}{world.levels:>7}{ratio:>7}"
        print(start + "".join(f"{found[name]:>9.3f}" for name in columns), flush=True)


if __name__ == "__main__":
    main()
