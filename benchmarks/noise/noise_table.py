"""The table of noise of a run: one row per tracker, speed and motion.

The table has second moments, standard deviations for estimators, and bias. Each number says what it is of:

- errors: second moment about zero, and mean, of errors about the first position, by age.
- changes: second moment about zero of what errors change from one observation to the next, all ages together. These are
  the innovations of an estimator that predicts an observation from the one before.
- sigma: one standard deviation for all observations, by what it makes right (`Purpose`), for points that are solved for
  in windows of one length. It is that of the noise model that is fitted to the same scenes.
- bias: the correction of the mean error that is warranted, if any (`tracknoise.estimators.fit`). The level of its
  interval is that of all rows together, by Bonferroni.

Outliers are counted and left out, as in the noise model.
"""

import json
from collections.abc import Collection, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import polars as pl

from tracknoise.estimators.fit import components_of, equivalents_of, fit_bias
from tracknoise.estimators.lookup_table import LEAST, noise_lookup
from tracknoise.estimators.model import Bias, BiasKind, Interval, Landmark, Purpose
from tracknoise.estimators.training import TrainingTables, all_training_tables, chosen_conditions
from tracknoise.exceptions import SettingsError
from tracknoise.inference.conventions import LEVEL
from tracknoise.tables.enumerations import Product
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict

