"""Robust scale of errors by age or frame, over scenes: what `tracknoise.statistics.errors.scales` measured in each."""

from collections.abc import Iterable

import polars as pl

from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import group_rows, in_chunks
from tracknoise.tables.enumerations import Weighting
from tracknoise.tables.schema import CORES, CURVES, SCALES, Schema, check, empty

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
        What `tracknoise.statistics.errors.curves.curves` made of the same scenes; it says where curves are cut.

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
    known = scales.filter(pl.any_horizontal(pl.col("core_u_px", "core_v_px").is_not_null()))
    table = known.select(*_POINT, **parts)
    return table.select(*_POINT, *(pl.col(name).cast(kind).fill_null(0) for name, kind in _SUMS.items()))


def _added(rows: pl.DataFrame) -> pl.DataFrame:
    """The rows of each point, added up in their order."""
    groups = group_rows(rows, _POINT)
    sums = groups.sums(rows, list(_SUMS)).select(pl.col(name).cast(kind) for name, kind in _SUMS.items())
    return groups.keys.hstack(sums)
