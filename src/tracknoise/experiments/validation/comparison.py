"""Compare what was measured in scripted worlds with the scripts, and with statistics that are computed from them."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import polars as pl

from tracknoise.experiments.measure import Measurement
from tracknoise.experiments.validation import reference
from tracknoise.experiments.validation.checks import Area, exact
from tracknoise.experiments.validation.reference import Trim
from tracknoise.experiments.validation.scripted import UNKNOWN, Script
from tracknoise.statistics.errors.change_curves import change_curves
from tracknoise.statistics.errors.curves import aspect_curves
from tracknoise.tables.store import RunFolder

_LONG_LIVED_AGE = 5


def compare_tracks(
    world: str, measurement: Measurement, script: Script, trim: Trim, *, tracker: str, speed: int
) -> Iterator[pl.DataFrame]:
    """Compare every observation and track of one tracker with its script.

    Parameters
    ----------
    world
        Name in `CHECKS`.
    measurement
        Of one sequence.
    script
        What the tracker reported there.
    trim
        How the measurement was trimmed.
    tracker, speed
        Which condition of it.
    """
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

    Parameters
    ----------
    world
        Name in `CHECKS`.
    run
        The run.
    scripts
        Of all scenes.
    trim
        How the scenes were trimmed.
    condition
        Columns that identify the condition, and their values.
    axis
        What curves run along.
    """
    tables = {name: run.statistics(name).filter(**condition) for name in ("curves", "cores", "lifetimes", "counts")}
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
    summary, outliers = (run.statistics(name).filter(**condition) for name in ("summary", "outliers"))
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
