"""How often a factor is said to change a statistic, or not to, where the truth is known.

    python -m benchmarks.validity.dependence [--runs N] [--draws N] [--seed N] [--only WORLD]

The first table has one question at a time: how often it is answered yes (p_yes <= 5 %) and no (p_no <= 2.5 %) alone.
`verdict` and `none` are how often the row of the table says yes and no, where it is the core and the other five
questions have no effect and independent p-values. `t test` is how often a plain paired t test of the log ratios (mean
over ages and coordinates) finds a difference from 1, and `beyond` how often it finds one above the margin, at 5 %.
`covers` is how often the interval of the overall ratio holds the true ratio. The margin is a ratio of 1.1.

Worlds: `independent` and `shared` have scenes whose scales differ (log sd 0.7, or 0.35 in `half`), at each level anew
or at all levels alike, and curves that wander with age. `crossing` has a ratio of 2 at young and of 1/2 at old ages;
`one age` differs at the last age only. `sizes` are errors of tracks in scenes of very unequal size, `lost` those of
two trackers whose errors have one distribution and whose tracks are lost at different rates: `gauss` independent,
`t3` heavy-tailed, `walk` random walks. Their statistics are second moment (2) and core (c). `hazards` and `mixture`
are lifetimes with the same hazards in sequences of different length; `outliers` are outlier ratios of unequal numbers
of features.

The second table has all six questions about a factor (`--only family`), in one or several cells, such as trackers
whose speed is the factor. Every scene has scales of its own at each level (log sd as named, of second moments twice
that), Gaussian or with Student's distribution of 3 degrees of freedom (t3), correlated between statistics as in a run
of two trackers on 16 simulated scenes. `beyond` is as above, `alone` p_yes <= 5 %, `family` the same after the
correction in the family of a cell, and `verdict` what the table says. Where the true ratio is 1 or the margin, they
are false. `sizes`, `ends` and `others` are how often any answer yes in that family of the first cell is false.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import polars as pl

from tracknoise.analysis.factors import Row, family, judged
from tracknoise.analysis.paired_tests import Answer, Question, answer
from tracknoise.analysis.scene_values import LEAST_FEATURES, lifetime_differences, outlier_differences
from tracknoise.inference.multiple_tests import hochberg, in_families, rotations
from tracknoise.inference.paired_differences import Differences, average, best_of_few, differences
from tracknoise.inference.units import Resampled
from tracknoise.statistics.scales import PER_MEDIAN
from tracknoise.tables.schema import ENDS, FRAME_COUNTS

MARGIN, LEVEL, AGES = np.log(1.1), 0.95, 12
ROLES = ("mean", "absolute", "second", "core", "lifetime", "outlier_ratio")
CURVED = ROLES[:4]
CORRELATED = np.array(
    [
        [1.00, -0.48, -0.45, -0.34, 0.30, 0.12],
        [-0.48, 1.00, 0.95, 0.66, 0.09, -0.24],
        [-0.45, 0.95, 1.00, 0.49, 0.08, -0.26],
        [-0.34, 0.66, 0.49, 1.00, -0.08, -0.10],
        [0.30, 0.09, 0.08, -0.08, 1.00, -0.25],
        [0.12, -0.24, -0.26, -0.10, -0.25, 1.00],
    ]
)
"""Correlation over scenes of the differences between lucas-kanade and correspondence: two motions in eight worlds."""
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


def wandering(rng: np.random.Generator, shape: tuple[int, ...], own: float) -> Array:
    """What curves have of their own at each age and coordinate: (*shape, ages, 2)."""
    steps = own * rng.standard_normal((*shape, AGES, 2))
    return 0.3 * np.cumsum(steps, axis=-2) + steps


def curves(scenes: int, levels: int, effect: Array, *, shared: bool, own: float = 0.1, sd: float = 0.7) -> Draw:
    """Log curves (scenes, levels, ages, 2) of which the last level differs by `effect`, (ages,) or a number."""

    def draw(rng: np.random.Generator) -> Differences:
        values = sd * rng.standard_normal((scenes, 1 if shared else levels, 1, 1)) + wandering(
            rng, (scenes, levels), own
        )
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
    """How often each of `COLUMNS` is the case."""
    rng = np.random.default_rng([seed, world.scenes, world.levels, *map(ord, world.name)])
    counts, overall, rows = np.zeros(5), 0, []
    for run in range(runs):
        asked = world.draw(rng)
        question = _question(world.scenes, draws=draws, seed=seed + run)
        found = answer(asked, question)
        if found is None:
            continue
        yes, no = found.p_yes <= 1 - LEVEL, found.p_no <= (1 - LEVEL) / 2
        covers = world.ratio is not None and found.point is None
        held = covers and found.low <= _signed(world, asked.pairs[found.pair]) <= found.high
        counts += [yes, no, *_t_tests(asked, question), held]
        overall += covers
        for role in ROLES:
            tests = _tests(found) if role == "core" else {"p_yes": rng.uniform(), "p_no": 1.0}
            rows.append(_row(run, 0, role) | tests)
    verdicts = judged(rows, LEVEL).filter(statistic="core")["verdict"]
    said = [(verdicts == name).sum() / runs for name in ("yes", "no")]
    yes, no, differs, beyond, held = counts / runs
    covers = held * runs / overall if overall else np.nan
    return dict(zip(COLUMNS, (yes, said[0], no, said[1], differs, beyond, covers), strict=True))


COLUMNS = ("yes", "verdict", "no", "none", "t test", "beyond", "covers")


def _question(scenes: int, *, draws: int, seed: int, margin: float = MARGIN, cancels: bool = False) -> Question:
    directions = rotations(scenes, n_draws=draws, seed=seed)
    return Question(margin, LEVEL, np.arange(scenes), Resampled.scenes, directions, cancels=cancels)


def _row(run: int, cell: int, role: str) -> Row:
    """Columns of a row that say what it is about; every run is a dataset of its own."""
    return {"dataset": f"{run:05}", "factor": "speed", "tracker": f"tracker {cell}", "statistic": role, "gap": None}


def _tests(found: Answer) -> Row:
    return {name: getattr(found, name) for name in ("p_yes", "p_no", "low", "high")}


def _signed(world: World, pair: Array) -> float:
    """True difference of a pair of levels: the last level differs from all others, which are alike."""
    last = world.levels - 1
    return (world.ratio or 0.0) * (float(pair[0] == last) - float(pair[1] == last))


def _t_tests(asked: Differences, question: Question) -> tuple[bool, bool]:
    """Whether the first pair's differences, averaged over what each scene has, differ from 0, and exceed the margin."""
    values = asked.values[:, 0]
    known = values[~np.isnan(values).all(axis=1)]
    if len(known) < 3:
        return False, False
    found = average(np.nanmean(known, axis=1)[:, None], np.arange(len(known)), Resampled.scenes)
    p = [best_of_few(found, margin, question.directions).p for margin in (0.0, question.margin)]
    return p[0] <= 1 - LEVEL, p[1] <= 1 - LEVEL


