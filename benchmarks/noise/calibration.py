"""Whether predicted covariances describe the errors of other scenes, and whether a model fits its own.

Whether a model fits what it was fitted to is shown by how large errors are at each age, measured and by the model. Both
are the root of half the trace of the mean product of errors about the first position. The model's is
(error_products.expected) with the magnification that the tracks had.

Whether predicted covariances describe the errors of other scenes is their calibration. With d^2 = e' C^-1 e of an error
e of predicted covariance C:

- coverage: share of errors with d^2 below the quantile of chi square with two degrees of freedom at a level
- NEES: mean of d^2 / 2, which is 1 if the covariance is right, and larger if it claims too much
- negative log likelihood: mean of (log |C| + d^2) / 2 + log(2 pi), nat; lower is better
- ENCE: mean over errors, in up to ten classes of predicted variance, of |predicted - measured| / predicted standard
  deviation
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray

from benchmarks.noise.windows import fitted_scenes
from tracknoise.analysis.condition_units import groups_of_run, units_of
from tracknoise.estimators.model import Interval
from tracknoise.estimators.training import reference_view
from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.inference.conventions import LEVEL, IntervalKind
from tracknoise.inference.intervals import Method, pooled
from tracknoise.inference.units import Resampled, Units
from tracknoise.statistics.own_covariances import LEVELS, inside, relative
from tracknoise.tables.findings_schema import SUMMARY
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.schema import QUALITY_PREFIX
from tracknoise.tables.store import RunFolder

if TYPE_CHECKING:
    from tracknoise.estimators.noise_model import NoiseModel


Array = NDArray[np.float64]


_CLASSES = 10
_COLUMNS = ("n", *(f"inside_{100 * level:.0f}" for level in LEVELS), "squares", "nll")


@dataclass(frozen=True, slots=True, kw_only=True)
class Reliability:
    """Predicted and measured standard deviation of a class of errors, px, and how many there are.

    The measured one has an interval, where enough can be resampled.
    """

    predicted_px: float
    measured_px: float
    low_px: float | None = None
    high_px: float | None = None
    n: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """How well predicted covariances describe errors.

    Parameters
    ----------
    n, n_scenes
        Errors and scenes.
    n_trained
        Scenes among these that the model was fitted to.
    coverage
        By level, with intervals.
    nees, nll
        Of all errors, with intervals.
    ence
        Expected normalised calibration error.
    reliability
        By class of predicted variance.
    outlier_share
        Share of the errors that were left out, because they are outliers of the model.
    resampled
        What intervals are over; None where there are none.
    n_impossible
        Errors that were left out, because what is predicted for them is not positive definite.
    """

    n: int
    n_scenes: int
    n_trained: int
    coverage: dict[float, Interval]
    nees: Interval
    nll: Interval
    ence: float
    reliability: tuple[Reliability, ...]
    outlier_share: float
    resampled: Resampled | None
    n_impossible: int = 0


def check_model(model: "NoiseModel", folder: RunFolder, *, scenes: Collection[str] | None = None) -> Calibration:
    """Compare a model with errors of a run, of its tracker at its speed. The magnification of the image is taken as 1.

    The view is the one that models are fitted to (`tracknoise.estimators.training`).

    Parameters
    ----------
    model
        The model.
    folder
        Of a finished run.
    scenes
        Names of the scenes; by default all.

    Raises
    ------
    UnknownNameError, SettingsError
        If the run has no such scene, no errors of this tracker and speed, or none about the first position.
    StoreError, SchemaError
        If there is no finished run, or a table is damaged.
    """
    if any(entry.truth_is_fitted or entry.key_frame is not None for entry in folder.manifest().sequences.values()):
        raise SettingsError(
            f"{folder.path}: found errors that are not about the first position, expected a run whose truth is known "
            "for each first position (neither scan nor triangulated)"
        )
    samples = _chosen(folder, "samples", model.training.tracker, int(model.training.speed), scenes)
    view = samples.filter(**reference_view(samples))
    used = view.filter(pl.col("at").is_between(*model.training.ages))
    errors = used.select("scene", "du_px", "dv_px")
    covariance = model.covariance(age=used["at"].to_numpy()) if used.height else np.empty((0, 2, 2))
    good = np.hypot(*errors.select("du_px", "dv_px").to_numpy().T) <= model.outliers_beyond_px
    trained = fitted_scenes(model.training, samples["dataset"][0])
    outliers = 1.0 - float(good.sum()) / max(len(good), 1)
    return _calibration(errors.filter(good), covariance[good], folder, trained, outliers)


def check_own(
    folder: RunFolder, *, tracker: str, speed: int, name: str, scenes: Collection[str] | None = None
) -> Calibration:
    """Compare covariances that a front end reports itself with its errors.

    They are the columns ``quality_<name>_uu``, ``quality_<name>_uv`` and ``quality_<name>_vv`` of the observations,
    px^2. An error has the covariance of its observation plus that of the first position of its track
    (`tracknoise.statistics.own_covariances`). Observations that fix the true position do not count: their error is
    zero.

    Parameters
    ----------
    folder
        Of a finished run that keeps its observations.
    tracker, speed
        As in the run.
    name
        Of the columns.
    scenes
        Names of the scenes; by default all.

    Raises
    ------
    UnknownNameError, SettingsError
        If the run has no such scene, no such columns, errors or covariances, or true positions that are fitted to the
        tracks.
    StoreError, SchemaError
        If there is no finished run, or it does not keep its observations.
    """
    if any(entry.truth_is_fitted for entry in folder.manifest().sequences.values()):
        found = "true positions that are fitted to the tracks, and take part of their errors"
        raise SettingsError(f"{folder.path}: found {found}, expected true depths")
    columns = [f"{QUALITY_PREFIX}{name}_{entry}" for entry in ("uu", "uv", "vv")]
    observations = _chosen(folder, "observations", tracker, speed, scenes, partial(_of_errors, columns=columns))
    if missing := [column for column in columns if column not in observations.columns]:
        expected = f"tracks with the columns {', '.join(columns)}"
        raise SettingsError(f"{folder.path}: found no column {missing[0]} of {tracker}, expected {expected}")
    used = observations.drop_nulls(["du_px", *columns]).filter(pl.col("truth") == "valid")
    entries = used.select(_ENTRIES).to_numpy()
    possible = np.isfinite(entries).all(axis=1)
    if not possible.any():
        raise SettingsError(f"{folder.path}: found no covariance of {tracker} that is positive definite, expected some")
    errors = used.select("scene", "du_px", "dv_px").filter(possible)
    covariance = entries[possible][:, [0, 1, 1, 2]].reshape(-1, 2, 2)
    calibration = _calibration(errors, covariance, folder, frozenset(), 0.0)
    return replace(calibration, n_impossible=int(np.count_nonzero(~possible)))


_ENTRIES = ("error_uu", "error_uv", "error_vv")
"""Covariance of the errors, px^2; NaN where it is not positive definite."""


def _of_errors(table: pl.DataFrame, entry: SequenceEntry, columns: Sequence[str]) -> pl.DataFrame:
    """Observations outside of the frame that fixes the true position of their track, with the columns `_ENTRIES`."""
    at, zero = ("age", 0) if entry.key_frame is None else ("frame", entry.key_frame)
    if not table.height or not {*columns} <= {*table.columns}:
        return table.filter(pl.col(at) != zero)
    known = table.with_columns(pl.col(columns).fill_nan(None))
    stated = known.select(pl.col(columns).cast(pl.Float64).fill_null(np.nan)).to_numpy()
    track = known["track"].to_numpy().astype(np.intp)
    found = relative(stated, track, (known[at] == zero).to_numpy())
    return known.with_columns(map(pl.Series, _ENTRIES, found.T)).filter(pl.col(at) != zero)


def _every(table: pl.DataFrame, _: SequenceEntry) -> pl.DataFrame:
    return table


def _chosen(
    folder: RunFolder,
    name: str,
    tracker: str,
    speed: int,
    scenes: Collection[str] | None,
    prepare: Callable[[pl.DataFrame, SequenceEntry], pl.DataFrame] = _every,
) -> pl.DataFrame:
    """Rows of one table of all sequences, of a tracker, a speed, and some scenes."""
    folder.statistics(SUMMARY)
    entries = folder.manifest().sequences
    known = {entry.sequence.scene for entry in entries.values()}
    for scene in scenes or ():
        if scene not in known:
            raise UnknownNameError("scene", scene, known)
    mine = (pl.col("tracker") == tracker) & (pl.col("speed") == speed)
    keys = [key for key, entry in sorted(entries.items()) if scenes is None or entry.sequence.scene in scenes]
    tables = [prepare(folder.sequence_table(name, key).filter(mine), entries[key]) for key in keys]
    found = pl.concat(tables, how="diagonal")
    if found.is_empty():
        raise SettingsError(f"{folder.path}: found no errors of {tracker} at speed {speed}, expected some")
    return found


def _calibration(
    errors: pl.DataFrame, covariance: Array, folder: RunFolder, trained: frozenset[str], outlier_share: float
) -> Calibration:
    if errors.is_empty():
        raise SettingsError(f"{folder.path}: found no errors at the ages of the model, expected some")
    if not (np.linalg.det(covariance) > 0.0).all():
        raise SettingsError("noise model: found a singular covariance, expected noise in both coordinates")
    vectors = errors.select("du_px", "dv_px").to_numpy()
    squared = np.einsum("ni,nij,nj->n", vectors, np.linalg.inv(covariance), vectors)
    nll = 0.5 * (np.log(np.linalg.det(covariance)) + squared) + np.log(2.0 * np.pi)
    scenes = errors["scene"].unique().to_list()
    coverage, nees, mean_nll, resampled = _estimates(errors["scene"], squared, nll, folder)
    classes = _reliability(errors["scene"], vectors, covariance, folder)
    return Calibration(
        n=errors.height,
        n_scenes=len(scenes),
        n_trained=len(trained.intersection(scenes)),
        coverage=coverage,
        nees=nees,
        nll=mean_nll,
        ence=_ence(classes),
        reliability=classes,
        outlier_share=outlier_share,
        resampled=resampled,
    )


def _estimates(
    scene: pl.Series, squared: Array, nll: Array, folder: RunFolder
) -> tuple[dict[float, Interval], Interval, Interval, Resampled | None]:
    """Coverage by level, NEES and negative log likelihood, with intervals, and what these are over."""
    held = [within.astype(np.float64) for within in inside(squared)]
    values = dict(zip(_COLUMNS, [np.ones_like(squared), *held, squared, nll], strict=True))
    units = _units(scene, values, folder, points=[])
    found = pooled(
        units,
        np.zeros((0, len(units.sums))),
        lambda sums: np.concatenate([sums[1:5] / sums[0], sums[5:6] / (2.0 * sums[0]), sums[6:] / sums[0]]),
        Method(IntervalKind.student, LEVEL),
        scales=[*["logit"] * len(LEVELS), "log", "linear"],
    )
    bounds = (found.value[:, 0], found.low[:, 0], found.high[:, 0])
    *coverage, nees, mean = (_interval(*row) for row in zip(*bounds, strict=True))
    return dict(zip(LEVELS, coverage, strict=True)), nees, mean, units.resampled


def _units(scene: pl.Series, values: Mapping[str, Array], folder: RunFolder, *, points: Sequence[str]) -> Units:
    """Sums of values by scene, and by those of them that are points."""
    dataset = next(iter(folder.manifest().sequences.values())).sequence.dataset
    table = pl.DataFrame({"scene": scene, "dataset": dataset, **values})
    columns = [name for name in values if name not in points]
    return units_of(table, points=points, columns=columns, groups=groups_of_run(folder))


def _interval(value: float, low: float, high: float) -> Interval:
    bounds = [None if np.isnan(bound) else float(bound) for bound in (low, high)]
    return Interval(value=float(value), low=bounds[0], high=bounds[1])


def _reliability(scene: pl.Series, vectors: Array, covariance: Array, folder: RunFolder) -> tuple[Reliability, ...]:
    """Classes by predicted variance, with about as many errors each; equal predictions are of one class."""
    predicted = 0.5 * np.trace(covariance, axis1=1, axis2=2)
    fewer = pl.Series(predicted).rank("min").to_numpy() - 1.0
    values = {
        "class": np.floor(fewer * _CLASSES / len(predicted)),
        "n": np.ones_like(predicted),
        "predicted": predicted,
    }
    units = _units(scene, {**values, "measured": 0.5 * np.square(vectors).sum(axis=1)}, folder, points=["class"])
    found = pooled(
        units,
        np.zeros((0, len(units.sums))),
        lambda sums: np.sqrt(sums[1:] / np.where(sums[0] > 0.0, sums[0], np.nan)),
        Method(IntervalKind.student, LEVEL),
        scales=["log", "log"],
    )
    (sigmas, measured), counts = found.value, units.sums[..., 0].sum(axis=0)
    bounds = [_interval(*row) for row in zip(measured, found.low[1], found.high[1], strict=True)]
    return tuple(
        Reliability(predicted_px=float(sigma), measured_px=one.value, low_px=one.low, high_px=one.high, n=int(count))
        for sigma, one, count in zip(sigmas, bounds, counts, strict=True)
    )


def _ence(classes: Sequence[Reliability]) -> float:
    distances = [abs(one.predicted_px - one.measured_px) / one.predicted_px for one in classes]
    return float(np.average(distances, weights=[one.n for one in classes]))
