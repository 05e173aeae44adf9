"""Sums of errors of classes of features, beside those of all classes together."""

import polars as pl

from tracknoise.statistics.definitions import NEAR_EDGE_PX
from tracknoise.statistics.grouping import group_rows
from tracknoise.tables.enumerations import EdgeSide, Occlusion, Surrounding
from tracknoise.tables.schema import SURROUNDING

POINT = ["surrounding", "class", "class_low", "class_high", "axis", "at", "coordinate"]
"""Columns that identify a class at one age, and one coordinate of its errors."""
WITHIN_ALL = ["n", "s", "q", "all_n", "all_s", "all_q"]
"""Number of errors of a class, their sum and that of their squares; the same of all classes together."""
_UNIT = ["dataset", "scene", "block"]
_COORDINATES = {
    "u": ("n", "sum_u", "sum_uu"),
    "v": ("n", "sum_v", "sum_vv"),
    "along": ("n_directed", "sum_along", "sum_along_2"),
}


def class_sums(sums: pl.DataFrame) -> pl.DataFrame:
    """Sums of every class and coordinate in every scene and block.

    Classes by depth, edge, incidence, side and parallax are of visible features. Those by occlusion include the
    occluded ones.

    Parameters
    ----------
    sums
        Schema `SURROUNDINGS`, rows of one condition.

    Returns
    -------
    polars.DataFrame
        dataset, scene, block, `POINT` and `WITHIN_ALL`. A class has a row in every block in which any class has one.
    """
    visible = sums.filter(pl.col("occlusion") != Occlusion.now)
    parts = [_ranges(visible), _sides(visible), _occlusions(sums)]
    classes = pl.concat(_by_coordinate(part) for part in parts)
    return _beside_all(_added(classes, [*_UNIT, *POINT]))


def _ranges(visible: pl.DataFrame) -> pl.DataFrame:
    named = pl.format("{} to {}", pl.col("low").round_sig_figs(3), pl.col("high").round_sig_figs(3))
    return _classified(visible, named.fill_null("none"))


def _sides(visible: pl.DataFrame) -> pl.DataFrame:
    """Features beside a depth edge, on its near and its far side, and all others."""
    low, high = pl.col("low"), pl.col("high")
    side = (
        pl.when((low >= 0.0) & (high <= NEAR_EDGE_PX))
        .then(pl.lit(EdgeSide.near.value))
        .when((high <= 0.0) & (low >= -NEAR_EDGE_PX))
        .then(pl.lit(EdgeSide.far.value))
        .otherwise(pl.lit(EdgeSide.none.value))
    )
    return _named(visible.filter(surrounding=Surrounding.edge), side, Surrounding.side)


def _occlusions(sums: pl.DataFrame) -> pl.DataFrame:
    """All features with a known depth, by their occlusion."""
    of_all = sums.filter(surrounding=Surrounding.depth)
    return _named(of_all, pl.col("occlusion").cast(pl.String), Surrounding.occlusion)


def _named(table: pl.DataFrame, name: pl.Expr, surrounding: Surrounding) -> pl.DataFrame:
    no_bounds = pl.lit(None, dtype=pl.Float64)
    named = _classified(table, name)
    return named.with_columns_seq(
        pl.lit(surrounding, dtype=SURROUNDING).alias("surrounding"), class_low=no_bounds, class_high=no_bounds
    )


def _classified(table: pl.DataFrame, name: pl.Expr) -> pl.DataFrame:
    return table.with_columns_seq(name.alias("class"), pl.col("axis").cast(pl.String)).rename(
        {"low": "class_low", "high": "class_high"}
    )


def _by_coordinate(table: pl.DataFrame) -> pl.DataFrame:
    place = POINT[:-1]
    return pl.concat(
        table.select_seq(
            *_UNIT,
            *place,
            pl.lit(coordinate).alias("coordinate"),
            *(pl.col(column).cast(pl.Float64).alias(name) for column, name in zip(columns, "nsq", strict=True)),
        )
        for coordinate, columns in _COORDINATES.items()
    )


def _beside_all(classes: pl.DataFrame) -> pl.DataFrame:
    """Every class in every block, with the sums of all classes there."""
    whole = ["surrounding", "axis", "at", "coordinate"]
    totals = _added(classes, [*_UNIT, *whole]).rename({name: f"all_{name}" for name in "nsq"})
    points = classes.select_seq(POINT).unique()
    joined = totals.join(points, on=whole).join(classes, on=[*_UNIT, *POINT], how="left", nulls_equal=True)
    return joined.with_columns_seq(pl.col("n", "s", "q").fill_null(0.0)).sort(*_UNIT, *POINT)


def _added(classes: pl.DataFrame, by: list[str]) -> pl.DataFrame:
    """Sums of the rows that agree, added up in the order of the rows: the same in every run, to the last bit."""
    groups = group_rows(classes, by)
    return groups.keys.hstack(groups.sums(classes, [*"nsq"]))
