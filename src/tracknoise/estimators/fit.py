"""The fit of a noise model to the scenes of a run: bias, tails, and all other parts.

For the mean error two forms are tried: a mean by age, and an error along the motion of the image, e = beta f, with the
motion f of the true position since the frame before. Each is fitted to all scenes but one, in turn. It removes a share
of the second moment of the errors of the scene that was left out:

    sum(2 b' e - b' b) / sum(e' e)    (bias.reduction)

Scenes of one group are left out together if there are enough groups. However few scenes there are, whole scenes are
left out: tracks of a scene share its mean error, so that they would agree on it anyway. A correction by the mean error
is warranted if this share is at least `LEAST_REDUCTION`, its interval does not reach 0, the mean is more than twice
what the errors of the truth may cause, and no faults of the truth that an audit found explain it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import units_of
from tracknoise.analysis.truth_shares import audited_mean
from tracknoise.estimators.components import FittedComponents, fit_components, group_numbers, matrix, sums_of_units
from tracknoise.estimators.equivalents import LENGTHS, STATE_LENGTH, equivalents, gates
from tracknoise.estimators.errors_in_common import CommonErrors
from tracknoise.estimators.kernels import LENGTH, drawn_windows, tried_kernels
from tracknoise.estimators.linear_window import Rig
from tracknoise.estimators.model import (
    Bias,
    BiasKind,
    Equivalent,
    Interval,
    Kernel,
    Landmark,
    Purpose,
    Tails,
    Training,
    TriedGate,
)
from tracknoise.estimators.pose_trials import known_points, tried_gate
from tracknoise.estimators.run_time_conditions import conditions_of
from tracknoise.estimators.track_scale import fit_track_scale
from tracknoise.estimators.training import (
    MOST_RECORDINGS,
    Recording,
    TrainingTables,
    Windows,
    pinhole,
    recorded_camera,
    windows,
)
from tracknoise.estimators.two_cameras import TwoCameras
from tracknoise.exceptions import SettingsError
from tracknoise.geometry.pose import from_quaternion
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.densities import Student, fit_student, moments, terms
from tracknoise.inference.jackknife import student_interval
from tracknoise.inference.survival import kaplan_meier
from tracknoise.inference.track_noise import TrackNoise, error_covariances
from tracknoise.inference.units import NO_GROUPS, SceneGroups, by_number
from tracknoise.statistics.truth_errors import truth_floor
from tracknoise.tables.enumerations import Axis, FloorSource, Product
from tracknoise.text import without_folders

Array = NDArray[np.float64]

LEAST_REDUCTION = 0.01
_BEYOND_FLOOR = 2.0
_LEAST = 50
_BIAS_COLUMNS = ("n", "sum_u", "sum_v", "along", "motion", "squares")


@dataclass(frozen=True, slots=True, eq=False)
class _Form:
    """One form of the mean error: how large it is (px), and its reduction."""

    bias: Bias
    size_px: float
    reduction: Interval


def fit_bias(
    sums: pl.DataFrame,
    floors: pl.DataFrame,
    *,
    groups: SceneGroups,
    level: float,
    audit_curves: pl.DataFrame | None = None,
) -> Bias:
    """The correction that is warranted, or why none is.

    `sums`: schema `NOISE_SUMS`, of one tracker and speed. `floors`: schema `FLOORS`, of the same. `audit_curves`: None
    where it has not been audited yet.
    """
    errors = sums.filter(pl.col("product") == Product.error).with_columns(squares=pl.col("uu") + pl.col("vv"))
    units = units_of(errors, points=["age"], columns=_BIAS_COLUMNS)
    every = by_number(group_numbers(errors.unique("scene").sort("scene"), groups), units.sums)
    own = every[every[..., -1].sum(axis=1) > 0.0]
    if len(own) < 2:
        few = "there is only one scene" if len(every) < 2 else "errors are 0 in all scenes but one at most"
        return Bias(kind=BiasKind.REFUSED, why=f"{few}, so that none can be left out")
    ages = units.points["age"].to_numpy()
    best = max((_by_age(own, ages, level), _along(own, level)), key=lambda form: form.reduction.value)
    if reason := _objection(best, floors, int(ages.max())) or _audited(sums, audit_curves, int(ages.max())):
        return Bias(kind=BiasKind.REFUSED, why=reason, reduction=best.reduction)
    return best.bias


def _by_age(own: Array, ages: NDArray[np.int64], level: float) -> _Form:
    total = own.sum(axis=0)
    rest = total - own
    mean = _mean_error(rest)
    removed = (2.0 * mean * own[..., 1:3]).sum(axis=(1, 2)) - (own[..., 0] * np.square(mean).sum(axis=2)).sum(axis=1)
    known = total[:, 0] >= _LEAST
    every = _mean_error(total)
    size = float(np.sqrt(np.average(np.square(every).sum(axis=1), weights=total[:, 0])))
    reduction = _reduction(removed, own, level)
    bias = Bias(
        kind=BiasKind.BY_AGE,
        why="the mean error depends on the age of the track, and scenes that were left out agree",
        ages=tuple(ages[known].tolist()),
        mean_px=tuple((float(u), float(v)) for u, v in every[known]),
        reduction=reduction,
    )
    return _Form(bias, size, reduction)


def _mean_error(sums: Array) -> Array:
    """Mean error (..., ages, 2); 0 where there are fewer than `_LEAST` errors."""
    n = sums[..., :1]
    return np.where(n >= _LEAST, sums[..., 1:3] / np.maximum(n, 1.0), 0.0)


def _along(own: Array, level: float) -> _Form:
    along, motion = own[..., 3].sum(axis=1), own[..., 4].sum(axis=1)
    slope = (along.sum() - along) / np.maximum(motion.sum() - motion, 1e-300)
    reduction = _reduction(2.0 * slope * along - slope**2 * motion, own, level)
    every = float(along.sum() / max(motion.sum(), 1e-300))
    bias = Bias(
        kind=BiasKind.ALONG_MOTION,
        why="the mean error is along the motion of the image, and scenes that were left out agree",
        per_motion=every,
        reduction=reduction,
    )
    return _Form(bias, abs(every) * float(np.sqrt(motion.sum() / own[..., 0].sum())), reduction)


def _reduction(removed: Array, own: Array, level: float) -> Interval:
    """(bias.reduction) of all units together, with its interval over them."""
    squares = own[..., -1].sum(axis=1)
    value = removed.sum() / squares.sum()
    left = np.maximum(squares.sum() - squares, 1e-300)
    low, high = student_interval(value, (removed.sum() - removed) / left, level=level, sizes=squares)
    return Interval.of(float(value), float(low), float(high))


def _objection(form: _Form, floors: pl.DataFrame, last_age: int) -> str | None:
    """Why a correction is not warranted; None if it is."""
    if form.reduction.value < LEAST_REDUCTION:
        return f"it would change the second moment of new scenes by less than {100 * LEAST_REDUCTION:g} %"
    if form.reduction.low is None or form.reduction.low <= 0.0:
        return "scenes that were left out do not agree on it"
    floor = _mean_floor(floors, last_age)
    if floor is None:
        return "the errors of the truth are unknown"
    if form.size_px <= _BEYOND_FLOOR * floor:
        return "errors of the truth may cause the mean error"
    return None


def _audited(sums: pl.DataFrame, audit_curves: pl.DataFrame | None, last_age: int) -> str | None:
    """Why a correction is not warranted where an audit found faults of the truth; None if it is."""
    cover = None if audit_curves is None else audited_mean(audit_curves, sums["tracker"][0], last_age)
    covered = cover is not None and cover.is_covered
    return "faults of the truth that the audit found explain the mean error" if covered else None


def _mean_floor(floors: pl.DataFrame, last_age: int) -> float | None:
    """Largest standard deviation of the mean error that the truth may cause, px; None if it is unknown."""
    of_all = truth_floor(floors).filter(
        pl.col("source") == FloorSource.all, pl.col("axis") == Axis.age, pl.col("at").is_between(1, last_age)
    )
    length = (pl.col("mean_u_px").pow(2) + pl.col("mean_v_px").pow(2)).sqrt()
    found = of_all.select(length.max()).item()
    return None if found is None or of_all["mean_u_px"].null_count() else float(found)


_FOLDS = 5
_MOST = 30_000
_GAUSSIAN = 200.0
"""Degrees of freedom that cannot be distinguished from a Gaussian."""
_ROUNDING = 1e-12
"""Ratio of two variances of which the smaller one may be rounding."""


def fit_tails(samples: pl.DataFrame, noise: TrackNoise, *, last_age: int, groups: SceneGroups = NO_GROUPS) -> Tails:
    """Fit Student's t to single errors; none where the components have noise in one direction only.

    `samples`: schema `SAMPLES`, of one tracker and speed; `noise`: with all components, as one that is dropped
    makes errors of some ages look like tails.
    """
    used = samples.filter(pl.col("at") <= last_age)
    used = used.gather_every(max(1, -(-used.height // _MOST)))
    if used.height < _LEAST or not _is_in_all_directions(noise):
        return Tails(nu=math.inf, core_sigma=_core(used, noise), core_ratio=1.0)
    points = _whitened(used, noise)
    student = fit_student(terms([points]))
    ratio = float(np.linalg.det(matrix(student.scatter[0])) ** 0.25)
    nu = float(student.nu[0])
    if nu >= 0.99 * _GAUSSIAN or _gain(points, _folds(group_numbers(used, groups))) <= 0.0:
        nu, ratio = math.inf, 1.0
    return Tails(nu=nu, core_sigma=ratio * _core(used, noise), core_ratio=ratio)


def _is_in_all_directions(noise: TrackNoise) -> bool:
    """Whether errors of an age above 0 have a covariance of full rank."""
    least, largest = np.linalg.eigvalsh(sum(noise))
    return bool(least > _ROUNDING * largest)


def _whitened(samples: pl.DataFrame, noise: TrackNoise) -> Array:
    """Errors in units of the standard deviations of the model at their ages, (n, 2)."""
    errors = samples.select("du_px", "dv_px").to_numpy()
    roots = np.linalg.cholesky(_covariances(samples, noise))
    return np.asarray(np.linalg.solve(roots, errors[:, :, None])[:, :, 0])


def _core(samples: pl.DataFrame, noise: TrackNoise) -> float:
    """Root mean square of the standard deviations of the model at the ages of the sample, px."""
    if samples.is_empty():
        return 0.0
    return float(np.sqrt(0.5 * np.trace(_covariances(samples, noise), axis1=1, axis2=2).mean()))


def _covariances(samples: pl.DataFrame, noise: TrackNoise) -> Array:
    age = samples["at"].to_numpy().astype(np.float64)
    one = np.ones_like(age)
    return error_covariances(noise, age, one, one)


def _folds(group: NDArray[np.intp]) -> NDArray[np.intp]:
    """A number for each error, the same for all of a group; of halves of the sample where there is one group."""
    places = group % _FOLDS
    return places if len(np.unique(places)) > 1 else (np.arange(len(group)) * 2 // len(group)).astype(np.intp)


def _gain(points: Array, folds: NDArray[np.intp]) -> float:
    """What Student's t gains over a Gaussian on errors of scenes that were left out, nat in all."""
    total = 0.0
    for fold in np.unique(folds):
        rest, left = terms([points[folds != fold]]), terms([points[folds == fold]])
        student = fit_student(rest)
        mean, covariance = moments(rest.sum(axis=2))
        gaussian = Student(mean, covariance, np.array([_GAUSSIAN]))
        total += float((student.log_density(left) - gaussian.log_density(left)).sum())
    return total


