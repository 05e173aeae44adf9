"""How much results depend on the random seeds of the trackers, and intervals that include it.

An experiment with ``seeds = N`` repeats its measurement with other seeds of the outlier rejection and of the oracle.
All results are those of the first seed. The others only show how much each number differs between seeds.

Intervals that resample scenes include this chance already: the seeds act in each scene independently, so that it is
part of the differences between scenes. Blocks of tracks within a scene share its frames, and with them the outcome of
each draw. Intervals that resample blocks are therefore widened. On the scale of the interval, the squares of its
half-width and of t s add up, where s is the standard deviation between seeds and t is Student's quantile of N - 1
degrees (widen).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import special

from tracknoise.analysis.curve_intervals import interval_table
from tracknoise.analysis.lifetime_intervals import WHOLE_FRAMES
from tracknoise.inference.jackknife import SCALES
from tracknoise.inference.units import Resampled
from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.statistics.grouping import Tables
from tracknoise.statistics.lifetimes import RESTRICTED
from tracknoise.tables.findings_schema import INTERVALS
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import OF_CONDITION, Rows, RunTable, Value, same
from tracknoise.tables.schema import POOLED as CONDITIONS
from tracknoise.tables.schema import check, empty, typed


def _seeds() -> Rows:
    values = [
        Value("seed_spread", "standard_deviation", carried=same("unit") | {"verdict": "widens_interval"}),
        Value("seed_mean", "mean", carried=same("unit")),
        Value("seeds", "n_seeds"),
    ]
    keys = {
        **OF_CONDITION,
        **same("population", "trimming", "weighting", "axis", "at", "coordinate"),
        "of": "statistic",
    }
    return Rows("seeds", keys, values)


SEED_SPREAD = RunTable(
    "seed_spread",
    {
        **CONDITIONS,
        **{
            name: INTERVALS[name]
            for name in ("population", "trimming", "weighting", "statistic", "axis", "at", "coordinate", "unit")
        },
        "mean": pl.Float64,
        "standard_deviation": pl.Float64,
        "n_seeds": pl.Int32,
        "widens_interval": pl.Boolean,
    },
    _seeds(),
    title="differences between random seeds",
    quantities={
        "seed_spread": Quantity(None, "Standard deviation between random seeds of the tracker."),
        "seed_mean": Quantity(None, "Mean over random seeds of the tracker."),
        "seeds": Quantity("1", "Number of random seeds."),
    },
    without_truth=True,
)
"""How much a number differs between random seeds of the trackers, in its own unit.

The table has rows if an experiment has several seeds. widens_interval states whether the standard deviation was added
to the interval of the number in `INTERVALS`. Intervals that resample scenes include this chance already.
"""


@dataclass(frozen=True, slots=True)
class Repeat:
    """Tables of all scenes, measured with one other seed: `MOMENTS`, `ENDS` and `FRAME_COUNTS`."""

    moments: Tables
    ends: Tables
    frames: Tables


KEYS = [*POOLED, "population", "trimming", "weighting", "statistic", "axis", "at", "coordinate"]
"""What identifies a number in `SEED_SPREAD`, as in `INTERVALS`."""
_SIGNED = [names["mean"] for names in NAMES.values()]
_IS_RESTRICTED = pl.col("statistic").is_in(list(RESTRICTED))


def seed_spread(
    intervals: pl.DataFrame, repeats: Iterable[Repeat], *, horizons: pl.DataFrame, population: str
) -> pl.DataFrame:
    """Mean and standard deviation, between seeds, of every number of `intervals` about errors, lifetimes and outliers.

    Parameters
    ----------
    intervals
        Schema `INTERVALS`: results of the first seed.
    repeats
        The tables of each other seed.
    horizons
        What `tracknoise.statistics.lifetimes.horizons` returned for the first seed.
    population
        Which observations the errors are of: `visible` or `projected`.

    Returns
    -------
    polars.DataFrame
        Schema `SEED_SPREAD`, sorted; without rows if there is one seed only. A number that not all seeds have is of
        fewer seeds.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    check(intervals, INTERVALS, "intervals")
    rows = [
        interval_table(repeat.moments, repeat.ends, repeat.frames, restricted_to=horizons, population=population)
        for repeat in repeats
    ]
    if not rows:
        return empty(SEED_SPREAD)
    first = intervals.filter(aspect="all").with_columns_seq(by_block=pl.col("resampled") == Resampled.blocks)
    values = pl.concat([first.select_seq(*KEYS, "value"), *(table.select_seq(*KEYS, "value") for table in rows)])
    value = pl.col("value").drop_nulls()
    spread = values.group_by(KEYS).agg(mean=value.mean(), standard_deviation=value.std(), n_seeds=value.len())
    table = first.select_seq(*KEYS, "unit", "by_block").join(spread, on=KEYS, nulls_equal=True)
    table = table.rename({"by_block": "widens_interval"}).filter(pl.col("n_seeds") > 1).sort(KEYS)
    return typed(table, SEED_SPREAD)


