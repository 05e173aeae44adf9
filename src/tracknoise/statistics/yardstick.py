"""Effects of factors by the paper's yardstick: the largest difference between levels, relative to common variation.

All other factors are held at their reference. The estimates are taken as they are, without intervals;
`tracknoise.analysis.factors` compares levels within scenes.

For curves c_l and c_m of one statistic and coordinate:

- difference = max over k of |c_l(k) - c_m(k)|, over the ages (frames) k that both curves have (effect.difference)
- common = range over the same k of (c_l(k) + c_m(k)) / 2, the zero at age 0 (in the key frame) included (effect.common)
- effect = difference / common (effect.pair)

Curves are compared in pairs because at different speeds they do not have the same ages: each pair is judged where both
were seen, and a pair that shares nothing is left out. The curves have features pooled and are not cut. Age 0 and the
key frame are left out, because errors are zero there by construction.

The effect on a statistic is the largest over pairs and over the coordinates u and v (effect). A single number such as
the lifetime has no curve. Its effect is the range over the levels, relative to their mean (effect.scalar).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import polars as pl

from tracknoise.statistics.definitions import NAMES, POOLED, UNITS, since_zero, upright
from tracknoise.statistics.lifetimes import mean_lifetime
from tracknoise.tables.defaults import MARGIN, POPULATION, TRIMMING
from tracknoise.tables.enumerations import Axis, Verdict, Weighting
from tracknoise.tables.findings_schema import CURVES, EFFECTS, LIFETIMES, OUTLIERS
from tracknoise.tables.schema import AXIS, CONDITION, VERDICT, Schema, check, typed

FACTORS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "tracker": (),
        "speed": ("tracker",),
        "lighting": ("tracker", "speed"),
        "rotation": ("tracker",),
        "direction": ("tracker",),
    }
)
"""For each factor, the columns of which each value is examined separately. Others are held at their reference."""
SCALARS: Mapping[str, str] = MappingProxyType({"lifetime": "frames", "outlier_ratio": "share"})
"""Statistics with one number per condition, and their units."""


@dataclass(frozen=True, slots=True)
class ReferenceCondition:
    """Where factors are held while another one varies."""

    # lighting, direction, camera: names as in the tables
    lighting: str
    rotation: int = 0  # degrees
    direction: str = "forward"
    speed: int = 1  # the nominal one
    # where curves run along frames: the one in which errors are zero, by direction
    key_frames: Mapping[str, int] = field(default_factory=dict)
    camera: str = ""


def shared_places(places: pl.DataFrame, by: Sequence[str], place: str) -> pl.DataFrame:
    """Where trackers are compared: the place that most trackers have, or the last of these.

    Parameters
    ----------
    places
        One row for each place of each tracker: columns of `by`, tracker and `place`.
    by
        Columns whose values are not compared with one another.
    place
        Name of a column: an age, a frame, or the length of a window.

    Returns
    -------
    polars.DataFrame
        Columns of `by` and `place`: one row for each combination of values.
    """
    counted = places.group_by(*by, place).agg(trackers=pl.col("tracker").n_unique())
    last = pl.col(place).sort_by("trackers", place).last()
    return (
        counted.with_columns(chosen=last.over(by) if by else last)
        .filter(pl.col(place) == pl.col("chosen"))
        .select(*by, place)
    )


def comparable(curves: pl.DataFrame, key_frames: Mapping[str, int]) -> pl.DataFrame:
    """The points of curves at which they may be compared: not cut, and where errors are not zero by construction.

    Parameters
    ----------
    curves
        Columns axis, direction, at and cut, besides any others.
    key_frames
        Where curves run along frames: the one in which errors are zero, by direction.

    Returns
    -------
    polars.DataFrame
        The same columns; `at` is an age, or counts frames from the key frame on (Int64).
    """
    return curves.with_columns(at=since_zero(key_frames)).filter(pl.col("at") != 0, ~pl.col("cut"))


def largest_differences(points: pl.DataFrame, *, by: list[str], level: str) -> pl.DataFrame:
    """Compare the curves of every pair of levels, by (effect.difference) and (effect.common).

    Parameters
    ----------
    points
        Columns of `by`, `level` (sortable), `at`, `u` and `v`, one row per point of a curve, without points at which
        errors are zero by construction.
    by
        Columns whose values are not compared with one another.
    level
        Column whose values are compared.

    Returns
    -------
    polars.DataFrame
        Columns of `by`, `coordinate`, `level_a` before `level_b`, `difference` and `at`, `common`, `effect` (infinite
        where levels differ and nothing varies, 0 where neither), `n_shared`. Pairs that share no place have no row.
    """
    values = points.select(*by, "at", pl.col(level).alias("level"), "u", "v").unpivot(
        ["u", "v"], index=[*by, "at", "level"], variable_name="coordinate", value_name="value"
    )
    joined = values.drop_nulls("value").join(values.drop_nulls("value"), on=[*by, "coordinate", "at"], suffix="_b")
    pairs = joined.filter(pl.col("level") < pl.col("level_b")).sort("at")
    apart, middle = (pl.col("value") - pl.col("value_b")).abs(), (pl.col("value") + pl.col("value_b")) / 2
    differences = pairs.group_by(*by, "coordinate", level_a="level", level_b="level_b").agg(
        difference=apart.max(),
        at=pl.col("at").get(apart.arg_max()),
        common=pl.max_horizontal(middle.max(), 0.0) - pl.min_horizontal(middle.min(), 0.0),
        n_shared=pl.len().cast(pl.Int32),
    )
    return differences.with_columns(effect=relative("difference", "common"))


def relative(difference: str, common: str) -> pl.Expr:
    """One column by another: infinite where the second is 0, unless the first is too: nothing differs then."""
    return pl.when(pl.col(difference) == 0).then(0.0).otherwise(pl.col(difference) / pl.col(common))


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
    return typed(table, EFFECTS)


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
    effects = (
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
    several = effects.filter(pl.col("compared").list.len() > 1)
    return several.with_columns(effect=relative("difference", "common"))


def _missing() -> pl.Expr:
    """Levels that were compared with no other."""
    return pl.col("levels").list.set_difference(pl.col("compared").fill_null([])).list.sort()


def _verdict() -> pl.Expr:
    matters = pl.when(pl.col("effect") > pl.col("margin")).then(pl.lit(Verdict.yes))
    decided = matters.when((pl.col("effect") <= pl.col("margin")) & (_missing().list.len() == 0)).then(
        pl.lit(Verdict.no)
    )
    return decided.otherwise(pl.lit(Verdict.undecided)).cast(VERDICT)


def _why() -> pl.Expr:
    """What is missing for a verdict where it is undecided; null elsewhere."""
    decided = _verdict() != Verdict.undecided
    alone = pl.format("only one {} was measured: {}", "factor", pl.col("levels").list.first())
    nothing = pl.lit("no two levels have a point in common")
    missing = pl.format("nothing to compare {} {} by", "factor", _missing().list.join(", "))
    has_one_level = pl.col("n_levels") < 2
    return (
        pl.when(decided)
        .then(None)
        .when(has_one_level)
        .then(alone)
        .when(pl.col("effect").is_null())
        .then(nothing)
        .otherwise(missing)
    )