def fitted_fields(read: TrainingTables) -> dict[str, Any]:
    """Fields of `tracknoise.estimators.noise_model.NoiseModel`, fitted to a run.

    Raises
    ------
    SettingsError
        If errors cannot be fitted, or tracks do not follow the images.
    """
    if read.truth.verdict.are_tracks_wrong:
        raise SettingsError(read.truth.verdict.sentence)
    sums = read["noise_sums"]
    fitted = components_of(read, level=LEVEL)
    last_age = int(sums["age"].max())  # type: ignore[arg-type]
    outliers = read["noise_outliers"]
    by_length = _windows(read, LENGTHS)
    common = common_of(read, level=LEVEL)
    alone = _equivalents(read, fitted, {**by_length, **_windows(read, [STATE_LENGTH])}, common)
    pair = TwoCameras.of(read["pair_tracks"], by_length, _limit_px(outliers))
    sigmas = alone if pair is None else pair.equivalents(alone, read.groups, LEVEL)
    kernels, gate_trial = _tried(read, by_length[LENGTH], sigmas, LEVEL, pair)
    tails = fit_tails(read["samples"], fitted.undropped, last_age=last_age, groups=read.groups)
    points = known_points(
        read["noise_tracks"],
        fitted.noise,
        tails,
        lengths=LENGTHS,
        speed=read.speed,
        most_px=_limit_px(outliers),
        common=common,
        groups=read.groups,
        level=LEVEL,
    )
    conditions = conditions_of(read["noise_covariates"], read["noise_pairs"], fitted, groups=read.groups, level=LEVEL)
    return {
        "training": _training(read),
        "camera": recorded_camera({key: read.of_sequence("cameras", key) for key in read.keys}),
        **fitted.components,
        "tails": tails,
        "outlier_share": outliers["n_outliers"].to_numpy().sum() / outliers["n"].to_numpy().sum(),
        "outliers_beyond_px": _limit_px(outliers),
        "conditions": conditions,
        "track_scale": fit_track_scale(read["track_errors"], sums, conditions, groups=read.groups, level=LEVEL),
        "bias": fit_bias(sums, read["floors"], groups=read.groups, level=LEVEL, audit_curves=read.truth.audit_curves),
        "common_share": None if common is None else common.share,
        "truth_floor_px": _floor(read["floors"], last_age),
        "truth": read.truth.verdict,
        "equivalents": sigmas,
        "kernels": kernels,
        "gate_trial": gate_trial,
        "known_points": points if pair is None else pair.known_points(points),
        "of_both": None if pair is None else pair.trial(LENGTH, read.groups, LEVEL),
    }


