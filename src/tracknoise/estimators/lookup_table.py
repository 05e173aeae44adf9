"""Tables of noise by tracker, speed and motion, and how well they predict scenes that were left out.

The motion of a scene is its group.

Gains
-----

Each scene is predicted by the other scenes, looked up by tracker, by tracker and speed, or by tracker, speed and
motion. A second moment about zero S of n errors at one age, of which the table says C, has the log likelihood of a
Gaussian

    l = -n (log |C| + tr(C^-1 S)) / 2    (lookup.likelihood)

without its constant. The gain of one table over another is the difference of the sums of l over scenes, conditions and
ages, per error, in nat. Tables are compared at equal ages, where every one of them rests on `LEAST` errors of other
scenes.

By which factor the second moment of a scene in one condition typically differs from the table is

    exp(mean of |log(tr S / tr C)|)    (lookup.factor)

where S and C are summed over ages. Every scene and condition counts the same.

Intervals are Student's. They are over groups of scenes if there are at least `MIN_SCENES` of these, if any group has
two scenes, which predict each other, so that their gains are the same but for chance, or if scenes are too few to be
compared within groups. Such an interval contains the differences between motions. Otherwise intervals are over scenes,
within their groups if there are any, and then hold for these groups only. Gains of n scenes of one group are correlated
by 1 / (n - 1)^2, as squared distances from the means of the others are, so that these intervals are wider by the root
of n / (n - 1) of the smallest group. A group with one scene has no other scene of its motion.

The table
---------

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
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
from math import prod
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.estimators.fit import components_of, equivalents_of, fit_bias
from tracknoise.estimators.model import Bias, BiasKind, Interval, Landmark, Purpose
from tracknoise.estimators.training import TrainingTables, all_training_tables, chosen_conditions, reference_view
from tracknoise.exceptions import SettingsError
from tracknoise.inference.conventions import LEVEL, IntervalKind
from tracknoise.inference.jackknife import student_interval
from tracknoise.inference.units import NO_GROUPS, Resampled, SceneGroups, by_number, scheme
from tracknoise.statistics.grouping import group_rows
from tracknoise.tables.enumerations import Lookup, Product
from tracknoise.tables.findings_schema import NOISE_LOOKUP
from tracknoise.tables.schema import check, empty
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict

Array = NDArray[np.float64]

_SUMS = ("n", "uu", "uv", "vv")
_KEYS = ("dataset", "scene", "rotation", "direction", "tracker", "speed", "product", "age")
_LOOKED_UP = (Product.error, Product.change)
USED = (*_KEYS, *_SUMS)
"""Columns of `tracknoise.tables.schema.NOISE_SUMS` that are read."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneSums:
    """Sums of one product of one dataset."""

    scenes: tuple[str, ...]  # names, sorted
    # (scenes,): Number of the group of each scene. A scene without a group has a number of its own.
    motion: NDArray[np.intp]
    # (scenes,): number of the unit of intervals that each scene is part of: its group, or the scene itself
    unit: NDArray[np.intp]
    resampled: Resampled  # what the units are
    conditions: tuple[tuple[str, int], ...]  # trackers and speeds, sorted
    sums: Array  # (scenes, conditions, ages, 4): count, and sums of uu, uv and vv, px^2

    def count(self, lookup: Lookup) -> int:
        """Number of rows of a table."""
        motions = len(np.unique(self.motion)) if lookup is Lookup.motion else 1
        return (int(self._row(lookup).max()) + 1) * motions

    def left_out(self, lookup: Lookup) -> Array:
        """What a table was made of without the scene that is looked up in it, (scenes, conditions, ages, 4)."""
        row = self._row(lookup)
        own = np.stack([self.sums[:, row == one].sum(axis=1) for one in range(row.max() + 1)], axis=1)
        motion = self.motion if lookup is Lookup.motion else np.zeros_like(self.motion)
        every = np.empty_like(own)
        for one in np.unique(motion):
            every[motion == one] = own[motion == one].sum(axis=0)
        return np.asarray((every - own)[:, row])

    def _row(self, lookup: Lookup) -> NDArray[np.intp]:
        """Number of the row that each condition is looked up in, among those of one motion, (conditions,)."""
        if lookup is Lookup.one:
            return np.zeros(len(self.conditions), dtype=np.intp)
        if lookup is Lookup.tracker:
            return np.unique([name for name, _ in self.conditions], return_inverse=True)[1]
        return np.arange(len(self.conditions))

    def alone(self, lookup: Lookup) -> NDArray[np.bool_]:
        """Scenes that are the only ones of all of their rows, (scenes,)."""
        return np.asarray((self.left_out(lookup)[..., 0].sum(axis=-1) == 0.0).all(axis=1))


