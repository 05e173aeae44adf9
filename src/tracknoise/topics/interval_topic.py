"""Intervals of all numbers of curves, tracks and outliers, and their spread between random seeds."""

from collections.abc import Iterator

import polars as pl

from tracknoise.analysis.curve_intervals import interval_table
from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.analysis.seed_spread import SEED_SPREAD, Repeat, seed_spread, widened
from tracknoise.statistics.lifetimes import horizons
from tracknoise.tables.findings_schema import INTERVALS, LIFETIMES
from tracknoise.topics.topic import Analysis, Topic


def _intervals(inputs: RunInputs) -> tuple[pl.DataFrame, pl.DataFrame]:
    horizon = horizons(inputs[LIFETIMES])
    intervals = interval_table(
        inputs.moments,
        inputs.ends,
        inputs.frames,
        blocks=inputs.blocks,
        aspects=inputs.aspects(),
        changes=inputs.changes,
        aspect_blocks=inputs.aspect_blocks,
        scales=inputs.scales,
        scale_blocks=inputs.scale_blocks,
        restricted_to=horizon,
        population=inputs.population,
        **inputs.intervals,
    )
    spread = seed_spread(intervals, _repeats(inputs), horizons=horizon, population=inputs.population)
    return widened(intervals, spread, horizons=horizon), spread


def _repeats(inputs: RunInputs) -> Iterator[Repeat]:
    """Tables of the scenes measured with each further random seed."""
    for seed in range(1, inputs.seeds):
        yield Repeat(
            **{
                name: (table.filter(seed=seed).drop("seed") for table in inputs.run.sequence_tables(f"seed_{name}"))
                for name in ("moments", "ends", "frames")
            }
        )


NUMBERS = Topic("intervals", (Analysis((INTERVALS, SEED_SPREAD), _intervals, needs=(LIFETIMES,)),))