def components_of(read: TrainingTables, *, level: float) -> FittedComponents:
    """Components of the noise, fitted to the sums of the tables."""
    return fit_components(sums_of_units(read["noise_sums"], read.groups), level=level)


def common_of(read: TrainingTables, *, level: float) -> CommonErrors | None:
    """Errors that features of a frame have in common, by the tables."""
    return CommonErrors.of(read["rigid"], read["noise_sums"], groups=read.groups, level=level)


def equivalents_of(read: TrainingTables, fitted: FittedComponents, lengths: Sequence[int]) -> tuple[Equivalent, ...]:
    """Standard deviations for all observations, for windows of some lengths of the sequences of the tables."""
    by_length = _windows(read, lengths)
    alone = _equivalents(read, fitted, by_length, common_of(read, level=fitted.level))
    pair = TwoCameras.of(read["pair_tracks"], by_length, _limit_px(read["noise_outliers"]))
    return alone if pair is None else pair.equivalents(alone, read.groups, fitted.level)


def _windows(read: TrainingTables, lengths: Sequence[int]) -> dict[int, Windows]:
    """Windows of the sequences of the tables, by length."""
    longest = max(*LENGTHS, *lengths)
    lifetimes, recordings = lengths_of_tracks(read["ends"], longest=longest), _recordings(read, longest)
    return {length: windows(recordings, speed=read.speed, length=length, lifetimes=lifetimes) for length in lengths}


