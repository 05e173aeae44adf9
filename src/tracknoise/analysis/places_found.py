"""Errors by place, with intervals: cells of the image, speeds of the image, and surroundings.

The statistics by surroundings use the number n of features in a class, the sum s of their errors and the sum q of the
squares, and N, S and Q in all classes together:

- mean s / n and second moment q / n of the class, and its share n / N of the features
- shares of the whole: s / S of the sum of errors, and q / Q of the sum of squares
- without the class: the mean (S - s) / (N - n), and the share of the second moment that is removed,
  1 - (Q - q) N / (Q (N - n)) (places.excluded)
- with nothing but the class: the share of the second moment that is removed, 1 - q N / (Q n)
"""

from dataclasses import replace
from functools import partial

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import USUAL, Sampling, condition_table, estimates_by_point, units_of
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method, column_means, pooled
from tracknoise.statistics.definitions import NEAR_EDGE_PX, POOLED
from tracknoise.statistics.grouping import Tables, by_condition, group_rows
from tracknoise.tables.enumerations import EdgeSide, Occlusion, Surrounding
from tracknoise.tables.findings_schema import ESTIMATE_COLUMNS, INTERVAL_COLUMNS
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import (
    ESTIMATED_OF_N,
    OF_CLASS,
    OF_CONDITION,
    Rows,
    RunTable,
    Value,
    bounds_of,
    one_number,
    same,
)
from tracknoise.tables.schema import IMAGE_MAP, IMAGE_SPEEDS, SURROUNDING, SURROUNDINGS, empty
from tracknoise.tables.schema import POOLED as CONDITIONS

SURROUNDING_ERRORS = RunTable(
    "surrounding_errors",
    {
        **CONDITIONS,
        "surrounding": SURROUNDING,
        "class": pl.String,
        "class_low": pl.Float64,
        "class_high": pl.Float64,
        "axis": pl.String,
        "at": pl.Int64,
        "coordinate": pl.String,
        "statistic": pl.String,
        "unit": pl.String,
        "n": pl.Int64,
        **ESTIMATE_COLUMNS,
    },
    Rows(
        "surroundings",
        {**OF_CONDITION, **OF_CLASS, **same("axis", "at", "coordinate"), "of": "statistic"},
        [Value("surrounding", "value", carried=ESTIMATED_OF_N | {"unit": "unit"})],
        packed={"part": ("surrounding", "class")},
    ),
    quantities={"surrounding": Quantity(None, "Untrimmed errors by what surrounds a feature.")},
)
"""Untrimmed errors by what surrounds a feature: one row per property, class, age, coordinate and statistic.

The properties are those of `tracknoise.tables.enumerations.Surrounding`. class_low and class_high bound a class of
depths (m), of signed distances to a depth edge (px), or of angles of incidence (degrees). The classes of `side` are
`near`, `far` and `none`: within 7.5 px of an edge, or not. Those of `occlusion` are `never`, `later` and `now`, and
include features that are occluded; all others are of visible features. The coordinate is u, v, or along the motion of
the true position.

mean, second and share are the mean error, the second moment, and the share of the features that are of the class.
share_of_mean and share_of_second are its shares of the sum of all errors and of their squares. mean_without is the mean
error of all other features. second_removed is the share of the second moment that excluding the class removes, and
second_removed_by_others the share that excluding all other classes removes.
"""


def _image() -> Rows:
    made = same("level", "resampled", "n_units", "n_scenes") | {"interval": "kind"}
    values = [
        Value("image_spread", "spread_px", carried=made | {"n": "n", "verdict": "differs"}),
        *(
            Value("image_mean", f"mean_{name}_px", {"coordinate": name}, carried=made | bounds_of(f"mean_{name}"))
            for name in "uv"
        ),
    ]
    keys = {**OF_CONDITION, **same("axis", "at")}
    return Rows("image", keys, values, packed={"part": ("row", "column")})


IMAGE_CELLS = RunTable(
    "image_cells",
    {
        **CONDITIONS,
        "axis": pl.String,
        "at": pl.Int64,
        "row": pl.Int32,
        "column": pl.Int32,
        "n": pl.Int64,
        **{f"mean_{axis}_{value}": pl.Float64 for axis in "uv" for value in ("px", "low", "high")},
        "spread_px": pl.Float64,
        "differs": pl.Boolean,
        **{name: dtype for name, dtype in INTERVAL_COLUMNS.items() if name not in ("low", "high")},
    },
    _image(),
    quantities={
        "image_mean": Quantity("px", "Mean error in a cell of the image."),
        "image_spread": Quantity("px", "Standard deviation of one coordinate in a cell of the image."),
    },
)
"""Mean of visible, untrimmed errors in each cell of the image, 20 columns x 14 rows, counted from the top left.

spread_px is the standard deviation of one coordinate, as root mean square of both. The bounds in u and v hold together
with the probability of the level. differs says whether they exclude a mean of zero; it is null without bounds.
"""

