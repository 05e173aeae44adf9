"""Robust scale of errors: the core, which a few large errors do not change, and how many errors lie far beyond it.

- core_u(k) = 1.4826 median |du_i|, px (core): the sigma of the Gaussian that has the same median
- beyond_u(k) = number of errors with |du_i| > 3 core_u(k) (beyond): 0.27 % of those of a Gaussian

There is no core where it would be 0: more than half of the errors are then exactly 0, and their median says nothing
about the others. Both are of the errors of one scene at one age. Medians cannot be pooled, so that scenes are combined
by the geometric mean of their cores.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import IntegerArray, group_rows, in_chunks, number_combinations
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import Population, Weighting
from tracknoise.tables.findings_schema import CORES, CURVES
from tracknoise.tables.schema import AXIS, POPULATION, SCALE_BLOCKS, SCALES, TRIMMING, Schema, check, empty, typed

PER_MEDIAN = 1.482602218505602
"""Sigma of a Gaussian by the median of its absolute value."""
FAR = 3.0
"""Errors beyond this many cores are counted."""
ROUNDING_PX = 1e-9
"""Cores up to this are rounding, px: of errors that are zero by construction."""
LEAST_ERRORS = 10
"""Fewest errors that have a core: the median of fewer depends mostly on chance."""


def scales(sequence: PreparedSequence) -> pl.DataFrame:
    """Core and far errors of every scene and condition, by population, trimming, and age or frame.

    Parameters
    ----------
    sequence
        Trimmed.

    Returns
    -------
    polars.DataFrame
        Schema `SCALES`, sorted by its columns before `n`, with one row for each combination that has an observation.
    """
    return check(_table(sequence, tuple(Population), {}), SCALES, "scales")


def scale_blocks(sequence: PreparedSequence) -> pl.DataFrame:
    """The same by block of tracks, for the populations of the sequence.

    Returns schema `SCALE_BLOCKS`, sorted in the same way, and by block.
    """
    table = _table(sequence, sequence.populations, {"block": sequence.block})
    return check(table.with_columns(pl.col("block").cast(pl.UInt8)), SCALE_BLOCKS, "blocks of scales")


def _table(sequence: PreparedSequence, populations: Sequence[str], by: Mapping[str, IntegerArray]) -> pl.DataFrame:
    """Rows of every population and trimming, and of each value of the keys `by`."""
    seen = sequence.seen
    parts = []
    for population in populations:
        for trimming, chosen in seen.by_trimming(seen.members(population)).items():
            keys = {"condition": seen.condition, "at": seen.at, **by}
            scales = _scales(seen.error_px[chosen], {name: key[chosen] for name, key in keys.items()})
            labels = pl.lit(population, dtype=POPULATION), pl.lit(trimming, dtype=TRIMMING)
            parts.append(scales.with_columns(population=labels[0], trimming=labels[1]))
    table = pl.concat(parts).sort("condition", "population", "trimming", "at", *by)
    columns = [*SCALES, *by]
    named = seen.with_conditions(table)
    return named.with_columns(pl.lit(seen.axis, dtype=AXIS).alias("axis"), pl.col("at").cast(pl.UInt32)).select(columns)


def _scales(error_px: NDArray[np.float64], keys: Mapping[str, IntegerArray]) -> pl.DataFrame:
    """(core) and (beyond) of the errors (rows, 2) of each combination of keys."""
    combined, index = number_combinations(list(keys.values()))
    n = np.bincount(index, minlength=len(combined[0]))
    columns = {"n": pl.Series(n, dtype=pl.Int64)}
    for axis, size in zip("uv", np.abs(error_px).T, strict=True):
        core = PER_MEDIAN * grouped_medians(size, index, n)
        has_core = (n >= LEAST_ERRORS) & (core > ROUNDING_PX)
        beyond = np.bincount(index[size > FAR * core[index]], minlength=len(n))
        columns[f"core_{axis}_px"] = pl.Series(np.where(has_core, core, np.nan), dtype=pl.Float64, nan_to_null=True)
        columns[f"beyond_{axis}"] = pl.Series(np.where(has_core, beyond, np.nan), nan_to_null=True).cast(pl.Int64)
    return pl.DataFrame(dict(zip(keys, combined, strict=True))).with_columns(**columns)


def grouped_medians(values: NDArray[np.float64], index: NDArray[np.intp], n: NDArray[np.intp]) -> NDArray[np.float64]:
    """Median of the values of each group, (groups,). Shapes: values, index (rows,), n (groups,)."""
    ordered = values[np.lexsort((values, index))]
    start = np.cumsum(n) - n
    middle: NDArray[np.float64] = (ordered[start + (n - 1) // 2] + ordered[start + n // 2]) / 2
    return middle


_POINT = [*POOLED, "population", "trimming", "axis", "at"]
_INTEGERS = [f"{name}_{axis}" for name in ("n", "n_scenes", "beyond") for axis in "uv"]
_SUMS: Schema = {**dict.fromkeys(_INTEGERS, pl.Int64), **dict.fromkeys(("log_u", "log_v"), pl.Float64)}


def cores(scales: pl.DataFrame | Iterable[pl.DataFrame], curves: pl.DataFrame) -> pl.DataFrame:
    """Geometric mean over scenes of their (core), and the share of errors (beyond) three of these.

    Parameters
    ----------
    scales
        Schema `SCALES`, of any number of scenes; or any number of such tables, which are read a few at a time.
    curves
        What `tracknoise.statistics.curves.curves` made of the same scenes; it says where curves are cut.

    Returns
    -------
    polars.DataFrame
        Schema `CORES`, sorted by its columns before `n_u`. Points at which no scene has a core are missing.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    sums = empty({**{name: SCALES[name] for name in _POINT}, **_SUMS})
    for chunk in in_chunks(scales, SCALES, "scales"):
        sums = _added(pl.concat([sums, _of_scenes(chunk)]))
    cuts = check(curves, CURVES, "curves").filter(weighting=Weighting.features).select(*_POINT, "cut").unique()
    table = sums.join(cuts, on=_POINT, how="left").with_columns(
        pl.col("cut").fill_null(value=True),
        pl.col("n_scenes_u", "n_scenes_v").cast(pl.Int32),
        *(_over(f"log_{axis}", f"n_scenes_{axis}").exp().alias(f"core_{axis}_px") for axis in "uv"),
        *(_over(f"beyond_{axis}", f"n_{axis}").alias(f"beyond_{axis}") for axis in "uv"),
    )
    return check(table.select(*CORES).sort(_POINT), CORES, "cores")


def _over(total: str, count: str) -> pl.Expr:
    return pl.when(pl.col(count) > 0).then(pl.col(total) / pl.col(count))


def _of_scenes(scales: pl.DataFrame) -> pl.DataFrame:
    """Rows of scenes that have a core, as sums."""
    parts: dict[str, pl.Expr] = {}
    for axis in "uv":
        core = pl.col(f"core_{axis}_px")
        values = {"n": pl.col("n"), "n_scenes": pl.lit(1), "beyond": pl.col(f"beyond_{axis}"), "log": core.log()}
        parts |= {f"{name}_{axis}": pl.when(core.is_not_null()).then(value) for name, value in values.items()}
    with_core = scales.filter(pl.any_horizontal(pl.col("core_u_px", "core_v_px").is_not_null()))
    table = with_core.select(*_POINT, **parts)
    return table.select(*_POINT, *(pl.col(name).cast(kind).fill_null(0) for name, kind in _SUMS.items()))


def _added(rows: pl.DataFrame) -> pl.DataFrame:
    """The rows of each point, added up in their order."""
    groups = group_rows(rows, _POINT)
    return groups.keys.hstack(typed(groups.sums(rows, list(_SUMS)), _SUMS))
