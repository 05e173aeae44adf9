"""The proof of a noise model on a run: what an estimator gains from it on scenes that it was not fitted to.

In the cheap proof, each track is triangulated with the true poses, to first order, by least squares that are weighted
with a covariance. Four covariances are compared: 1 px; the sigma for which residuals look right; the sigma for which
distances are as certain as claimed; and that of whole tracks. The two sigmas are learned from training scenes.

In a trial, errors are compared window by window with those of one sigma that was tuned for the newest pose: the ratio
is the geometric mean over windows (proof.ratio). An assumption helps if the whole 95 % interval of its ratio is below
0.98. It makes no difference if the interval lies within 0.98 to 1.02, and it hurts if all of it is above 1.02.
Otherwise the trial does not decide. An assumption is more consistent if |log NEES| of the newest pose is smaller, and
the interval of the change excludes 0.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from types import MappingProxyType

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import stats

from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators.advice import Gate
from tracknoise.estimators.learning import learn
from tracknoise.estimators.linear_window import PointTracks, fit_points, linear_tracks
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.proof_windows import (
    Cut,
    Division,
    Problem,
    are_exact,
    divided,
    errors_of,
    recorded_problems,
    scenes_of,
    with_joined_scenes,
)
from tracknoise.estimators.trial import (
    ADVISED,
    ALL_ARMS,
    ARMS,
    NEWEST,
    PLANTED,
    REFERENCE,
    SCALARS,
    Beliefs,
    Gated,
    Knee,
    one_sigma,
    try_arms,
    whole_tracks,
)
from tracknoise.exceptions import SettingsError
from tracknoise.inference.intervals import Method, column_means, pooled
from tracknoise.inference.track_noise import TrackNoise
from tracknoise.tables.store import RunFolder
from tracknoise.text import significant
from tracknoise.words import count

_LEVELS = (0.5, 0.9, 0.95, 0.99)
_HALF = float(stats.norm.ppf(0.75))
_QUANTITIES: Mapping[str, str] = MappingProxyType(
    {"error_ratio": "linear", "z_square": "log", **{f"coverage_{100 * level:.0f}": "logit" for level in _LEVELS}}
)
_ONE_PX = "1 px"
Covariances = Callable[[Problem], Sequence[NDArray[np.float64]]]


@dataclass(frozen=True, slots=True)
class Sigmas:
    """Standard deviations of training tracks, px: for which residuals, and for which distances, are right."""

    residual_px: float
    consistent_px: float


@dataclass(frozen=True, slots=True, eq=False)
class _Triangulated:
    """Of every track: relative error of its distance, that error over what was claimed, and residuals."""

    error: NDArray[np.float64]
    z: NDArray[np.float64]
    squares: float
    freedom: int


def learn_sigmas(problems: Sequence[Problem]) -> Sigmas:
    """Both standard deviations of windows of training scenes."""
    found = [_triangulated(problem, one_sigma(problem, 1.0)) for problem in problems]
    residual = sum(part.squares for part in found) / sum(part.freedom for part in found)
    consistent = np.median(np.abs(np.concatenate([part.z for part in found]))) / _HALF
    return Sigmas(float(np.sqrt(residual)), float(consistent))


def triangulate(problems: Sequence[Problem], sigmas: Sigmas, noise: TrackNoise) -> pl.DataFrame:
    """Errors and coverage of distances under each covariance, with intervals over scenes.

    `problems`: windows of scenes that nothing was learned from; `sigmas`: of training scenes; `noise`: components of
    the noise model. Returns one row per covariance and quantity: covariance, quantity, value, low, high, tracks,
    scenes. The error ratio is the geometric mean of errors over those with 1 px; z_square is the mean square error over
    the claimed one; coverage is the share of distances inside their claimed interval.
    """
    tried: Mapping[str, Covariances] = {
        _ONE_PX: lambda problem: one_sigma(problem, 1.0),
        "residual sigma": lambda problem: one_sigma(problem, sigmas.residual_px),
        "consistent sigma": lambda problem: one_sigma(problem, sigmas.consistent_px),
        "whole tracks": lambda problem: whole_tracks(problem, noise),
    }
    table = pl.concat([_rows(problem, tried) for problem in problems])
    sums = table.group_by("scene", "covariance").agg(pl.len().alias("n"), pl.exclude("scene", "covariance").sum())
    columns = [name for name in sums.columns if name not in ("scene", "covariance")]
    units = units_of(sums, points=["covariance"], columns=columns)
    found = pooled(units, np.empty((0, len(units.sums))), column_means, Method(), scales=list(_QUANTITIES.values()))
    labels = pl.DataFrame({"quantity": list(_QUANTITIES)}).join(units.points.select("covariance"), how="cross")
    tracks = np.tile(units.sums[..., 0].sum(axis=0), len(_QUANTITIES)).astype(np.int64)
    numbers = {"value": found.value, "low": found.low, "high": found.high, "scenes": found.n_scenes}
    flat = {name: np.broadcast_to(values, found.value.shape).ravel() for name, values in numbers.items()}
    bounded = labels.with_columns(tracks=pl.Series(tracks), **flat)
    numeric = pl.col("value", "low", "high").fill_nan(None)
    ratio = pl.when(pl.col("quantity") == "error_ratio").then(numeric.exp()).otherwise(numeric)
    return bounded.with_columns(ratio).select("covariance", "quantity", "value", "low", "high", "tracks", "scenes")


def _rows(problem: Problem, tried: Mapping[str, Covariances]) -> pl.DataFrame:
    """One row per track and covariance, with what is summed."""
    found = {name: _triangulated(problem, of(problem)) for name, of in tried.items()}
    reference = np.abs(found[_ONE_PX].error)
    parts = [
        pl.DataFrame(
            {
                "scene": problem.scene,
                "covariance": name,
                "log_error": np.log(np.abs(part.error) / reference),
                "z_square": part.z**2,
                **{
                    f"inside_{100 * level:.0f}": (np.abs(part.z) <= stats.norm.ppf(0.5 + level / 2.0)) * 1.0
                    for level in _LEVELS
                },
            }
        )
        for name, part in found.items()
    ]
    return pl.concat(parts)


def _triangulated(problem: Problem, covariances: Sequence[NDArray[np.float64]]) -> _Triangulated:
    parts = zip(problem.groups, errors_of(problem), covariances, strict=True)
    error, z, squares, freedom = [], [], 0.0, 0
    for group, errors, covariance in parts:
        tracks = PointTracks(group.frames, group.points)
        linear = linear_tracks(problem.camera, problem.world_from_camera, tracks)
        fitted = fit_points(linear.by_point, errors.reshape(len(errors), -1), covariance)
        distance = np.linalg.norm(linear.rays, axis=1)
        moved, over_claimed = fitted.along(linear.rays / distance[:, None])
        error.append(moved / distance)
        z.append(over_claimed)
        squares += float(np.square(fitted.residuals).sum())
        freedom += errors.size - 3 * len(errors)
    return _Triangulated(np.concatenate(error), np.concatenate(z), squares, freedom)


_LOW, _HIGH = 0.98, 1.02
_NEES = ("nees_newest", "nees_position", "nees_rotation", "nees_all", "innovations")
QUANTITIES: Mapping[str, str] = MappingProxyType(
    {
        "position_ratio": "linear",
        "rotation_ratio": "linear",
        **dict.fromkeys(_NEES, "log"),
        **{f"coverage_{100 * level:.0f}": "logit" for level in _LEVELS},
        "converged": "logit",
        "consistency": "linear",
    }
)
"""Quantities of an arm, and the scales of their intervals. Ratios are logarithms until these are made."""
_RATIOS = ("position_ratio", "rotation_ratio")


class Verdict(StrEnum):
    """What an assumption does to the error of the newest pose."""

    HELPS = "helps"
    NO_DIFFERENCE = "no difference"
    HURTS = "hurts"
    UNDECIDED = "undecided"


def summarise(trial: pl.DataFrame) -> pl.DataFrame:
    """Quantities of every arm with their intervals over scenes.

    Parameters
    ----------
    trial
        As `tracknoise.estimators.trial.try_arms` returns it, with the reference arm.

    Returns
    -------
    polars.DataFrame
        One row per arm and quantity of `QUANTITIES`: arm, title, quantity, value, low, high, windows, scenes. Bounds
        are null where there are fewer than 6 scenes.
    """
    table = _sums(trial)
    columns = [name for name in table.columns if name not in ("scene", "arm")]
    units = units_of(table, points=["arm"], columns=columns)
    names = units.points["arm"].to_list()
    found = pooled(units, np.empty((0, len(units.sums))), _quantities, Method(), scales=list(QUANTITIES.values()))
    labels = pl.DataFrame({"quantity": list(QUANTITIES)}).join(pl.DataFrame({"arm": names}), how="cross")
    windows = np.tile(units.sums[..., 0].sum(axis=0), len(QUANTITIES)).astype(np.int64)
    numbers = {"value": found.value, "low": found.low, "high": found.high, "scenes": found.n_scenes}
    flat = {name: np.broadcast_to(values, found.value.shape).ravel() for name, values in numbers.items()}
    titled = labels.with_columns(
        pl.col("arm").replace_strict(_titles()).alias("title"), windows=pl.Series(windows), **flat
    )
    numbers_of = pl.col("value", "low", "high").fill_nan(None)
    is_ratio = pl.col("quantity").is_in(_RATIOS)
    clean = titled.with_columns(pl.when(is_ratio).then(numbers_of.exp()).otherwise(numbers_of))
    return clean.select("arm", "title", "quantity", "value", "low", "high", "windows", "scenes")


def _titles() -> dict[str, str]:
    return {**{arm: title for arm, (title, _) in SCALARS.items()}, **{arm: own.title for arm, own in ARMS.items()}}


def _sums(trial: pl.DataFrame) -> pl.DataFrame:
    """Sums of each scene and arm: windows, then what `_quantities` divides by their number."""
    reference = trial.filter(arm=REFERENCE).select(
        "window", position_1="position_m", rotation_1="rotation_rad", nees_1="nees_newest"
    )
    inside = {
        f"inside_{100 * level:.0f}": pl.col("nees_newest") * NEWEST <= stats.chi2.ppf(level, NEWEST)
        for level in _LEVELS
    }
    paired = trial.join(reference, on="window").with_columns(
        log_position=(pl.col("position_m") / pl.col("position_1")).log(),
        log_rotation=(pl.col("rotation_rad") / pl.col("rotation_1")).log(),
        **inside,
    )
    summed = ("log_position", "log_rotation", *_NEES, *inside, "converged", "nees_1")
    return paired.group_by("scene", "arm").agg(pl.len().alias("n"), *(pl.col(name).sum() for name in summed))


def _quantities(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """(quantities, arms, ...) from sums (columns, arms, ...)."""
    n = np.where(sums[0] > 0, sums[0], np.nan)
    means = sums[1:] / n
    reference = np.abs(np.log(means[-1]))
    consistency = np.abs(np.log(means[2])) - reference
    return np.concatenate([means[:-1], consistency[None]])


def verdict(low: float | None, high: float | None) -> Verdict:
    """The decision on a ratio with these bounds."""
    if low is None or high is None:
        return Verdict.UNDECIDED
    if high < _LOW:
        return Verdict.HELPS
    if low > _HIGH:
        return Verdict.HURTS
    return Verdict.NO_DIFFERENCE if low >= _LOW and high <= _HIGH else Verdict.UNDECIDED


def sentence(summary: pl.DataFrame, arm: str) -> str:
    """What one arm does to the newest pose, compared with one tuned sigma."""
    rows = {row["quantity"]: row for row in summary.filter(arm=arm).to_dicts()}
    if not rows:
        return f"Arm {arm} was not tried."
    nees = rows["nees_newest"]
    compared = "; ".join(_compared(name, rows[f"{name}_ratio"]) for name in ("position", "rotation"))
    consistent = f"NEES of the newest pose is {_stated(nees)}; {_consistent(rows)}."
    title = str(nees["title"])
    return f"{title[:1].upper()}{title[1:]}: {compared}. {consistent}"


def _compared(name: str, row: Mapping[str, float | None]) -> str:
    return f"{name} errors are {_stated(row)} times those of one tuned sigma ({verdict(row['low'], row['high'])})"


def _consistent(rows: Mapping[str, Mapping[str, float | None]]) -> str:
    low, high = rows["consistency"]["low"], rows["consistency"]["high"]
    if low is None or high is None or low <= 0.0 <= high:
        return "whether it is more consistent is undecided"
    return "it is more consistent" if high < 0.0 else "it is less consistent"


def _stated(row: Mapping[str, float | None]) -> str:
    numbers = (row[name] for name in ("value", "low", "high"))
    value, low, high = (None if number is None else significant(number, 3) for number in numbers)
    return f"{value or 'unknown'} ({low} to {high})" if low and high else value or "unknown"


RUN_ARMS = tuple(arm for arm in ALL_ARMS if arm != PLANTED)
"""Arms that need no planted noise."""


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """What was found."""

    poses: pl.DataFrame  # as `tracknoise.estimators.proof.summarise` returns it
    distances: pl.DataFrame  # as `tracknoise.estimators.proof.triangulate` returns it
    sentences: tuple[str, ...]  # the answer first, then what limits it
    # training, tested: scenes that the arms learned from, and scenes they were tried on
    training: tuple[str, ...]
    tested: tuple[str, ...]


def prove(
    folder: RunFolder,
    model: NoiseModel,
    *,
    length: int = 11,
    per_sequence: int = 8,
    most_tracks: int = 80,
    seed: int = 0,
) -> Proof:
    """Try a noise model on the windows of a run.

    Parameters
    ----------
    folder
        Of a finished run that keeps its observations.
    model
        Its tracker and speed are tried. Scenes that it was fitted to are used for training if there are others. If it
        was fitted to none of them or to all, every second scene is. One scene is cut in two
        (`tracknoise.estimators.proof_windows`).
    length
        Processed frames of a window.
    per_sequence, most_tracks
        Most windows of a sequence, and most tracks of a window.
    seed
        Of the choice of tracks, and of where estimators start.

    Raises
    ------
    SettingsError
        If there are no such tracks, they have no errors, or the model has no noise; if there are too few windows, or
        true positions are fitted to the tracks.
    StoreError, SchemaError
        If the run keeps no observations, or a table is missing or damaged.
    """
    training = model.training
    if any(entry.truth_is_fitted for entry in folder.manifest().sequences.values()):
        raise SettingsError(f"{folder.path}: found true positions that are fitted to the tracks, expected true depths")
    if model.components.is_zero:
        raise SettingsError(f"noise of {training.tracker}: found a model whose components are all 0, expected noise")
    noise = model.components.per_frames(round(training.speed))
    problems = windows_for(folder, model, length=length, per_sequence=per_sequence, most_tracks=most_tracks, seed=seed)
    if problems and all(are_exact(problem) for problem in problems):
        raise SettingsError(f"{folder.path}: found no errors of {training.tracker}, expected a tracker that errs")
    parts = divided(folder, problems, training)
    beliefs = with_advice(learn(parts.learned_from, noise=noise), model, length)
    joined = with_joined_scenes(folder, parts.tested)
    poses = summarise(try_arms(joined, beliefs, arms=RUN_ARMS, seed=seed))
    distances = triangulate(joined, learn_sigmas(parts.learned_from), noise)
    found = [sentence(poses, arm) for arm in (ADVISED, "6")]
    return Proof(
        poses=poses,
        distances=distances,
        sentences=(*found, _distance_sentence(distances), *parts.limits, _tried(parts, joined)),
        training=scenes_of(parts.learned_from),
        tested=scenes_of(parts.tested),
    )


def with_advice(beliefs: Beliefs, model: NoiseModel, length: int) -> Beliefs:
    """The same with what a model says to set in windows of so many frames, if it has sigmas for windows."""
    try:
        found, filtered = (model.advise(kind, window=length) for kind in ("sliding_window", "filter"))
    except SettingsError:
        return beliefs
    assert found.knee_px is not None
    knee = Knee(sigma_px=found.sigma.value, knee_px=found.knee_px)
    gated = Gated(sigma_px=filtered.sigma.value, factor=filtered.gates[Gate.TRACK])
    return replace(beliefs, knees={**beliefs.knees, ADVISED: knee}, gated=gated)


def windows_for(
    folder: RunFolder, model: NoiseModel, *, length: int, per_sequence: int, most_tracks: int = 80, seed: int = 0
) -> list[Problem]:
    """Windows of a run that a noise model can be tried on: of its tracker and speed, without its outliers."""
    cut = Cut(
        tracker=model.training.tracker,
        speed=round(model.training.speed),
        length=length,
        per_sequence=per_sequence,
        most_tracks=most_tracks,
        most_px=model.outliers_beyond_px,
        seed=seed,
    )
    return recorded_problems(folder, cut)


def _distance_sentence(distances: pl.DataFrame) -> str:
    values = {(row["covariance"], row["quantity"]): row["value"] for row in distances.iter_rows(named=True)}
    shares = [f"{100.0 * values[name, 'coverage_95']:.0f} % with {use}" for name, use in _COVARIANCES.items()]
    return f"95 % intervals of triangulated distances contain the true one in {', '.join(shares)}."


_COVARIANCES = {
    "residual sigma": "the sigma that residuals suggest",
    "consistent sigma": "the consistent sigma",
    "whole tracks": "the covariance of whole tracks",
}


def _tried(parts: Division, joined: Sequence[Problem]) -> str:
    scenes, units = scenes_of(parts.tested), scenes_of(joined)
    groups = "" if len(units) == len(scenes) else f" in {count(len(units), 'group')}"
    found = f"Tried on {count(len(parts.tested), 'window')} of {count(len(scenes), 'scene')}{groups}"
    apart = set(scenes).isdisjoint(scenes_of(parts.learned_from))
    return f"{found} that nothing else was learned from." if apart else f"{found}."
