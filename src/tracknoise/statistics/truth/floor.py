"""Truth floor of conditions: what `tracknoise.measurement.floors` summed up in each scene, pooled over scenes.

Features are pooled. With n features in all scenes, the floor of the second moment is the sum of the covariances of
their true positions over n. The variance of their mean error is (own + shared^2) / n^2: `own` adds up over scenes, and
`shared` does so with its sign, because the cause is the same in all scenes.
"""

from collections.abc import Iterable, Sequence

import polars as pl

from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.statistics.grouping import group_rows, in_chunks
from tracknoise.tables.enumerations import FloorSource
from tracknoise.tables.schema import FLOOR, FLOOR_SOURCE, FLOORS, ORIGIN, check

FLOOR_COLUMNS = ("floor_u", "floor_v")
"""Columns that `with_floor` adds to curves."""
_PLACE = [*POOLED, "axis", "at"]
_POINT = [*POOLED, "source", "axis", "at"]
_NUMBERS = ["n", "n_scenes"]
_MOMENTS = ["sum_uu", "sum_uv", "sum_vv"]
_MEANS = ["own_uu", "own_vv", "shared_u", "shared_v"]
_UNKNOWN = "unknown"
"""Number of scenes whose mean is unknown."""


def truth_floor(floors: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Truth floor by condition, source, and age or frame.

    Parameters
    ----------
    floors
        Schema `FLOORS`, of any number of scenes; or any number of such tables, which are read a few at a time.

    Returns
    -------
    polars.DataFrame
        Schema `FLOOR`, sorted by its columns before `n`. The mean is null where only the second moment is known.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    of_sources = pl.DataFrame(schema=_kinds(_POINT, [*_NUMBERS, *_MOMENTS, *_MEANS, _UNKNOWN]))
    of_scenes = pl.DataFrame(schema=_kinds(_PLACE, _NUMBERS))
    for chunk in in_chunks(floors, FLOORS, "floors"):
        rows = chunk.with_columns(
            pl.col("n").cast(pl.Float64),
            pl.col(_MEANS).fill_null(0.0),
            n_scenes=pl.lit(1.0),
            unknown=pl.col("own_uu").is_null().cast(pl.Float64),
        )
        scenes = rows.unique([*ORIGIN, "axis", "at"], keep="first", maintain_order=True)
        of_sources = _added(pl.concat([of_sources, rows.select(of_sources.columns)]), _POINT)
        of_scenes = _added(pl.concat([of_scenes, scenes.select(of_scenes.columns)]), _PLACE)
    squared = of_sources.with_columns(var_u=_variance("u"), var_v=_variance("v"))
    together = _added(squared.select(*_PLACE, *_MOMENTS, "var_u", "var_v", _UNKNOWN), _PLACE).join(of_scenes, on=_PLACE)
    every = together.with_columns(source=pl.lit(FloorSource.all, dtype=FLOOR_SOURCE)).with_columns(_values())
    single = squared.filter(pl.col("source") != FloorSource.all).with_columns(_values())
    parts = [part.select(pl.col(name).cast(kind) for name, kind in FLOOR.items()) for part in (every, single)]
    return check(pl.concat(parts).sort(_POINT), FLOOR, "floor")


def _kinds(keys: Sequence[str], sums: Sequence[str]) -> dict[str, pl.DataType | type[pl.DataType]]:
    return {**{name: FLOORS[name] for name in keys}, **dict.fromkeys(sums, pl.Float64)}


def _added(rows: pl.DataFrame, keys: list[str]) -> pl.DataFrame:
    """The rows of each group, added up in their order."""
    groups = group_rows(rows, keys)
    return groups.keys.hstack(groups.sums(rows, [name for name in rows.columns if name not in keys]))


def _variance(axis: str) -> pl.Expr:
    """Variance of the sum of all errors of a coordinate."""
    return pl.col(f"own_{axis}{axis}") + pl.col(f"shared_{axis}").pow(2)


def _values() -> list[pl.Expr]:
    n = pl.col("n")
    known = pl.when(pl.col(_UNKNOWN) == 0.0)
    moments = [(pl.col(f"sum_{name}") / n).alias(f"floor_{name}") for name in ("uu", "uv", "vv")]
    return [*moments, *(known.then(pl.col(f"var_{axis}").sqrt() / n).alias(f"mean_{axis}_px") for axis in "uv")]


def with_floor(curves: pl.DataFrame, floor: pl.DataFrame) -> pl.DataFrame:
    """Curves with the truth floor of their values in u and v.

    Parameters
    ----------
    curves
        Columns of `CURVES`.
    floor
        Schema `FLOOR`.

    Returns
    -------
    polars.DataFrame
        The same rows with columns floor_u and floor_v, in the unit of the curve: the standard deviation of the mean
        beside means, and the second moment beside second and central moments. Null beside other statistics, and where
        nothing is known of the errors of the truth.

    Raises
    ------
    SchemaError
        If `floor` has other columns.
    """
    values = {
        "mean": ("mean_u_px", "mean_v_px"),
        "second": ("floor_uu", "floor_vv"),
        "central": ("floor_uu", "floor_vv"),
    }
    known = check(floor, FLOOR, "floor").filter(source=FloorSource.all).drop("source", "n", "n_scenes", "floor_uv")
    table = curves.join(known, on=_PLACE, how="left", maintain_order="left")
    columns = {}
    for place, column in enumerate(FLOOR_COLUMNS):
        value = pl.lit(None, dtype=pl.Float64)
        for role, names in values.items():
            called = [name[role] for name in NAMES.values()]
            value = pl.when(pl.col("statistic").is_in(called)).then(pl.col(names[place])).otherwise(value)
        columns[column] = value
    return table.with_columns(**columns).drop("floor_uu", "floor_vv", "mean_u_px", "mean_v_px")
