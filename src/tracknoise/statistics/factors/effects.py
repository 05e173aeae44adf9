"""Effects of factors by the paper's yardstick: the largest difference between levels, relative to what is common.

The estimates are taken as they are, without intervals; `tracknoise.findings.factors` compares levels within scenes.
All other factors are held at their reference. `tracknoise.statistics.factors.differences` compares the curves of every
pair of levels. The effect on a statistic is the largest over pairs and over the coordinates u and v (effect). The
curves have features pooled and are not cut. Age 0 and the key frame are left out, because errors are zero there by
construction. A single number such as the lifetime has no curve. Its effect is the range over the levels, relative to
their mean (effect.scalar).
"""

from collections.abc import Mapping

import polars as pl

from tracknoise.statistics.definitions import NAMES, POOLED, UNITS
from tracknoise.statistics.factors.differences import comparable, largest_differences, relative
from tracknoise.statistics.factors.factors import FACTORS, SCALARS, ReferenceCondition
from tracknoise.statistics.tracks.lifetimes import mean_lifetime
from tracknoise.statistics.upright import upright
from tracknoise.tables.defaults import MARGIN, POPULATION, TRIMMING
from tracknoise.tables.enumerations import Axis, Verdict, Weighting
from tracknoise.tables.schema import AXIS, CONDITION, CURVES, EFFECTS, LIFETIMES, OUTLIERS, VERDICT, Schema, check