def worlds() -> Iterator[World]:
    """What is tried."""
    crossing = np.where(np.arange(AGES) < AGES / 2, np.log(2), -np.log(2))
    single = np.where(np.arange(AGES) == AGES - 1, np.log(2), 0.0)
    for scenes in (8, 11, 28):
        for name, shared in (("independent", False), ("shared", True)):
            for effect in (0.0, MARGIN, np.log(2), np.log(4)):
                yield World(name, scenes, 2, effect, curves(scenes, 2, effect, shared=shared))
                if not shared:
                    half = curves(scenes, 2, effect, shared=False, sd=0.35)
                    yield World("half", scenes, 2, effect, half)
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


@dataclass(frozen=True)
class Factor:
    """All questions about a factor: true log ratios by role, in how many of the cells, and the scales of scenes."""

    name: str
    scenes: int
    sd: float
    ratios: dict[str, float]
    cells: int = 1
    changed: int = 1
    tails: str = "gauss"

    def draw(self, rng: np.random.Generator, cell: int) -> dict[str, Differences]:
        """Differences of one cell by role."""
        shape = (self.scenes, 2, len(ROLES))
        drawn = rng.standard_normal(shape)
        if self.tails == "t3":
            drawn *= np.sqrt(1 / rng.chisquare(3, shape[:2]))[..., None]
        own = self.sd * drawn @ np.linalg.cholesky(CORRELATED).T
        measured = np.ones(shape[:2], bool)
        found = {}
        for place, role in enumerate(ROLES):
            power = 2 if role == "second" else 1
            values = power * own[..., place, None, None]
            if role in CURVED:
                values = values + power * wandering(rng, shape[:2], 0.1)
            values[:, 1] += power * self.ratio(role, cell)
            values = 0.2 * values if role == "mean" else values
            found[role] = differences(values.reshape(*shape[:2], -1), measured, logarithms=role != "mean")
        return found

    def ratio(self, role: str, cell: int) -> float:
        """True log ratio, of which second moments have twice as much, or difference in units of 0.2 px."""
        return self.ratios.get(role, 0.0) if cell < self.changed else 0.0