def condensed(sums: pl.DataFrame) -> pl.DataFrame:
    """Sums of the products `error` and `change`, all lightings and cameras together.

    Returns: columns `USED`. `sums`: with at least the columns `USED`.
    """
    some = sums.filter(pl.col("product").is_in(_LOOKED_UP))
    groups = group_rows(some, _KEYS)
    return groups.keys.hstack(groups.sums(some, _SUMS))


def scene_sums(sums: pl.DataFrame, groups: SceneGroups) -> Iterator[tuple[str, Product, SceneSums]]:
    """Sums of each dataset and product."""
    for dataset in sums["dataset"].unique().sort():
        for product in _LOOKED_UP:
            some = sums.filter(dataset=dataset, product=product)
            if some.height:
                yield dataset, product, _dense(some, dataset, groups)


def _dense(table: pl.DataFrame, dataset: str, groups: SceneGroups) -> SceneSums:
    scene, condition, age = (group_rows(table, by) for by in (["scene"], ["tracker", "speed"], ["age"]))
    shape = scene.count, condition.count, age.count
    cell = np.ravel_multi_index((scene.index, condition.index, age.index), shape)
    columns = [np.bincount(cell, table[name].to_numpy(), prod(shape)).reshape(shape) for name in _SUMS]
    scenes = scene.keys["scene"].to_list()
    named = [groups.names.get((dataset, name), name) for name in scenes]
    motion = np.unique(named, return_inverse=True)[1]
    units = _units(groups.of(dataset, scenes))
    return SceneSums(tuple(scenes), motion, *units, tuple(condition.keys.rows()), np.stack(columns, axis=-1))


def _units(group: NDArray[np.intp]) -> tuple[NDArray[np.intp], Resampled]:
    """Units of intervals, and what they are.

    Of two scenes in a group, each predicts the other one, so that their gains are the same but for chance.
    """
    sizes, kind = np.bincount(group), scheme(group)
    if (kind is None and sizes.max() > 1) or (kind == Resampled.within and (sizes == 2).any()):
        kind = Resampled.groups
    units = group if kind == Resampled.groups else np.arange(len(group))
    return np.asarray(units, dtype=np.intp), kind or Resampled.scenes


LEAST = 50
"""Fewest errors at one age that a covariance rests on."""
LEAST_UNITS = 4
"""Fewest groups, or scenes, for an interval."""


@dataclass(frozen=True, slots=True, eq=False)
class _Predicted:
    """What a table predicts of each scene that is left out."""

    # (scenes, conditions, ages): (lookup.likelihood), nat; NaN where the table rests on too few errors
    likelihood: Array
    trace: Array  # (scenes, conditions, ages): sum of tr C over the errors of the scene, px^2


def noise_lookup(
    sums: Iterable[pl.DataFrame], *, groups: SceneGroups = NO_GROUPS, level: float = LEVEL
) -> pl.DataFrame:
    """Gains of tables, each over one covariance for all and over the next coarser table.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `NOISE_SUMS`.
    groups
        Groups of scenes, such as those of one motion.
    level
        Of the intervals.

    Returns
    -------
    polars.DataFrame
        Schema `NOISE_LOOKUP`. A table that has no more rows than a coarser one is left out. Without rows if there is
        nothing to look up by.
    """
    tables = [condensed(table) for table in sums if not table.is_empty()]
    if not tables:
        return empty(NOISE_LOOKUP)
    together = pl.concat(tables)
    rows = [
        {"dataset": dataset, "product": product, "level": level, **row}
        for dataset, product, found in scene_sums(together.filter(**reference_view(together)), groups)
        for row in _comparisons(found, level)
    ]
    return check(pl.DataFrame(rows, schema=dict(NOISE_LOOKUP), orient="row"), NOISE_LOOKUP, "noise lookup")


def _comparisons(sums: SceneSums, level: float) -> Iterator[dict[str, Any]]:
    """Rows of one product, the coarsest table first."""
    lookups = _that_differ(sums)
    predicted = {lookup: _predicted(sums, lookup) for lookup in lookups}
    for before, lookup in pairwise(lookups):
        for against in dict.fromkeys((Lookup.one, before)):
            row = _compared(sums, predicted[lookup], predicted[against], level)
            yield {"lookup": lookup, "against": against, **row, "why": _why(sums, lookup, row)}


def _that_differ(sums: SceneSums) -> list[Lookup]:
    """Tables each of which has more rows than the one before."""
    counts = {lookup: sums.count(lookup) for lookup in Lookup}
    return [one for place, one in enumerate(Lookup) if not place or counts[one] > counts[list(Lookup)[place - 1]]]