WINDOW = 10
"""Length of windows, frames of the tracker."""
_SHORTEST = 3
"""Two observations of a point have a single degree of freedom more than the point."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondMoment:
    """Second moment about zero of n errors, px^2, and their mean, px, at an age in frames; of all ages if it is None.

    The mean of changes is not known.
    """

    age: int | None
    n: int
    uu: float
    uv: float
    vv: float
    mean_u: float | None = None
    mean_v: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseRow:
    """One row of the table."""

    # tracker, speed: as in the run
    tracker: str
    speed: int
    motion: str | None  # group of the scenes; None for all scenes together
    scenes: tuple[str, ...]  # names
    # n, outlier_share: errors, and the share of them that is left out
    n: int
    outlier_share: float
    errors: tuple[SecondMoment, ...]  # by age
    changes: SecondMoment | None  # of all ages; None if there are fewer than `LEAST`
    # By purpose, px. Empty where there are too few errors for a noise model, and `why` says so.
    sigma: dict[Purpose, Interval]
    bias: Bias  # mean error
    why: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NoiseTable:
    """Rows of a run, and what looking them up gains on scenes that were left out."""

    rows: tuple[NoiseRow, ...]  # for each tracker and speed, all motions together, then each motion
    gains: pl.DataFrame  # schema `NOISE_LOOKUP`
    window: int  # length of the windows that the standard deviations are for, frames of the tracker
    level: float  # of all intervals
    truth: TruthVerdict  # the verdict on the truth of the run


def noise_table(
    folder: RunFolder,
    *,
    trackers: Collection[str] | None = None,
    speeds: Collection[int] | None = None,
    window: int = WINDOW,
    level: float = LEVEL,
) -> NoiseTable:
    """The table of a run.

    Parameters
    ----------
    folder
        Of a finished run.
    trackers, speeds
        Of the rows; by default all. The gains are those of all.
    window
        Length of windows, frames of the tracker.
    level
        Of the intervals.

    Raises
    ------
    UnknownNameError, SettingsError
        If there is no such tracker or speed, or windows have fewer than three frames.
    StoreError, SchemaError
        If the run holds no sums for noise models, or a table is damaged.
    """
    if window < _SHORTEST:
        raise SettingsError(f"noise table: found windows of {window} frames, expected at least {_SHORTEST}")
    wanted = chosen_conditions(folder, trackers=trackers, speeds=speeds)
    read = all_training_tables(folder, wanted)
    parts = [(tables, motion) for tables in read for motion in (None, *_motions(tables))]
    corrected = 1.0 - (1.0 - level) / len(parts)
    rows = tuple(_row(tables, motion, window, level, corrected) for tables, motion in parts)
    gains = noise_lookup(folder.stored_tables("noise_sums"), groups=read[0].groups, level=level)
    return NoiseTable(rows=rows, gains=gains, window=window, level=level, truth=TruthVerdict.of_run(folder))


def _motions(read: TrainingTables) -> list[str]:
    """Names of the groups; none if scenes have none, or all are of one."""
    found = sorted(set(read.groups.names.values()))
    return found if len(found) > 1 else []


def _row(read: TrainingTables, motion: str | None, window: int, level: float, corrected: float) -> NoiseRow:
    some = read if motion is None else read.of_scenes(_scenes(read, motion))
    outliers = some["noise_outliers"]
    sums = some["noise_sums"]
    sigma, why = _sigma(some, window, level)
    total = int(outliers["n"].sum())
    return NoiseRow(
        tracker=some.tracker,
        speed=some.speed,
        motion=motion,
        scenes=some.scenes,
        n=total,
        outlier_share=int(outliers["n_outliers"].sum()) / max(total, 1),
        errors=tuple(_by_age(sums.filter(product=Product.error))),
        changes=next(_moments(sums.filter(product=Product.change).with_columns(age=None)), None),
        sigma=sigma,
        bias=_bias(some, corrected),
        why=why,
    )


def _scenes(read: TrainingTables, motion: str) -> list[str]:
    return [scene for (_, scene), name in read.groups.names.items() if name == motion and scene in read.scenes]


def _sigma(read: TrainingTables, window: int, level: float) -> tuple[dict[Purpose, Interval], str | None]:
    """Standard deviations by purpose, or why there are none."""
    try:
        fitted = components_of(read, level=level)
    except SettingsError as error:
        return {}, str(error)
    found = equivalents_of(read, fitted, (window,))
    return {one.purpose: one.sigma for one in found if one.landmark is Landmark.FREE}, None


def _bias(read: TrainingTables, level: float) -> Bias:
    if read["noise_sums"].is_empty():
        return Bias(kind=BiasKind.REFUSED, why="there are no errors")
    curves = read.truth.audit_curves
    return fit_bias(read["noise_sums"], read["floors"], groups=read.groups, level=level, audit_curves=curves)


def _by_age(sums: pl.DataFrame) -> Iterator[SecondMoment]:
    """Second moments and means by age."""
    of_age = sums.group_by("age").agg((pl.col("sum_u", "sum_v").sum() / pl.col("n").sum()).name.prefix("mean_"))
    means = {age: (u, v) for age, u, v in of_age.iter_rows()}
    for one in _moments(sums):
        if one.age is not None:
            u, v = means[one.age]
            yield SecondMoment(age=one.age, n=one.n, uu=one.uu, uv=one.uv, vv=one.vv, mean_u=u, mean_v=v)


def _moments(sums: pl.DataFrame) -> Iterator[SecondMoment]:
    """Second moments by age, where there are enough errors."""
    entries = pl.col("uu", "uv", "vv").sum()
    found = sums.group_by("age").agg(pl.col("n").sum(), entries).filter(pl.col("n") >= LEAST).sort("age")
    for age, n, *values in found.iter_rows():
        uu, uv, vv = (value / n for value in values)
        yield SecondMoment(age=age, n=n, uu=uu, uv=uv, vv=vv)


FORMAT = "tracknoise.noise-table/1"
_COLUMNS: Mapping[str, type[pl.DataType]] = {
    "tracker": pl.String,
    "speed": pl.Int64,
    "motion": pl.String,
    "n_scenes": pl.Int64,
    "estimand": pl.String,
    "age": pl.Int64,
    "n": pl.Int64,
    **dict.fromkeys(("uu_px2", "uv_px2", "vv_px2", "mean_u_px", "mean_v_px", "bias_u_px", "bias_v_px"), pl.Float64),
    "bias_per_motion": pl.Float64,
    **dict.fromkeys(("sigma_px", "sigma_low_px", "sigma_high_px"), pl.Float64),
}


def noise_table_csv(table: NoiseTable) -> str:
    """One row per tracker, speed, motion and estimand, and per age of errors; empty where a column does not apply.

    The estimands are `error about the first position`, `change between observations`, and `sigma: PURPOSE`. bias is the
    correction that is warranted, empty where none is: px, or per px of motion.
    """
    rows = [
        {"tracker": row.tracker, "speed": row.speed, "motion": row.motion, "n_scenes": len(row.scenes), **one}
        for row in table.rows
        for one in _estimands(row)
    ]
    return pl.DataFrame(rows, schema=dict(_COLUMNS), orient="row").write_csv()


def noise_table_json(table: NoiseTable) -> str:
    """The whole table with reasons, and the gains on scenes that were left out; what is unknown is null."""
    document = {
        "format": FORMAT,
        "window": table.window,
        "level": table.level,
        "truth": asdict(table.truth),
        "rows": [asdict(row) for row in table.rows],
        "gains": table.gains.to_dicts(),
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _estimands(row: NoiseRow) -> Iterator[dict[str, Any]]:
    bias = dict(zip(row.bias.ages, row.bias.mean_px, strict=True))
    for one in row.errors:
        u, v = bias.get(one.age or 0, (None, None))
        per_motion = row.bias.per_motion or None
        corrected = {"bias_u_px": u, "bias_v_px": v, "bias_per_motion": per_motion}
        yield {"estimand": "error about the first position", **_moment(one), **corrected}
    if row.changes is not None:
        yield {"estimand": "change between observations", **_moment(row.changes)}
    for purpose, sigma in row.sigma.items():
        bounds = {"sigma_px": sigma.value, "sigma_low_px": sigma.low, "sigma_high_px": sigma.high}
        yield {"estimand": f"sigma: {purpose}", "n": row.n, **bounds}


def _moment(one: SecondMoment) -> dict[str, Any]:
    entries = {f"{name}_px2": getattr(one, name) for name in ("uu", "uv", "vv")}
    return {"age": one.age, "n": one.n, **entries, "mean_u_px": one.mean_u, "mean_v_px": one.mean_v}