def widened(intervals: pl.DataFrame, spread: pl.DataFrame, *, horizons: pl.DataFrame) -> pl.DataFrame:
    """Intervals of blocks that include the chance of the random seed, by (widen).

    Parameters
    ----------
    intervals
        Schema `INTERVALS`.
    spread
        What `seed_spread` returned for them.
    horizons
        As in `seed_spread`: restricted means stay below these.

    Returns
    -------
    polars.DataFrame
        The same rows in the same order. Bounds of lifetimes in whole frames are rounded outwards. Where a bound is
        missing, or the value is at a limit of its scale, nothing changes.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    check(intervals, INTERVALS, "intervals")
    added = check(spread, SEED_SPREAD, "seed spread").filter("widens_interval")
    if added.is_empty():
        return intervals
    numbers = intervals.join(
        added.select_seq(*KEYS, "standard_deviation", "n_seeds"),
        on=KEYS,
        how="left",
        nulls_equal=True,
        maintain_order="left",
    )
    limited = numbers.join(horizons, on=["dataset", "speed"], how="left", maintain_order="left").with_columns_seq(
        pl.when(aspect="all").then("standard_deviation"),
        most=pl.when(_IS_RESTRICTED).then("restricted_to").otherwise(1),
    )
    return intervals.with_columns_seq(_bounds(limited))


def _bounds(numbers: pl.DataFrame) -> Sequence[pl.Series]:
    """Both bounds by (widen); restricted means are shares of what they can be at `most`."""
    names = ("value", "low", "high", "standard_deviation", "level", "most")
    value, low, high, spread, level, most = (numbers[name].to_numpy().astype(np.float64) for name in names)
    n_seeds = numbers["n_seeds"].fill_null(2).to_numpy()
    reach = special.stdtrit(n_seeds - 1.0, (1 + level) / 2) * spread
    scales, whole = _scales(numbers), numbers["statistic"].is_in(WHOLE_FRAMES).to_numpy()
    ends = []
    for name, bound, outwards in (("low", low, np.floor), ("high", high, np.ceil)):
        moved = bound.copy()
        for scale in np.unique(scales):
            rows = (scales == scale) & ~np.isnan(reach) & (reach > 0)
            parts = (values[rows] / most[rows] for values in (value, bound, reach))
            moved[rows] = most[rows] * _moved(scale, *parts)
        ends.append(pl.Series(name, np.where(whole, outwards(moved), moved)).fill_nan(None))
    return ends


def _scales(numbers: pl.DataFrame) -> NDArray[np.str_]:
    """Scale of the interval of each row, as in `tracknoise.analysis`."""
    linear = pl.col("statistic").is_in([*_SIGNED, *WHOLE_FRAMES]) | (pl.col("coordinate") == "uv").fill_null(
        value=False
    )
    is_share = (pl.col("unit") == "share") | _IS_RESTRICTED
    scale = pl.when(linear).then(pl.lit("linear")).when(is_share).then(pl.lit("logit")).otherwise(pl.lit("log"))
    return numbers.select_seq(scale).to_series().to_numpy().astype(np.str_)


def _moved(
    name: str, value: NDArray[np.float64], bound: NDArray[np.float64], reach: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Bounds by (widen). They stay where a value or a bound is at a limit of the scale, or missing."""
    scale = SCALES[name]
    inside = (value > scale.low) & (value < scale.high) & (bound > scale.low) & (bound < scale.high)
    at, end, far = (np.where(inside, numbers, 0.5) for numbers in (value, bound, reach))
    width = scale.to(end) - scale.to(at)
    further = np.hypot(width, far * scale.slope(at))
    return np.where(inside, scale.back(scale.to(at) + np.where(end < at, -further, further)), bound)
