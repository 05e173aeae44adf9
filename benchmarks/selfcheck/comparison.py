"""What the self-test compares: a row for each quantity with its limits, measured and known."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from enum import StrEnum

import numpy as np
import polars as pl

from benchmarks.selfcheck import reference
from benchmarks.selfcheck.known_worlds import UNKNOWN, Script
from benchmarks.selfcheck.reference import Trim
from tracknoise.exceptions import with_type
from tracknoise.experiments.measure import Measurement
from tracknoise.statistics.changes import change_curves
from tracknoise.statistics.curves import aspect_curves
from tracknoise.tables.schema import Schema
from tracknoise.tables.store import RunFolder
from tracknoise.topics.catalogue import RUN_TABLES

TOLERANCE = 1e-6
"""Largest difference from an exact value, relative to the larger of it and 1. Rounding stays below 1e-9."""


class Area(StrEnum):
    """Part of the package that a check is about. An area uses the results of those before it."""

    geometry = "true positions"
    visibility = "visibility"
    errors = "errors and ages"
    trimming = "trimming"
    curves = "curves"
    changes = "changes"
    lifetimes = "lifetimes"
    rates = "outlier ratio and counts"
    intervals = "intervals"
    zero_mean = "zero mean"
    growth = "growth"
    shape = "shape"
    factors = "factor effects"


SUSPECTS: dict[Area, str] = {
    Area.geometry: "sequences, geometry, truth",
    Area.visibility: "truth/visibility",
    Area.errors: "measurement",
    Area.trimming: "statistics/trimming and prepared",
    Area.curves: "statistics/curves, moments and prepared",
    Area.changes: "statistics/changes",
    Area.lifetimes: "statistics/lifetimes",
    Area.rates: "statistics/track_counts",
    Area.intervals: "inference and analysis/curve_intervals",
    Area.zero_mean: "analysis/zero_mean and inference/sign_flips",
    Area.growth: "analysis/time_structure",
    Area.shape: "analysis/gaussianity",
    Area.factors: "analysis/factors",
}
"""Folders or modules of the package that are responsible for each area."""

CHECKS: Schema = {
    "area": pl.Enum(Area),
    "world": pl.String,
    "quantity": pl.String,
    "n": pl.Int64,
    "n_wrong": pl.Int64,
    "place": pl.String,
    "expected": pl.String,
    "measured": pl.String,
}
"""One row per quantity of one world: how many values were compared, how many are wrong, and the one that is farthest
from its expected value. `place` says which value that is; it is null if the quantity has one value only.
"""


def exact(
    area: Area,
    world: str,
    expected: pl.DataFrame,
    measured: pl.DataFrame,
    *,
    values: Sequence[str],
    by: Collection[str] = (),
) -> pl.DataFrame:
    """Compare every value of two tables.

    Returns schema `CHECKS`. A row that only one of the tables has is wrong in all its values. `values`: the columns
    that are compared. All other columns of `expected` are keys. `by`: key columns of which each value is a quantity of
    its own.
    """
    keys = [name for name in expected.columns if name not in values]
    typed = measured.select(*(pl.col(name).cast(expected.schema[name]) for name in keys), *values, _there=pl.lit(1))
    known = expected.with_columns(_known=pl.lit(1))
    both = known.join(typed, on=keys, how="full", coalesce=True, nulls_equal=True, suffix="_measured").sort(keys)
    parts = both.partition_by(list(by), maintain_order=True) if by else [both]
    rows = [
        _compared(area, world, part, name, keys, by)
        for part in parts
        for name in values
        if part[name].null_count() + part[f"{name}_measured"].null_count() < 2 * part.height
    ]
    return pl.DataFrame(rows, schema=dict(CHECKS), orient="row")


def within(
    area: Area, world: str, quantity: str, value: float | None, *, low: float, high: float, n: int = 1
) -> pl.DataFrame:
    """Compare a number with limits that include them."""
    good = value is not None and low <= value <= high
    limits = f"{low:.4g} to {high:.4g}"
    row = (area, world, quantity, n, int(not good), None, limits, "none" if value is None else f"{value:.4g}")
    return pl.DataFrame([row], schema=dict(CHECKS), orient="row")


def answer(area: Area, world: str, quantity: str, found: Sequence[str], *, allowed: Collection[str]) -> pl.DataFrame:
    """Compare verdicts with those that are right; there must be at least one."""
    wrong = [verdict for verdict in found if verdict not in allowed]
    shown = wrong[0] if wrong else (found[0] if found else "none")
    expected = " or ".join(allowed)
    row = (area, world, quantity, len(found), len(wrong) if found else 1, None, expected, shown)
    return pl.DataFrame([row], schema=dict(CHECKS), orient="row")


def failed(area: Area, world: str, error: BaseException) -> pl.DataFrame:
    """The check that a world can be measured, which ended in an error."""
    row = (area, world, "measurement", 1, 1, None, "no error", with_type(error))
    return pl.DataFrame([row], schema=dict(CHECKS), orient="row")


def _compared(
    area: Area, world: str, part: pl.DataFrame, name: str, keys: Sequence[str], by: Collection[str]
) -> tuple[object, ...]:
    """A row of `CHECKS`: one column of some rows."""
    expected, measured = part[name], part[f"{name}_measured"]
    wrong, distance = _wrong(expected, measured)
    wrong = wrong | part["_known"].is_null().to_numpy() | part["_there"].is_null().to_numpy()
    worst = int(np.argmax(np.where(wrong, distance + 1.0, 0.0)))
    place = ", ".join(f"{key} {part[key][worst]}" for key in keys if key not in by)
    quantity = " ".join([*(str(part[key][0]) for key in by), name])
    return area, world, quantity, part.height, int(wrong.sum()), place, _text(expected[worst]), _text(measured[worst])


def _wrong(expected: pl.Series, measured: pl.Series) -> tuple[np.ndarray, np.ndarray]:
    """Whether each value is wrong, and by how much; by infinity where one of the two is missing."""
    if not expected.dtype.is_numeric():
        differs = expected.cast(pl.String).ne_missing(measured.cast(pl.String)).to_numpy()
        return differs, differs.astype(np.float64)
    a, b = (series.cast(pl.Float64).fill_null(np.nan).to_numpy() for series in (expected, measured))
    distance = np.where(np.isnan(a) & np.isnan(b), 0.0, np.nan_to_num(np.abs(a - b), nan=np.inf))
    return distance > TOLERANCE * np.maximum(1.0, np.nan_to_num(np.abs(a))), distance


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4f}"
    return "none" if value is None else str(value)


_LONG_LIVED_AGE = 5


def compare_tracks(
    world: str, measurement: Measurement, script: Script, trim: Trim, *, tracker: str, speed: int
) -> Iterator[pl.DataFrame]:
    """Compare every observation and track of one tracker with its script."""
    chosen = {"tracker": tracker, "speed": speed}
    observed, expected = measurement.observations.filter(**chosen), _observations(script, trim)
    for area, names in (
        (Area.geometry, ["u_true_px", "v_true_px"]),
        (Area.visibility, ["truth"]),
        (Area.errors, ["age", "u_px", "v_px", "du_px", "dv_px"]),
        (Area.trimming, ["kept"]),
    ):
        yield exact(area, world, expected.select("track", "frame", *names), observed, values=names)
    tracks, known = measurement.tracks.filter(**chosen), _tracks(script, trim)
    for area, names in (
        (Area.geometry, ["depth_m"]),
        (Area.errors, ["first_frame", "lifetime", "end"]),
        (Area.trimming, ["max_error_px", "kept"]),
    ):
        yield exact(area, world, known.select("track", *names), tracks, values=names)


def compare_statistics(
    world: str, run: RunFolder, scripts: Sequence[Script], trim: Trim, condition: Mapping[str, object], *, axis: str
) -> Iterator[pl.DataFrame]:
    """Compare the statistics of one condition with those of its scripts.

    `condition`: columns that identify the condition, and their values.
    """
    tables = {
        name: run.statistics(RUN_TABLES[name]).filter(**condition)
        for name in ("curves", "cores", "lifetimes", "counts")
    }
    keys = ["population", "trimming", "at"]
    curves = reference.curves(scripts, trim, axis=axis)
    measured = tables["curves"].filter(pl.col("weighting").is_in(["features", "scenes"]), axis=axis)
    values = ["n", "u", "v", "uv"]
    yield exact(Area.curves, world, curves, measured, values=values, by=["statistic"])
    cores = reference.cores(scripts, trim, axis=axis).select(*keys, "core_u_px", "core_v_px")
    yield exact(Area.curves, world, cores, tables["cores"], values=["core_u_px", "core_v_px"])
    survival = reference.survival(scripts)
    known = tables["lifetimes"].filter(pl.col("n_ended") + pl.col("n_censored") > 0)
    seen = survival.filter(pl.col("lifetime").is_in(known["lifetime"].to_list()))
    yield exact(Area.lifetimes, world, seen, known, values=["n_ended", "survival"])
    yield from _rates(world, run, scripts, condition)
    yield exact(Area.rates, world, reference.counts(scripts), tables["counts"].filter(pl.col("n") > 0), values=["n"])


def compare_aspects(
    world: str, run: RunFolder, scripts: Sequence[Script], condition: Mapping[str, object]
) -> Iterator[pl.DataFrame]:
    """Compare long-lived tracks and the correlation of changes with those of the scripts, untrimmed, by age."""
    aspects = (table.filter(**condition) for table in run.sequence_tables("aspects"))
    lived = aspect_curves(aspects, min_features=2).filter(
        aspect="long_lived", at_least=_LONG_LIVED_AGE, trimming="untrimmed"
    )
    long_lived = reference.long_lived(scripts, _LONG_LIVED_AGE)
    named = exact(Area.curves, world, long_lived, lived, values=["n", "u", "v", "uv"], by=["statistic"])
    yield named.with_columns(quantity=pl.format("{} of long-lived tracks", "quantity"))
    increments = (table.filter(**condition) for table in run.sequence_tables("increments"))
    changes = change_curves(increments).filter(trimming="untrimmed", lag=1)
    names = ["autocorrelation_u", "autocorrelation_v"]
    correlated = pl.DataFrame([(1, *reference.autocorrelation(scripts))], schema=["lag", *names], orient="row")
    yield exact(Area.changes, world, correlated, changes, values=names)


def _rates(
    world: str, run: RunFolder, scripts: Sequence[Script], condition: Mapping[str, object]
) -> Iterator[pl.DataFrame]:
    expected = reference.rates(scripts)
    summary, outliers = (run.statistics(RUN_TABLES[name]).filter(**condition) for name in ("summary", "outliers"))
    lived = pl.DataFrame({"mean_lifetime": [expected["mean_lifetime"]]})
    yield exact(Area.lifetimes, world, lived.with_columns(one=1), summary.with_columns(one=1), values=lived.columns)
    rejected = pl.DataFrame({"pooled_ratio": [expected["outlier_ratio"]]}, schema={"pooled_ratio": pl.Float64})
    yield exact(Area.rates, world, rejected.with_columns(one=1), outliers.with_columns(one=1), values=rejected.columns)


def _observations(script: Script, trim: Trim) -> pl.DataFrame:
    """What the table of observations must hold."""
    track, step = np.nonzero(script.alive)
    known = (script.status != "no_depth")[track, step, None]
    true_px, error_px = (np.where(known, values[track, step], np.nan) for values in (script.true_px, script.error_px))
    observed_px = script.observed_px[track, step]
    table = pl.DataFrame(
        {
            "track": track,
            "frame": script.frames[step],
            "age": reference.age(script)[track, step],
            **dict(zip(("u_px", "v_px"), observed_px.T, strict=True)),
            **dict(zip(("u_true_px", "v_true_px"), true_px.T, strict=True)),
            **dict(zip(("du_px", "dv_px"), error_px.T, strict=True)),
            "truth": script.status[track, step],
            "kept": reference.kept(script, trim)[track],
        }
    )
    return table.with_columns(pl.selectors.float().fill_nan(None))


def _tracks(script: Script, trim: Trim) -> pl.DataFrame:
    """What the table of tracks must hold."""
    table = pl.DataFrame(
        {
            "track": np.arange(len(script.alive)),
            "first_frame": script.frames[script.birth],
            "lifetime": script.alive.sum(axis=1),
            "end": pl.Series(script.end).replace(UNKNOWN, None),
            "depth_m": script.depth_m,
            "max_error_px": reference.threshold_px(script, trim)[1],
            "kept": reference.kept(script, trim),
        }
    )
    return table.with_columns(pl.selectors.float().fill_nan(None))
