"""How often ``tracknoise selfcheck`` fails by chance, and how often intervals of whole runs contain the expected value.

    python -m benchmarks.validity.selfcheck [--seeds N] [--scenes N]

One run per seed, with its own worlds, paths and errors. A correct program has numbers off in one run of 1000, and
95 of 100 intervals contain the expected value.
"""

import argparse
import tempfile
from pathlib import Path

import polars as pl

from tracknoise.experiments.running.execute import execute
from tracknoise.experiments.validation.selfcheck import compare, judge, selfcheck_experiment
from tracknoise.tables.store import RunFolder


class Silence:
    """Ignores the progress of a run."""

    def planned(self, *what): ...
    def frame(self, *what): ...
    def measured(self, *what): ...
    def failed(self, *what): ...
    def remark(self, *what): ...


def comparison(seed: int, scenes: int) -> pl.DataFrame:
    """Comparison of one run."""
    with tempfile.TemporaryDirectory() as folder:
        run = RunFolder(Path(folder) / "run")
        execute(selfcheck_experiment(scenes=scenes, seed=seed), run, listener=Silence())
        return compare(run).with_columns(seed=pl.lit(seed))


def main() -> None:
    """Print one line per seed, then shares by statistic."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--scenes", type=int, default=12)
    arguments = parser.parse_args()
    tables = []
    for seed in range(arguments.seeds):
        tables.append(comparison(seed, arguments.scenes))
        verdict = judge(tables[-1].drop("seed"))
        result = "passed" if verdict.passes else "FAILED"
        print(
            f"seed {seed}: {verdict.n_off} of {verdict.n_numbers} off; {verdict.n_within} of {verdict.n_intervals} "
            f"within, at least {verdict.n_least} required: {result}",
            flush=True,
        )
    every = pl.concat(tables).with_columns(z=(pl.col("measured") - pl.col("expected")) / pl.col("standard_error"))
    print(f"{'statistic':<14}{'numbers':>9}{'rms z':>8}{'max |z|':>9}{'coverage':>10}")
    for (name,), rows in every.group_by("statistic", maintain_order=True):
        covered = rows["within"].mean()
        rms, largest = (rows["z"] ** 2).mean() ** 0.5, rows["z"].abs().max()
        print(f"{name:<14}{rows.height:>9}{rms:>8.3f}{largest:>9.2f}{'-' if covered is None else f'{covered:.3f}':>10}")


if __name__ == "__main__":
    main()
