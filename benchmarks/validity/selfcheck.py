"""How often ``python -m benchmarks.selfcheck`` fails by chance, and how far its numbers are from their limits.

    python -m benchmarks.validity.selfcheck [--seeds N] [--first N] [--scenes N] [--workers N]

One self-test per seed. The exact part does not depend on chance. Each limit of the others is exceeded with a
probability of at most 1 / 10000 (`benchmarks.selfcheck.scene_pools.ALARM`).
"""

import argparse
import tempfile
from pathlib import Path

import polars as pl

from benchmarks.selfcheck.self_test import judge, self_test


def checks_of(seed: int, scenes: int, workers: int) -> pl.DataFrame:
    """Checks of one self-test."""
    with tempfile.TemporaryDirectory() as folder:
        checks = self_test(Path(folder), scenes=scenes, seed=seed, workers=workers)
    return checks.with_columns(seed=pl.lit(seed))


def main() -> None:
    """Print one line per seed, then the range of every number that depends on chance."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    tables = []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        tables.append(checks_of(seed, arguments.scenes, arguments.workers))
        result = judge(tables[-1].drop("seed"))
        wrong = "; ".join(
            f"{row['area']}: {row['quantity']} {row['measured']}, expected {row['expected']}"
            for row in tables[-1].filter(pl.col("n_wrong") > 0).iter_rows(named=True)
        )
        print(f"seed {seed}: {'passed' if result.passes else f'FAILED: {wrong}'}", flush=True)
    every = pl.concat(tables).filter(pl.col("world").is_in(["pool", "factors"]))
    print(f"{'quantity':<58}{'expected':<34}measured")
    for (quantity, expected), rows in every.group_by("quantity", "expected", maintain_order=True):
        numbers = rows["measured"].cast(pl.Float64, strict=False)
        found = ", ".join(rows["measured"].unique().sort()) if numbers.null_count() else ""
        print(f"{quantity:<58}{expected:<34}{found or f'{numbers.min():.3g} to {numbers.max():.3g}'}")


if __name__ == "__main__":
    main()
