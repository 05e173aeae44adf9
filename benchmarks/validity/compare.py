"""How often a comparison of two runs says worse or better where nothing differs, and where a change is known.

    python -m benchmarks.validity.compare FIRST SECOND [--swaps N]     # two finished runs on the same scenes
    python -m benchmarks.validity.compare --seeds N --out FOLDER       # measures N runs with other seeds
    python -m benchmarks.validity.compare --edge N                     # made-up changes at the margin

The first form swaps both runs in each scene by chance. What is left of their differences is chance alone, as large as
the differences that they have. Printed is the share of such comparisons in which any statistic is worse or better, and
the verdicts without swaps. The second form compares every two of N runs of the same settings, which differ in their
random seed. The third draws changes whose true size is the margin, where a wrong claim is the most likely.
"""

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

from benchmarks.harness import Silent
from tracknoise.analysis.run_changes import Asked, Compared, Row, verdicts
from tracknoise.experiments.compare_runs import OpenedRun, compare, questions
from tracknoise.experiments.execute import execute
from tracknoise.experiments.settings import parse_experiment
from tracknoise.inference.paired_differences import differences
from tracknoise.tables.enumerations import ChangeVerdict
from tracknoise.tables.store import RunFolder
from tracknoise.topics.catalogue import ESTIMANDS

_CHANGED = (ChangeVerdict.worse, ChangeVerdict.better)
_SCENES, _STATISTICS, _AGES = 8, 12, 10
_EXPERIMENT = """
name = "seed {seed}"
seed = {seed}
keep = "statistics"
[dataset]
reader = "simulated"
[dataset.options]
motions = ["sideways", "fixating"]
worlds = 4
frames = 16
width = 160
height = 120
supersampling = 1
[[trackers]]
kind = "oracle"
options = {{ n_features = 80, outlier_rate = 0.02, loss_rate = 0.05 }}
[statistics]
min_features = 20
"""


def swapped(asked: Sequence[Asked], signs: dict[str, float]) -> list[Asked]:
    """The same with both runs swapped in the scenes whose sign is -1."""
    found = []
    for one in asked:
        sign = np.array([signs[name] for name in one.scenes])[:, None, None]
        found.append(replace(one, values=replace(one.values, values=sign * one.values.values)))
    return found


def swaps(first: Path, second: Path, *, runs: int, margin: float, seed: int) -> None:
    """Print how often anything is said to have changed where both runs are swapped by chance."""
    opened = [OpenedRun.of(RunFolder(path), path.name) for path in (first, second)]
    asked = questions(opened[0], opened[1], None).asked
    describe("without swaps", verdicts(asked, margin=margin))
    names = sorted({name for one in asked for name in one.scenes})
    rng = np.random.default_rng(seed)
    wrong = 0
    for _ in range(runs):
        signs = dict(zip(names, rng.choice([-1.0, 1.0], len(names)), strict=True))
        wrong += any(row.verdict in _CHANGED for row in verdicts(swapped(asked, signs), margin=margin))
    print(f"swapped by chance: worse or better in {wrong} of {runs} comparisons ({wrong / runs:.1%})")


def describe(title: str, rows: Sequence[Row]) -> None:
    """Print how often each verdict occurs."""
    counts = Counter(str(row.verdict) for row in rows)
    print(f"{title}: " + ", ".join(f"{name} {count}" for name, count in sorted(counts.items())))


def seeds(count: int, out: Path) -> None:
    """Measure runs with other seeds, and compare every two of them."""
    for seed in range(count):
        run = RunFolder(out / f"seed-{seed}")
        if not run.exists:
            execute(parse_experiment(_EXPERIMENT.format(seed=seed), place="benchmark"), run, listener=Silent())
            print(f"measured seed {seed}", flush=True)
    pairs = list(combinations(range(count), 2))
    found = [compare(out / f"seed-{a}", out / f"seed-{b}").rows for a, b in pairs]
    wrong = sum(any(row.verdict in _CHANGED for row in rows) for rows in found)
    describe("verdicts", [row for rows in found for row in rows])
    print(f"other seeds: worse or better in {wrong} of {len(pairs)} comparisons ({wrong / len(pairs):.1%})")


def edge(runs: int, *, margin: float, seed: int) -> None:
    """Print how often a change of exactly the margin is said to be larger, or to be none."""
    rng = np.random.default_rng(seed)
    of = Compared("second", "made-up", "made-up", "made-up", "default", 0, "forward", "", 1)
    names, wrong = [f"scene-{number}" for number in range(_SCENES)], Counter[str]()
    for _ in range(runs):
        asked = []
        for _ in range(_STATISTICS):
            noise = 0.1 * rng.standard_normal((_SCENES, 1)) + 0.05 * rng.standard_normal((_SCENES, _AGES))
            levels = np.stack([np.log1p(margin) + noise, np.zeros_like(noise)], axis=1)
            measured, places = np.ones(levels.shape[:2], dtype=np.bool_), np.arange(1, _AGES + 1)
            values = differences(levels, measured, logarithms=True, places=places)
            asked.append(Asked(of, ESTIMANDS["core"], values, names, np.arange(_SCENES), "age"))
        rows = verdicts(asked, margin=margin)
        wrong["changed"] += any(row.verdict in _CHANGED for row in rows)
        wrong["none"] += any(row.verdict == ChangeVerdict.none for row in rows)
    for name, count in wrong.items():
        print(f"at the margin, {_STATISTICS} statistics: {name} in {count} of {runs} comparisons ({count / runs:.1%})")


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="*", type=Path, help="two finished runs")
    parser.add_argument("--swaps", type=int, default=400)
    parser.add_argument("--margin", type=float, default=0.1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seeds", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("runs/compare-seeds"))
    parser.add_argument("--edge", type=int, default=0)
    arguments = parser.parse_args()
    if arguments.runs:
        first, second = arguments.runs
        swaps(first, second, runs=arguments.swaps, margin=arguments.margin, seed=arguments.seed)
    if arguments.seeds:
        seeds(arguments.seeds, arguments.out)
    if arguments.edge:
        edge(arguments.edge, margin=arguments.margin, seed=arguments.seed)


if __name__ == "__main__":
    main()