def answers(world: Factor, *, runs: int, draws: int, seed: int) -> pl.DataFrame:
    """Table of the answers in all cells of all runs, with the columns `beyond`, `alone` and `family`."""
    rng = np.random.default_rng([seed, world.scenes, world.cells, *map(ord, world.name)])
    rows, beyond = [], []
    for run in range(runs):
        for cell in range(world.cells):
            for role, asked in world.draw(rng, cell).items():
                margin, cancels = (0.1, True) if role == "mean" else (MARGIN, False)
                question = _question(world.scenes, draws=draws, seed=seed + run, margin=margin, cancels=cancels)
                found = answer(asked, question)
                assert found is not None
                beyond.append(_t_tests(asked, question)[1])
                rows.append(_row(run, cell, role) | _tests(found))
    table = judged(rows, LEVEL).with_columns(beyond=pl.Series(beyond), alone=pl.col("p_yes") <= 1 - LEVEL)
    of = [f"{row['dataset']} {row['tracker']} {family(row['statistic'])}" for row in rows]
    in_family = in_families(hochberg, table["p_yes"], of) <= 1 - LEVEL
    return table.with_columns(
        pl.Series("family", in_family), yes=pl.col("verdict") == "yes", no=pl.col("verdict") == "no"
    )


def describe(world: Factor, table: pl.DataFrame) -> None:
    """Print a row for each question of the first cell, and how often a family has a false yes."""
    first = table.filter(tracker="tracker 0")
    of_cells = f", {world.changed} of {world.cells} cells change" if world.cells > 1 else ""
    print(f"\n{world.name}: {world.scenes} scenes, log sd {world.sd} ({world.tails}){of_cells}")
    names = ("beyond", "alone", "family", "yes", "no")
    print(f"{'':<16}{'ratio':>7}" + "".join(f"{name:>9}" for name in names))
    for role in ("core", "second", "lifetime", "outlier_ratio", "absolute", "mean"):
        shares = first.filter(statistic=role).select(pl.col(names).mean()).row(0)
        ratio = "" if role == "mean" else f"{np.exp(world.ratio(role, 0) * (2 if role == 'second' else 1)):.2f}"
        print(f"{role:<16}{ratio:>7}" + "".join(f"{share:>9.3f}" for share in shares), flush=True)
    margins = {role: MARGIN / 2 if role == "second" else 0.5 if role == "mean" else MARGIN for role in ROLES}
    unchanged = [role for role in ROLES if abs(world.ratio(role, 0)) <= margins[role]]
    false = first.filter(pl.col("statistic").is_in(unchanged)).with_columns(
        of=pl.col("statistic").map_elements(family, return_dtype=pl.String)
    )
    shares = (
        false.group_by("dataset", "of").agg(pl.col("yes").any()).group_by("of").agg(pl.col("yes").mean()).sort("of")
    )
    print("any false yes: " + ", ".join(f"{name} {share:.3f}" for name, share in shares.rows()) + ".")


def factors() -> Iterator[Factor]:
    """What is tried with all six questions."""
    sizes = ("core", "second", "absolute")
    larger = {
        "nothing": {},
        "margin": {**dict.fromkeys(ROLES, MARGIN), "second": MARGIN / 2, "mean": 0.5},
        "sizes": dict.fromkeys(sizes, np.log(2)),
        "core alone": {"core": np.log(2)},
        "lifetime": {"lifetime": np.log(2)},
        "bias": {"mean": 3.0},
        "everything": {**dict.fromkeys(ROLES, np.log(2)), "mean": 3.0},
    }
    for sd in (0.7, 0.35):
        for name, ratios in larger.items():
            yield Factor(name, 8, sd, ratios)
    for name in ("nothing", "margin", "sizes"):
        yield Factor(name, 8, 0.35, larger[name], tails="t3")
        yield Factor(name, 28, 0.35, larger[name])
    for changed in (0, 1, 4):
        yield Factor("sizes", 8, 0.35, larger["sizes"], cells=4, changed=changed)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=400)
    parser.add_argument("--draws", type=int, default=499)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="worlds of this name")
    arguments = parser.parse_args()
    print(f"{'world':<16}{'scenes':>7}{'levels':>7}{'ratio':>7}" + "".join(f"{name:>9}" for name in COLUMNS))
    options = {"runs": arguments.runs, "draws": arguments.draws, "seed": arguments.seed}
    for world in worlds():
        if arguments.only is not None and world.name != arguments.only:
            continue
        found = rates(world, **options)
        ratio = "" if world.ratio is None else f"{np.exp(world.ratio):.2f}"
        start = f"{world.name:<16}{world.scenes:>7}{world.levels:>7}{ratio:>7}"
        print(start + "".join(f"{found[name]:>9.3f}" for name in COLUMNS), flush=True)
    if arguments.only in (None, "family"):
        for factor in factors():
            describe(factor, answers(factor, **options))


if __name__ == "__main__":
    main()