def _predicted(sums: SceneSums, lookup: Lookup) -> _Predicted:
    trained, own = sums.left_out(lookup), sums.sums
    n = np.where(trained[..., 0] >= LEAST, trained[..., 0], np.nan)
    uu, uv, vv = (trained[..., place] / n for place in (1, 2, 3))
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = uu * vv - uv**2
        squares = (vv * own[..., 1] - 2.0 * uv * own[..., 2] + uu * own[..., 3]) / determinant
        likelihood = -0.5 * (own[..., 0] * np.log(determinant) + squares)
    return _Predicted(np.where(np.isfinite(likelihood), likelihood, np.nan), own[..., 0] * (uu + vv))


def _compared(sums: SceneSums, table: _Predicted, other: _Predicted, level: float) -> dict[str, Any]:
    """What one table gains over another one, with intervals."""
    n = sums.sums[..., 0]
    there = ~np.isnan(table.likelihood) & ~np.isnan(other.likelihood) & (n > 0)
    gain = np.where(there, table.likelihood - other.likelihood, 0.0).sum(axis=(1, 2))
    gained = _mean(sums, gain, np.where(there, n, 0.0).sum(axis=(1, 2)), level)
    factors = [_factor(sums, one, there, level) for one in (table, other)]
    known = there.any(axis=(1, 2))
    return {
        "n": int(n[there].sum()),
        "n_scenes": int(known.sum()),
        "n_units": len(np.unique(sums.unit[known])),
        "resampled": sums.resampled,
        "kind": IntervalKind.student,
        **dict(zip(("gain_nats", "low", "high"), gained, strict=True)),
        **dict(zip(("factor", "factor_low", "factor_high"), factors[0], strict=True)),
        **dict(zip(("factor_against", "factor_against_low", "factor_against_high"), factors[1], strict=True)),
        "established": None if gained[1] is None else gained[1] > 0.0,
    }


def _factor(
    sums: SceneSums, table: _Predicted, there: NDArray[np.bool_], level: float
) -> tuple[float | None, float | None, float | None]:
    """(lookup.factor), with bounds."""
    measured = np.where(there, sums.sums[..., 1] + sums.sums[..., 3], 0.0).sum(axis=2)
    expected = np.where(there, table.trace, 0.0).sum(axis=2)
    known = (measured > 0.0) & (expected > 0.0)
    logs = np.abs(np.log(np.where(known, measured, 1.0) / np.where(known, expected, 1.0))).sum(axis=1)
    found = _mean(sums, logs, known.sum(axis=1).astype(np.float64), level)
    value, low, high = (None if bound is None else float(np.exp(max(bound, 0.0))) for bound in found)
    return value, low, high


def _mean(sums: SceneSums, total: Array, count: Array, level: float) -> tuple[float | None, float | None, float | None]:
    """Sum of totals over sum of counts, (scenes,) each, with bounds; None where there is none."""
    held, gained = by_number(sums.unit, count), by_number(sums.unit, total)
    some = held > 0.0
    held, gained = held[some], gained[some]
    if not len(held):
        return None, None, None
    value = gained.sum() / held.sum()
    group = sums.motion[some] if sums.resampled == Resampled.within else None
    if len(held) < LEAST_UNITS or not _vary(group):
        return float(value), None, None
    without = (gained.sum() - gained) / (held.sum() - held)
    bounds = student_interval(value, without, level=level, sizes=held, groups=group)
    low, high = (float(value + _wider(group) * (bound - value)) for bound in bounds)
    return float(value), low, high


def _vary(group: NDArray[np.intp] | None) -> bool:
    """Whether there are units to resample: within groups, at least one of several scenes."""
    return group is None or len(np.unique(group)) < len(group)


def _wider(group: NDArray[np.intp] | None) -> float:
    """By which factor intervals within groups are wider, as scenes of a group predict each other."""
    if group is None:
        return 1.0
    sizes = np.unique(group, return_counts=True)[1]
    least = sizes[sizes > 1].min()
    return float(np.sqrt(least / (least - 1)))


def _why(sums: SceneSums, lookup: Lookup, row: dict[str, Any]) -> str | None:
    """Why nothing, or no interval, is known; None if both are."""
    if row["gain_nats"] is None:
        alone = lookup is Lookup.motion and sums.alone(lookup).all()
        return _ALONE if alone else f"no covariance rests on {LEAST} errors of other scenes"
    if row["low"] is None:
        units = "groups of scenes" if sums.resampled == Resampled.groups else "scenes"
        return f"only {row['n_units']} {units} can be left out; at least {LEAST_UNITS} are needed"
    return None


_ALONE = "each motion has only one scene, so that none can be left out"


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