def effects(
    curves: pl.DataFrame,
    lifetimes: pl.DataFrame,
    outliers: pl.DataFrame,
    *,
    reference: ReferenceCondition,
    population: str = POPULATION,
    trimming: str = TRIMMING,
    margin: float = MARGIN,
) -> pl.DataFrame:
    """Effect of every factor on every statistic, and whether it matters.

    Parameters
    ----------
    curves, lifetimes, outliers
        What the functions of these names (`outlier_ratios` for the last) returned for the same scenes.
    reference
        Where the other factors are held.
    population
        Which observations the errors are of: `visible` or `projected`.
    trimming
        Which errors: `trimmed`, as in the paper, or `untrimmed`.
    margin
        The largest effect that does not matter.

    Returns
    -------
    polars.DataFrame
        Schema `EFFECTS`: one row for each factor, combination of held values, and statistic. A factor matters (`yes`)
        if the effect exceeds `margin`. It does not (`no`) if the effect is at most `margin` and every level was
        compared with another. Otherwise the verdict is `undecided`, and `why` says what is missing. Turned images are
        compared in the axes of the upright image.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    points = _points(check(curves, CURVES, "curves"), {"population": population, "trimming": trimming}, reference)
    scalars = _scalars(lifetimes, outliers)
    questions = _questions(curves, lifetimes, outliers)
    tables = []
    for factor in FACTORS:
        asked, curved, single = (_held(table, factor, reference) for table in (questions, points, scalars))
        answers = pl.concat([_by_curves(curved, factor), _by_scalars(single, factor)], how="diagonal")
        tables.append(_levels(asked, factor).join(answers, on=[*_others(factor), "statistic"], how="left"))
    table = pl.concat(tables, how="diagonal").with_columns(
        margin=pl.lit(margin), n_levels=pl.col("levels").list.len(), n_pairs=pl.col("n_pairs").fill_null(0)
    )
    place = pl.col("factor").cast(pl.Enum(list(FACTORS)))
    table = table.with_columns(verdict=_verdict(), why=_why()).sort("dataset", place, *CONDITION, "order")
    return check(table.select(pl.col(name).cast(kind) for name, kind in EFFECTS.items()), EFFECTS, "effects")


def _points(curves: pl.DataFrame, errors: Mapping[str, str], reference: ReferenceCondition) -> pl.DataFrame:
    """The points of curves at which levels may be compared."""
    signed = pl.col("statistic").is_in([names["mean"] for names in NAMES.values()])
    chosen = curves.filter(**errors, weighting=Weighting.features)
    points = upright(comparable(chosen, reference.key_frames), signed=signed)
    return points.select(*POOLED, "statistic", "axis", "at", "u", "v")


def _scalars(lifetimes: pl.DataFrame, outliers: pl.DataFrame) -> pl.DataFrame:
    """Frames per track that ended, and pooled outlier ratio, of every condition: POOLED, statistic and value."""
    lived = mean_lifetime(check(lifetimes, LIFETIMES, "lifetimes"))
    rejected = check(outliers, OUTLIERS, "outliers")
    values = {"lifetime": (lived, "frames_per_end"), "outlier_ratio": (rejected, "pooled_ratio")}
    tables = [table.select(*POOLED, statistic=pl.lit(name), value=column) for name, (table, column) in values.items()]
    return pl.concat(tables).drop_nulls("value")


def _others(factor: str) -> list[str]:
    return [column for column in POOLED if column != factor]


def _held(table: pl.DataFrame, factor: str, reference: ReferenceCondition) -> pl.DataFrame:
    """Rows of a table in which all columns but the factor and those examined value by value are at their reference."""
    held = [column for column in CONDITION if column not in (factor, *FACTORS[factor])]
    return table.filter(**{column: getattr(reference, column) for column in held})


def _questions(curves: pl.DataFrame, *tables: pl.DataFrame) -> pl.DataFrame:
    """Every measured condition with every statistic: POOLED, statistic, its axis and unit, and its place in order."""
    axes = curves["axis"].unique().sort().to_list() or [Axis.age]
    curved = [(name, axis, UNITS[role]) for axis in axes for role, name in NAMES[axis].items()]
    single = [(name, None, unit) for name, unit in SCALARS.items()]
    kinds: Schema = {"statistic": pl.String, "axis": AXIS, "unit": pl.String}
    statistics = pl.DataFrame([*curved, *single], schema=dict(kinds), orient="row").with_row_index("order")
    return pl.concat([table.select(POOLED) for table in (curves, *tables)]).unique().join(statistics, how="cross")


def _levels(questions: pl.DataFrame, factor: str) -> pl.DataFrame:
    """One row for all levels of a factor, with their names."""
    keys = [*_others(factor), "order", "statistic", "axis", "unit"]
    return questions.group_by(keys).agg(factor=pl.lit(factor).first(), levels=pl.col(factor).sort().cast(pl.String))


def _by_curves(points: pl.DataFrame, factor: str) -> pl.DataFrame:
    """The pair of levels and the coordinate of the largest effect on each statistic that has curves."""
    keys = [*_others(factor), "statistic"]
    pairs = largest_differences(points, by=[*keys, "axis"], level=factor)
    counted = pairs.group_by(keys).agg(
        n_pairs=pl.struct("level_a", "level_b").n_unique().cast(pl.Int32),
        compared=pl.concat([pl.col("level_a"), pl.col("level_b")]).unique().cast(pl.String),
    )
    ordered = pairs.sort("effect", "coordinate", "level_a", "level_b", descending=[True, False, False, False])
    largest = ordered.unique(keys, keep="first", maintain_order=True).drop("axis")
    table = largest.join(counted, on=keys).join(_against_absolute(pairs, keys), on=keys, how="left")
    return table.with_columns(pl.col("level_a", "level_b").cast(pl.String))


def _against_absolute(pairs: pl.DataFrame, keys: list[str]) -> pl.DataFrame:
    """Largest difference in mean error of a pair of levels, relative to the variation of their mean absolute error."""
    places = [*(key for key in keys if key != "statistic"), "axis", "coordinate", "level_a", "level_b"]
    absolute = pl.col("statistic").is_in([names["absolute"] for names in NAMES.values()])
    mean = pl.col("statistic").is_in([names["mean"] for names in NAMES.values()])
    sizes = pairs.filter(absolute).select(*places, size="common")
    ratios = pairs.filter(mean).join(sizes, on=places).with_columns(share_of_absolute=relative("difference", "size"))
    return ratios.group_by(keys).agg(pl.col("share_of_absolute").max())


def _by_scalars(values: pl.DataFrame, factor: str) -> pl.DataFrame:
    """Effect on each statistic with one number per condition, by (effect.scalar)."""
    keys, value, level = [*_others(factor), "statistic"], pl.col("value"), pl.col(factor).cast(pl.String)
    found = (
        values.sort(*keys, factor)
        .group_by(keys, maintain_order=True)
        .agg(
            difference=value.max() - value.min(),
            common=value.mean(),
            level_a=level.get(value.arg_min()),
            level_b=level.get(value.arg_max()),
            compared=level,
            n_pairs=(pl.len() * (pl.len() - 1) // 2).cast(pl.Int32),
        )
    )
    several = found.filter(pl.col("compared").list.len() > 1)
    return several.with_columns(effect=relative("difference", "common"))


def _missing() -> pl.Expr:
    """Levels that were compared with no other."""
    return pl.col("levels").list.set_difference(pl.col("compared").fill_null([])).list.sort()


def _verdict() -> pl.Expr:
    matters = pl.when(pl.col("effect") > pl.col("margin")).then(pl.lit(Verdict.yes))
    known = matters.when((pl.col("effect") <= pl.col("margin")) & (_missing().list.len() == 0)).then(pl.lit(Verdict.no))
    return known.otherwise(pl.lit(Verdict.undecided)).cast(VERDICT)


def _why() -> pl.Expr:
    """What is missing for a verdict where it is undecided; null elsewhere."""
    decided = _verdict() != Verdict.undecided
    alone = pl.format("only one {} was measured: {}", "factor", pl.col("levels").list.first())
    nothing = pl.lit("no two levels have a point in common")
    missing = pl.format("nothing to compare {} {} by", "factor", _missing().list.join(", "))
    one = pl.col("n_levels") < 2
    return (
        pl.when(decided)
        .then(None)
        .when(one)
        .then(alone)
        .when(pl.col("effect").is_null())
        .then(nothing)
        .otherwise(missing)
    )
