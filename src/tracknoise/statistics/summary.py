"""The most important numbers, one row per condition."""

from collections.abc import Mapping

import polars as pl

from tracknoise.checks import require, require_whole
from tracknoise.statistics.definitions import NAMES, POOLED, REFERENCE_AGE
from tracknoise.statistics.lifetimes import mean_lifetime, median_survival
from tracknoise.statistics.prepared import check_population
from tracknoise.statistics.yardstick import shared_places
from tracknoise.tables.defaults import POPULATION
from tracknoise.tables.enumerations import Axis, FloorSource, Weighting
from tracknoise.tables.findings_schema import CORES, CURVES, FLOOR, OUTLIERS, SUMMARY
from tracknoise.tables.schema import TRIMMING, check, empty


def summary(
    curves: pl.DataFrame,
    lifetimes: pl.DataFrame,
    outliers: pl.DataFrame,
    *,
    cores: pl.DataFrame | None = None,
    floor: pl.DataFrame | None = None,
    age: int = REFERENCE_AGE,
    key_frame: int | Mapping[str, int] = 0,
    population: str = POPULATION,
) -> pl.DataFrame:
    """Lifetimes, outlier ratio, and errors at a reference age, of every condition.

    Parameters
    ----------
    curves, lifetimes, outliers
        What the functions of these names (`outlier_ratios` for the last) returned for the same scenes.
    cores
        What `tracknoise.statistics.scales.cores` made of these scenes; without it there are no cores.
    floor
        What `tracknoise.statistics.truth_errors.truth_floor` returned for these scenes; without it there is no truth
        floor.
    age
        The reference age is the same for all trackers of a view and speed: of the ages from 1 to this, in frames of the
        nominal sequence, the last of those at which most trackers have trimmed and untrimmed curves that are not cut.
        It differs between speeds whose frames do not coincide. At age 0 errors are zero by construction.
    key_frame
        If the axis of the curves is the frame: the frame in which errors are zero, for all directions or by direction.
        The reference frame is then the last one up to `age` frames after it.
    population
        Observations whose errors are used: `visible` or `projected`.

    Returns
    -------
    polars.DataFrame
        Schema `SUMMARY`, sorted by condition: every condition of any of the three tables. `outliers` has every
        condition that was measured. A condition without features has 0 tracks. Other missing values are null, and so
        are errors and their age if the tracker's curves are cut at the reference age. Features are pooled over scenes,
        except for core and beyond, see `CORES`.

    Raises
    ------
    UnknownNameError
        If there is no such population.
    SettingsError
        If the age or the key frame has another type.
    SchemaError
        If a table has other columns.
    """
    check_population(population)
    require_whole("age", age, 1)
    require(isinstance(key_frame, int | Mapping), "key_frame", key_frame, "a frame, or one of each direction")
    zero = pl.when(pl.col("axis") == Axis.frame).then(_key_frame(key_frame)).otherwise(0)
    chosen = (pl.col("at") > zero) & (pl.col("at") <= zero + age)
    points = check(curves, CURVES, "curves").filter(chosen, weighting=Weighting.features, population=population)
    lived = mean_lifetime(lifetimes).join(median_survival(lifetimes), on=POOLED)
    rejected = check(outliers, OUTLIERS, "outliers").select(*POOLED, outlier_ratio="pooled_ratio")
    scenes = lifetimes.group_by(POOLED).agg(pl.col("n_scenes").max())
    scales = check(empty(CORES) if cores is None else cores, CORES, "cores").filter(population=population)
    floors = check(empty(FLOOR) if floor is None else floor, FLOOR, "floor").filter(source=FloorSource.all)
    errors = _with_floor(_with_cores(_at_reference(points), scales), floors)
    parts = [scenes, lived, rejected, errors]
    table = pl.concat([part.select(POOLED) for part in (*parts, curves)]).unique()
    for part in parts:
        table = table.join(part, on=POOLED, how="left")
    table = table.with_columns(pl.col("n_tracks").fill_null(0))
    return check(table.select(*SUMMARY).sort(POOLED), SUMMARY, "summary")


def _key_frame(key_frame: int | Mapping[str, int]) -> pl.Expr:
    if isinstance(key_frame, int):
        return pl.lit(key_frame)
    return pl.col("direction").replace_strict(dict(key_frame), default=0, return_dtype=pl.Int64)


def _at_reference(points: pl.DataFrame) -> pl.DataFrame:
    """Errors of every condition, trimmed and untrimmed, at the place that its trackers share; both are there uncut."""
    usable = (pl.col("trimming").n_unique() == len(TRIMMING.categories)) & ~pl.col("cut").any()
    places = points.group_by(*POOLED, "axis", "at").agg(usable=usable).filter("usable")
    shared = shared_places(places, [name for name in (*POOLED, "axis") if name != "tracker"], "at")
    reference = places.join(shared, on=shared.columns).select(*POOLED, "axis", "at")
    return points.join(reference, on=reference.columns).group_by(*POOLED, "axis", "at").agg(**_columns())


def _with_cores(errors: pl.DataFrame, cores: pl.DataFrame) -> pl.DataFrame:
    """Errors at the reference, with the robust scales there."""
    names = ("core_u_px", "core_v_px", "beyond_u", "beyond_v")
    place = [*POOLED, "axis", "at"]
    for trimming in TRIMMING.categories:
        scales = cores.filter(trimming=trimming).select(*place, pl.col(names).name.prefix(f"{trimming}_"))
        errors = errors.join(scales, on=place, how="left")
    return errors


def _with_floor(errors: pl.DataFrame, floor: pl.DataFrame) -> pl.DataFrame:
    """Errors at the reference, with the truth floor there."""
    place = [*POOLED, "axis", "at"]
    values = {f"floor_{axis}_px": pl.col(f"floor_{axis}{axis}").sqrt() for axis in "uv"}
    values |= {f"floor_mean_{axis}_px": pl.col(f"mean_{axis}_px") for axis in "uv"}
    return errors.join(floor.select(*place, **values), on=place, how="left")


def _columns() -> dict[str, pl.Expr]:
    """The one value of each trimming, statistic and coordinate among the rows of a condition at one place."""
    columns = {}
    for trimming in TRIMMING.categories:
        columns[f"{trimming}_n"] = _value("n", trimming, "mean")
        for axis in "uv":
            columns[f"{trimming}_nu_{axis}_px"] = _value(axis, trimming, "mean")
            columns[f"{trimming}_eta_{axis}_px"] = _value(axis, trimming, "absolute")
            columns[f"{trimming}_rms_{axis}_px"] = _value(axis, trimming, "second").sqrt()
    return columns


def _value(column: str, trimming: str, statistic: str) -> pl.Expr:
    names = [called[statistic] for called in NAMES.values()]
    return pl.col(column).filter(pl.col("statistic").is_in(names), trimming=trimming).first()