def _equivalents(
    read: TrainingTables, fitted: FittedComponents, by_length: Mapping[int, Windows], common: CommonErrors | None
) -> tuple[Equivalent, ...]:
    noise = fitted.noise.per_frames(read.speed)
    limit_px, found = _limit_px(read["noise_outliers"]), list[Equivalent]()
    for length, some in by_length.items():
        limits = gates(read["window_noise"], length, limit_px=limit_px, window=some.each[0], noise=noise)
        found.extend(equivalents(fitted, some, length=length, speed=read.speed, gates=limits, common=common))
    return tuple(found)


def _tried(
    read: TrainingTables, some: Windows, sigmas: Sequence[Equivalent], level: float, pair: TwoCameras | None
) -> tuple[tuple[Kernel, ...], TriedGate | None]:
    """Robust losses, and the gate of a filter, tried on the sampled tracks of a run; none where it has no sample."""
    tracks, cameras = (read["noise_tracks"], 1) if pair is None else (pair.tracks, 2)
    if pair is not None:
        some = replace(some, each=[[group.of_both for group in window] for window in some.each])
    if tracks.is_empty():
        return (), None
    of_window = {one.purpose: one for one in sigmas if one.landmark is Landmark.FREE and one.window == LENGTH}
    drawn, dataset = list(drawn_windows(tracks, some, _limit_px(read["noise_outliers"]))), tracks["dataset"][0]
    newest = of_window[Purpose.NEWEST_POSE]
    kernels = tried_kernels(
        drawn,
        dataset=dataset,
        innovations=of_window[Purpose.INNOVATIONS],
        newest=newest,
        every=of_window[Purpose.ALL_POSES],
        groups=read.groups,
        level=level,
    )
    return kernels, tried_gate(drawn, newest, dataset=dataset, groups=read.groups, level=level, cameras=cameras)


