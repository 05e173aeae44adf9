"""A table of noise by tracker, speed and motion: second moments, standard deviations for estimators, and bias.

Each number says what it is of:

- errors: second moment about zero, and mean, of errors about the first position, by age.
- changes: second moment about zero of what errors change from one observation to the next, all ages together. These
  are the innovations of an estimator that predicts an observation from the one before.
- sigma: one standard deviation for all observations, by what it makes right (`Purpose`), for points that are solved
  for in windows of one length. It is that of the noise model that is fitted to the same scenes.
- bias: the correction of the mean error that is warranted, if any (`tracknoise.noise_models.fitting.bias`). The level
  of its interval is that of all rows together, by Bonferroni.

Outliers are counted and left out, as in the noise model. The motion of a scene is its group.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import polars as pl

from tracknoise.exceptions import SettingsError
from tracknoise.noise_models.fitting.bias import fit_bias
from tracknoise.noise_models.fitting.fit import components_of, equivalents_of
from tracknoise.noise_models.fitting.training_tables import TrainingTables, all_training_tables, chosen_conditions
from tracknoise.noise_models.lookup.gains import LEAST, noise_lookup
from tracknoise.noise_models.model import Bias, BiasKind, Interval, Landmark, Purpose
from tracknoise.tables.defaults import LEVEL
from tracknoise.tables.enumerations import Product
from tracknoise.tables.store import RunFolder

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
    """One row of the table.

    Parameters
    ----------
    tracker, speed
        As in the run.
    motion
        Group of the scenes; None for all scenes together.
    scenes
        Names.
    n, outlier_share
        Errors, and the share of them that is left out.
    errors
        By age.
    changes
        Of all ages; None if there are fewer than `LEAST`.
    sigma
        By purpose, px. Empty where there are too few errors for a noise model, and `why` says so.
    bias
        Mean error.
    """

    tracker: str
    speed: int
    motion: str | None
    scenes: tuple[str, ...]
    n: int
    outlier_share: float
    errors: tuple[SecondMoment, ...]
    changes: SecondMoment | None
    sigma: dict[Purpose, Interval]
    bias: Bias
    why: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NoiseTable:
    """Rows of a run, and what looking them up gains on scenes that were left out.

    Parameters
    ----------
    rows
        For each tracker and speed, all motions together, then each motion.
    gains
        Schema `NOISE_LOOKUP`.
    window
        Length of the windows that the standard deviations are for, frames of the tracker.
    level
        Of all intervals.
    """

    rows: tuple[NoiseRow, ...]
    gains: pl.DataFrame
    window: int
    level: float


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
    return NoiseTable(rows=rows, gains=gains, window=window, level=level)


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
    curves = read.audit_curves
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