SPEED_ERRORS = RunTable(
    "speed_errors",
    {
        **CONDITIONS,
        "axis": pl.String,
        "at": pl.Int64,
        "class_low": pl.Float64,
        "class_high": pl.Float64,
        "coordinate": pl.String,
        "n": pl.Int64,
        "mean_px": pl.Float64,
        **INTERVAL_COLUMNS,
    },
    one_number(
        "image speeds",
        "image_speed_mean",
        "mean_px",
        {**OF_CONDITION, **OF_CLASS, **same("axis", "at", "coordinate")},
        ESTIMATED_OF_N,
    ),
    quantities={"image_speed_mean": Quantity("px", "Mean error along and across the image motion, by its speed.")},
)
"""Mean of visible, untrimmed errors along and across the image motion, by its speed: class_low to class_high px/frame.

The motion is that of the true position since the previous frame that the tracker saw.
"""

POINT = ["surrounding", "class", "class_low", "class_high", "axis", "at", "coordinate"]
"""Columns that identify a class at one age, and one coordinate of its errors."""
WITHIN_ALL = ["n", "s", "q", "all_n", "all_s", "all_q"]
"""Number of errors of a class, their sum and that of their squares; the same of all classes together."""
_UNIT = ["dataset", "scene", "block"]
_CLASS_COORDINATES = {
    "u": ("n", "sum_u", "sum_uu"),
    "v": ("n", "sum_v", "sum_vv"),
    "along": ("n_directed", "sum_along", "sum_along_2"),
}


def class_sums(sums: pl.DataFrame) -> pl.DataFrame:
    """Sums of every class and coordinate in every scene and block.

    Classes by depth, edge, incidence, side and parallax are of visible features. Those by occlusion include the
    occluded ones. Returns: dataset, scene, block, `POINT` and `WITHIN_ALL`. A class has a row in every block in which
    any class has one. `sums`: schema `SURROUNDINGS`, rows of one condition.
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
        for coordinate, columns in _CLASS_COORDINATES.items()
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


_CELL_COLUMNS = ["n", "sum_u", "sum_v", "sum_uu", "sum_vv"]
_CELL_POINT = ["axis", "at", "row", "column"]


def image_cells(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Mean error of every cell of the image that has an error, in every condition.

    `sums`: tables of all scenes, schema `IMAGE_MAP`. Returns: schema `IMAGE_CELLS`, sorted. The bounds in u and in
    v hold together with the probability of the level. Raises as `condition_table`.
    """
    conditions = by_condition(
        sums, IMAGE_MAP, "image map", lambda table: table.with_columns_seq(pl.col("n").cast(pl.Int64))
    )
    rows = partial(_cell_rows, level=sampling.level)
    in_each_axis = replace(sampling, level=1.0 - (1.0 - sampling.level) / 2.0)  # Bonferroni's, for u and v
    return condition_table(conditions, IMAGE_CELLS, rows, in_each_axis).sort(*POOLED, *_CELL_POINT)


def _cell_rows(sums: pl.DataFrame, draws: Draws, method: Method, level: float) -> pl.DataFrame:
    """One row per age and cell of a condition."""
    units = units_of(sums, sums, points=_CELL_POINT, columns=_CELL_COLUMNS, groups=draws.groups)
    estimates = pooled(units, draws.weights(units), _means, method)
    names = ("mean_u", "mean_v", "spread")
    columns = {f"{name}_px": value for name, value in zip(names, estimates.value, strict=True)}
    for name, low, high in zip(names[:2], estimates.low, estimates.high, strict=False):
        columns |= {f"{name}_low": low, f"{name}_high": high}
    differs = ((estimates.low[:2] > 0) | (estimates.high[:2] < 0)).any(axis=0)
    bounded = ~np.isnan(estimates.low[:2]).any(axis=0)
    return units.points.with_columns_seq(
        pl.col("axis").cast(pl.String),
        *(pl.Series(name, values, dtype=pl.Float64, nan_to_null=True) for name, values in columns.items()),
        n=units.sums[..., 0].sum(axis=0),
        differs=pl.when(pl.Series(bounded)).then(pl.Series(differs)),
        kind=pl.lit(estimates.kind),
        level=pl.lit(level),
        resampled=pl.lit(units.resampled, dtype=pl.String),
        n_units=estimates.n_units[0],
        n_scenes=estimates.n_scenes[0],
    )


