"""What noise assumptions learn from windows of training scenes, and from a noise model if there is one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import minimize

from tracknoise.estimators.linear_window import consistent_sigma
from tracknoise.estimators.model import Purpose
from tracknoise.estimators.proof_windows import (
    ROUNDING_PX,
    Problem,
    TrackGroup,
    errors_of,
    linear_window,
    magnification_of,
    scenes_of,
)
from tracknoise.estimators.track_likelihood import LEAST_NU, MOST_NU
from tracknoise.estimators.track_scale import ChosenLaw, Sample, choose_law, sample_of
from tracknoise.estimators.trial import ADVISED, TUNED_ARMS, Beliefs, Gated, Knee, Law, PlantedNoise, Student, try_arms
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.track_noise import TrackNoise

_MOST_TRACKS = 4000
"""Tracks that laws are fitted to."""


def sample_of_windows(problems: Sequence[Problem]) -> Sample:
    """Tracks of windows, thinned evenly; scenes are left out together, windows where there is one scene."""
    every = max(1, -(-sum(problem.n_tracks for problem in problems) // _MOST_TRACKS))
    scenes = scenes_of(problems)
    track, error, magnification, age, born, unit = [], [], [], [], [], []
    names = sorted({name for problem in problems for group in problem.groups for name in group.quality})
    values: dict[str, list[NDArray[np.float64]]] = {name: [] for name in names}
    count = passed = 0
    for place, problem in enumerate(problems):
        for group, errors in zip(problem.groups, errors_of(problem), strict=True):
            kept = np.flatnonzero((passed + np.arange(len(errors))) % every == 0)
            passed += len(errors)
            carried, about = (part[kept] for part in _about_first(problem, group, errors))
            length = group.frames.shape[1]
            track.append(np.repeat(count + np.arange(len(kept)), length))
            error.append(about.reshape(-1, 2))
            magnification.append(carried.ravel())
            age.append(group.ages[kept].ravel().astype(np.float64))
            born.append(group.born[kept])
            unit.append(np.full(len(kept), scenes.index(problem.scene) if len(scenes) > 1 else place))
            for name in names:
                unknown = np.full(group.frames.shape, np.nan)
                values[name].append(group.quality.get(name, unknown)[kept].ravel())
            count += len(kept)
    return sample_of(
        np.concatenate(track),
        error=np.concatenate(error),
        magnification=np.concatenate(magnification),
        age=np.concatenate(age),
        born=np.concatenate(born),
        values={name: np.concatenate(parts) for name, parts in values.items()},
        unit=np.unique(np.concatenate(unit), return_inverse=True)[1],
        noun="scenes" if len(scenes) > 1 else "windows",
    )


def law_of(sample: Sample, chosen: ChosenLaw) -> Law:
    """The same with its factors as estimators evaluate them."""
    parts = zip(chosen.places, chosen.law.powers, chosen.gains, strict=True)
    conditions = tuple(sample.covariates[place].factor(power, gain) for place, power, gain in parts)
    return Law(chosen.law.noise, chosen.law.nu, conditions)


def student(mean_squares: NDArray[np.float64], sizes: NDArray[np.int64]) -> tuple[float, float]:
    """Degrees of freedom and squared scale of Student's distribution, from mean squares of blocks of some sizes."""

    def loss(values: NDArray[np.float64]) -> float:
        nu, scale = np.exp(values)
        return -float(np.mean(stats.f.logpdf(mean_squares / scale, sizes, nu) - np.log(scale)))

    limits = [(np.log(LEAST_NU), np.log(MOST_NU)), (None, None)]
    start = [np.log(8.0), np.log(np.median(mean_squares))]
    nu, scale = np.exp(minimize(loss, start, method="L-BFGS-B", bounds=limits).x)
    return (float(nu) if nu < 0.5 * MOST_NU else float("inf")), float(scale)


def student_of_errors(problems: Sequence[Problem]) -> tuple[float, float]:
    """The same of single errors that are not 0: degrees of freedom, and squared scale, px^2."""
    errors = np.concatenate([part.reshape(-1, 2) for problem in problems for part in errors_of(problem)])
    squares = np.square(errors).mean(axis=1)
    positive = squares[squares > ROUNDING_PX**2]
    return student(positive, np.full(len(positive), 2))


