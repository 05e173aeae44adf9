"""From windows of training scenes, and a noise model if there is one, to what the arms need to know."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tracknoise.noise_models.linear_benchmark import consistent_sigma
from tracknoise.noise_models.linear_window import LinearTracks, PointTracks, linear_tracks
from tracknoise.noise_models.model import Purpose
from tracknoise.noise_models.track_noise import TrackNoise
from tracknoise.proof.arms import Beliefs, Student
from tracknoise.proof.problem import Problem
from tracknoise.proof.simulation import PlantedNoise
from tracknoise.proof.training import (
    fit_noise,
    mean_drift,
    mean_square_about_birth,
    student_of_errors,
    student_of_tracks,
)
from tracknoise.proof.trial import try_arms

_MOST_BENCHMARKS = 8
"""Training windows of which the linear benchmark is averaged."""


def learn(
    problems: Sequence[Problem],
    *,
    noise: TrackNoise | None = None,
    planted: PlantedNoise | None = None,
) -> Beliefs:
    """What the arms need to know.

    Parameters
    ----------
    problems
        Windows of training scenes.
    noise
        Components of a noise model; by default they are fitted to the windows.
    planted
        The true noise, if it is known.
    """
    by_covariate = fit_noise(problems, with_covariate=True)
    components = noise or fit_noise(problems).noise
    benchmarks = problems[:: max(1, len(problems) // _MOST_BENCHMARKS)][:_MOST_BENCHMARKS]
    newest, innovations = (
        float(np.mean([_equivalent(problem, components, purpose) for problem in benchmarks]))
        for purpose in (Purpose.NEWEST_POSE, Purpose.INNOVATIONS)
    )
    draft = Beliefs(
        noise=components,
        tuned_px=1.0,
        about_birth_px=float(np.sqrt(mean_square_about_birth(problems))),
        newest_pose_px=newest,
        innovations_px=innovations,
        by_covariate=by_covariate.noise,
        exponent=by_covariate.exponent,
        drift_px=mean_drift(problems),
        of_errors=Student(*student_of_errors(problems)),
        of_tracks=Student(*student_of_tracks(problems, components)),
        planted=None if planted is None else planted.noise,
        planted_exponent=0.0 if planted is None else planted.texture_exponent,
    )
    return tuned(draft, problems)


def tuned(beliefs: Beliefs, problems: Sequence[Problem]) -> Beliefs:
    """The same with the standard deviation that makes the newest pose of windows consistent."""
    nees = try_arms(problems, beliefs, arms=["0"])["nees_newest"].to_numpy()
    return replace(beliefs, tuned_px=float(np.sqrt(np.mean(nees))))


def _equivalent(problem: Problem, noise: TrackNoise, purpose: Purpose) -> float:
    return consistent_sigma(_linear(problem), noise, purpose=purpose)


def _linear(problem: Problem) -> list[LinearTracks]:
    return [
        linear_tracks(problem.camera, problem.world_from_camera, PointTracks(group.frames, group.points, group.born))
        for group in problem.groups
    ]