def _means(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean error in u and in v, and the root mean variance of both, (3, points, ...)."""
    n = np.where(sums[0] > 0, sums[0], np.nan)
    u, v, uu, vv = sums[1:] / n
    return np.stack([u, v, np.sqrt(np.maximum(uu - u * u + vv - v * v, 0.0) / 2.0)])


_SPEED_COLUMNS = ["n", "sum_along", "sum_across"]
_SPEED_POINT = ["axis", "at", "class_low", "class_high"]
_SPEED_COORDINATES = ("along", "across")


def speed_errors(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Mean errors along and across the image motion in every class of its speed, in every condition.

    `sums`: tables of all scenes, schema `IMAGE_SPEEDS`. Returns: schema `SPEED_ERRORS`, sorted. Raises as
    `condition_table`.
    """
    conditions = by_condition(sums, IMAGE_SPEEDS, "image speeds")
    return condition_table(conditions, SPEED_ERRORS, _speed_rows, sampling).sort(*POOLED, *_SPEED_POINT, "coordinate")


def _speed_rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per age, class of speed, and coordinate of a condition."""
    named = sums.rename({"low": "class_low", "high": "class_high"})
    units = units_of(named, named, points=_SPEED_POINT, columns=_SPEED_COLUMNS, groups=draws.groups)
    estimates = pooled(units, draws.weights(units), column_means, method)
    statistics = pl.DataFrame({"coordinate": _SPEED_COORDINATES})
    return estimates_by_point(estimates, units, SPEED_ERRORS, value="mean_px", statistics=statistics)


_STATISTICS = {
    "mean": ("px", "linear"),
    "second": ("px^2", "log"),
    "share": ("share", "logit"),
    "share_of_mean": ("share", "linear"),
    "share_of_second": ("share", "logit"),
    "mean_without": ("px", "linear"),
    "second_removed": ("share", "linear"),
    "second_removed_by_others": ("share", "linear"),
}
"""Unit of each statistic, and the scale on which its intervals are made."""
_REMOVED = ("second_removed", "second_removed_by_others")
"""Parts of a second moment: at most all of it, but may be negative, so that no scale but the linear one has both."""


def surrounding_errors(sums: Tables, sampling: Sampling = USUAL) -> pl.DataFrame:
    """Statistics of every class of every property, in every condition.

    `sums`: tables of all scenes, schema `SURROUNDINGS`. Returns: schema `SURROUNDING_ERRORS`, sorted. Raises as
    `condition_table`.
    """
    conditions = by_condition(sums, SURROUNDINGS, "surroundings")
    table = condition_table(conditions, SURROUNDING_ERRORS, _surrounding_rows, sampling)
    return table.drop_nulls("value").sort(*POOLED, *POINT, "statistic")


def _surrounding_rows(sums: pl.DataFrame, draws: Draws, method: Method) -> pl.DataFrame:
    """One row per property, class, age, coordinate and statistic of a condition."""
    classes = class_sums(sums)
    if classes.is_empty():
        return empty(SURROUNDING_ERRORS)
    units = units_of(classes, classes, points=POINT, columns=WITHIN_ALL, groups=draws.groups)
    n, of_all = units.sums[..., 0].T, units.sums[..., 3].T
    sizes = np.stack([n, n, of_all, of_all, of_all, of_all - n, of_all - n, n])
    scales = [scale for _, scale in _STATISTICS.values()]
    estimates = pooled(units, draws.weights(units), _statistics, method, scales=scales, sizes=sizes)
    kinds = pl.DataFrame({"statistic": list(_STATISTICS), "unit": [unit for unit, _ in _STATISTICS.values()]})
    rows = estimates_by_point(estimates, units, SURROUNDING_ERRORS, statistics=kinds)
    no_more_than_all = pl.when(pl.col("statistic").is_in(_REMOVED)).then(pl.col("high").clip(upper_bound=1.0))
    return rows.with_columns_seq(no_more_than_all.otherwise("high").alias("high"))


def _statistics(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values of `_STATISTICS`, (8, points, ...), NaN where they are not defined."""
    n, s, q, all_n, all_s, all_q = sums
    without = _over(all_q - q, all_n - n)
    return np.stack(
        [
            _over(s, n),
            _over(q, n),
            _over(n, all_n),
            _over(s, all_s),
            _over(q, all_q),
            _over(all_s - s, all_n - n),
            1.0 - _over(without * all_n, all_q),
            1.0 - _over(_over(q, n) * all_n, all_q),
        ]
    )


def _over(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(one / np.where(other != 0, other, np.nan))