def mean_drift(problems: Sequence[Problem]) -> NDArray[np.float64]:
    """(2,) float64, px per frame: the mean error of all tracks as a multiple of their age, by least squares."""
    ages, errors = _later_about_first(problems)
    return np.asarray(ages @ errors / (ages @ ages))


def mean_square_about_birth(problems: Sequence[Problem]) -> float:
    """Mean square of each coordinate of the errors about the first observation of tracks in the window, px^2."""
    return float(np.square(_later_about_first(problems)[1]).mean())


def _about_first(
    problem: Problem, group: TrackGroup, errors: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Magnifications (tracks, n) since the first observation, and errors (tracks, n, 2) about it, px."""
    carried = magnification_of(problem, group)
    return carried, errors - carried[:, :, None] * errors[:, :1]


def _later_about_first(problems: Sequence[Problem]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ages (n,) and errors (n, 2) about the first position, first observations left out."""
    ages, errors = [], []
    for problem in problems:
        for group, error in zip(problem.groups, errors_of(problem), strict=True):
            about = _about_first(problem, group, error)[1]
            ages.append(group.ages[:, 1:].ravel())
            errors.append(about[:, 1:].reshape(-1, 2))
    return np.concatenate(ages).astype(np.float64), np.concatenate(errors)


_MOST_BENCHMARKS = 8
"""Training windows of which the linear benchmark is averaged."""


def learn(
    problems: Sequence[Problem],
    *,
    noise: TrackNoise | None = None,
    planted: PlantedNoise | None = None,
) -> Beliefs:
    """What the arms need to know."""
    sample = sample_of_windows(problems)
    gaussian, scaled = (choose_law(sample, level=LEVEL, scales=scales) for scales in (False, True))
    components = noise or gaussian.without_factors.noise
    benchmarks = problems[:: max(1, len(problems) // _MOST_BENCHMARKS)][:_MOST_BENCHMARKS]
    windows = [linear_window(problem) for problem in benchmarks]
    newest, innovations = (
        float(np.mean([consistent_sigma(window, components, purpose=purpose) for window in windows]))
        for purpose in (Purpose.NEWEST_POSE, Purpose.INNOVATIONS)
    )
    draft = Beliefs(
        noise=components,
        tuned_px=1.0,
        about_birth_px=float(np.sqrt(mean_square_about_birth(problems))),
        newest_pose_px=newest,
        innovations_px=innovations,
        by_quality=law_of(sample, gaussian),
        scaled=Law(scaled.without_factors.noise, scaled.without_factors.nu),
        scaled_by_quality=law_of(sample, scaled),
        drift_px=mean_drift(problems),
        of_errors=Student(*student_of_errors(problems)),
        planted=None if planted is None else planted.law,
    )
    untried = Knee(sigma_px=innovations, knee_px=innovations)
    gated = Gated(sigma_px=newest, factor=1.0)
    return tuned(replace(draft, knees={**draft.knees, ADVISED: untried}, gated=gated), problems)


_MOST_TUNED = 60
"""Training windows that knees are tuned on."""
_KNEES = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Knees that are tried, in units of the sigma for innovations."""


def tuned(beliefs: Beliefs, problems: Sequence[Problem]) -> Beliefs:
    """The same with standard deviations for which the newest pose of windows is consistent, and knees of Cauchy's loss.

    A knee is the one under which positions of training windows err least, as a geometric mean.
    """
    nees = try_arms(problems, beliefs, arms=["0"])["nees_newest"].to_numpy()
    own = replace(beliefs, tuned_px=float(np.sqrt(np.mean(nees))))
    some = problems[:: max(1, -(-len(problems) // _MOST_TUNED))]
    return replace(own, knees={**own.knees, **{arm: _tuned_knee(own, some, arm) for arm in TUNED_ARMS}})


def _tuned_knee(beliefs: Beliefs, problems: Sequence[Problem], arm: str) -> Knee:
    """Poses depend on the knee in px alone. The sigma scales what is claimed, and is 1 px while knees are tried."""
    found = []
    for share in _KNEES:
        knee = Knee(sigma_px=1.0, knee_px=share * beliefs.innovations_px)
        trial = try_arms(problems, replace(beliefs, knees={arm: knee}), arms=[arm])
        error, nees = (trial[column].to_numpy() for column in ("position_m", "nees_newest"))
        found.append((float(np.mean(np.log(error))), Knee(sigma_px=float(np.sqrt(nees.mean())), knee_px=knee.knee_px)))
    return min(found, key=lambda one: one[0])[1]