def _limit_px(outliers: pl.DataFrame) -> float:
    """Beyond what errors are outliers, mean over sequences."""
    return float((outliers["limit_px"] * outliers["n"]).to_numpy().sum() / outliers["n"].to_numpy().sum())


def _training(read: TrainingTables) -> Training:
    errors = read["noise_sums"].filter(pl.col("product") == "error")
    return Training(
        dataset=", ".join(errors["dataset"].unique().sort()),
        tracker=read.tracker,
        speed=float(read.speed),
        tracker_settings=without_folders(read.settings),
        scenes=read.scenes,
        n_tracks=int(read["noise_outliers"]["n_tracks"].to_numpy().sum()),
        n_observations=int(errors["n"].to_numpy().sum()),
        ages=(int(errors["age"].min()), int(errors["age"].max())),  # type: ignore[arg-type]
        median_lifetime=_median_lifetime(read["ends"]),
    )


def _median_lifetime(ends: pl.DataFrame) -> int | None:
    """As in `Training`."""
    last = int(ends["lifetime"].max() or 0)  # type: ignore[arg-type]
    lengths = lengths_of_tracks(ends, longest=last + 1)
    median = int(lengths[len(lengths) // 2])
    return median if median <= last else None


def _floor(floors: pl.DataFrame, last_age: int) -> float | None:
    """Root mean square error of true positions, px, of all sources together; None if it is unknown."""
    used = floors.filter(pl.col("source") == "all", pl.col("axis") == "age", pl.col("at").is_between(1, last_age))
    n = used["n"].to_numpy().sum()
    return float(np.sqrt((used["sum_uu"].to_numpy().sum() + used["sum_vv"].to_numpy().sum()) / (2 * n))) if n else None


def _recordings(read: TrainingTables, longest: int) -> list[Recording]:
    """One sequence of each scene; of many scenes some, spread evenly over all of them."""
    scene_of = {read.folder.manifest().sequences[key].sequence.scene: key for key in reversed(read.keys)}
    names = sorted(scene_of)
    places = np.unique(np.linspace(0, len(names) - 1, min(MOST_RECORDINGS, len(names))).round().astype(int))
    found = []
    for scene in (names[place] for place in places):
        key, ends = scene_of[scene], read["ends"].filter(scene=scene)
        ends = ends if ends["n_ended"].to_numpy().sum() >= _LEAST else read["ends"]
        sights = _sights(read, key)
        cameras, poses = (read.of_sequence(name, key) for name in ("cameras", "poses"))
        if cameras.height and cameras["fx_px"][0] is not None:
            lifetimes = lengths_of_tracks(ends, longest=longest)
            found.append(Recording(scene, poses, cameras, sights, lifetimes, _rig(read, key)))
    return found


def _sights(read: TrainingTables, key: str) -> NDArray[np.float64]:
    """u, v (px) and depth (m) where tracks of a sequence begin, (n, 3); of all trackers where its own are few."""
    columns = ["u_birth_px", "v_birth_px", "depth_m"]
    every = read.of_sequence("audit_samples", key).drop_nulls(columns)
    own = every.filter(tracker=read.tracker)
    return (own if own.height >= _LEAST else every).select(columns).to_numpy()


def _rig(read: TrainingTables, key: str) -> Rig | None:
    """The second camera of a sequence; None of trackers of the first one, and where its lens is not known."""
    if read["pair_tracks"].is_empty():
        return None
    table = read.of_sequence("rig", key)
    if table["fx_px"][0] is None:
        return None
    place = table.select("x_m", "y_m", "z_m").to_numpy(), table.select("qx", "qy", "qz", "qw").to_numpy()
    return Rig(pinhole(table), from_quaternion(*place)[0])


def lengths_of_tracks(ends: pl.DataFrame, *, longest: int) -> NDArray[np.int64]:
    """A thousand lengths of tracks with the distribution of Kaplan and Meier, (1000,), frames of the tracker.

    `ends`: columns lifetime, n_ended and n_censored.
    """
    by_length = ends.group_by("lifetime").agg(pl.col("n_ended", "n_censored").sum()).sort("lifetime")
    lifetime, ended, censored = (by_length[name].to_numpy() for name in by_length.columns)
    gone = 1.0 - kaplan_meier(ended, censored).beyond
    shares = (np.arange(1000) + 0.5) / 1000
    place = np.searchsorted(gone, shares)
    return np.append(lifetime, max(longest, lifetime.max(initial=0)))[place].astype(np.int64)
