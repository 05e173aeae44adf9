"""Robust scale of errors by age or frame, over scenes: what `tracknoise.statistics.scales` measured in each."""

from collections.abc import Iterable

import polars as pl

from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import group_rows, in_chunks
from tracknoise.tables.enumerations import Weighting
from tracknoise.tables.schema import CORES, CURVES, SCALES, Schema, check, empty

_POINT = [*POOLED, "population", "trimming", "axis", "at"]
_SUMS: Schema = {
    "n": pl.Int64,
    "n_scenes": pl.Int64,
    **dict.fromkeys(("log_u", "log_v"), pl.Float64),
    **dict.fromkeys(("beyond_u", "beyond_v"), pl.Int64),
}


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
        Schema `CORES`, sorted by its columns before `n`. Points at which no scene has a core are missing. A core is 0
        where the median error of a scene is.

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
        pl.col("n_scenes").cast(pl.Int32),
        *((pl.col(f"log_{axis}") / pl.col("n_scenes")).exp().alias(f"core_{axis}_px") for axis in "uv"),
        *((pl.col(f"beyond_{axis}") / pl.col("n")).alias(f"beyond_{axis}") for axis in "uv"),
    )
    return check(table.select(*CORES).sort(_POINT), CORES, "cores")


def _of_scenes(scales: pl.DataFrame) -> pl.DataFrame:
    """Rows of scenes that have a core, as sums."""
    logs = [pl.col(f"core_{axis}_px").log().alias(f"log_{axis}") for axis in "uv"]
    known = scales.filter(pl.col("core_u_px").is_not_null()).with_columns(*logs, n_scenes=pl.lit(1, dtype=pl.Int64))
    return known.select(*_POINT, *_SUMS)


def _added(rows: pl.DataFrame) -> pl.DataFrame:
    """The rows of each point, added up in their order."""
    groups = group_rows(rows, _POINT)
    sums = groups.sums(rows, list(_SUMS)).select(pl.col(name).cast(kind) for name, kind in _SUMS.items())
    return groups.keys.hstack(sums)
