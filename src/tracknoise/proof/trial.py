"""Every noise assumption on every window: errors, and how consistent they are with what was claimed."""

from collections.abc import Iterable, Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.proof.arms import ARMS, SCALARS, Beliefs, one_sigma
from tracknoise.proof.bundle import Adjusted, Assumption, adjust
from tracknoise.proof.problem import Problem
from tracknoise.proof.simulation import perturbed

NEWEST = 5
"""Coordinates of the newest pose: three of its rotation, then two of its position."""
ALL_ARMS = (*SCALARS, *ARMS)


def try_arms(
    problems: Sequence[Problem], beliefs: Beliefs, *, arms: Iterable[str] = ALL_ARMS, seed: int = 0
) -> pl.DataFrame:
    """Adjust every window under every assumption, all from the same perturbed truth.

    Parameters
    ----------
    problems
        Windows of scenes that the beliefs were not learned from.
    beliefs
        What was learned from training scenes.
    arms
        Short names, of `tracknoise.proof.arms`.
    seed
        Of the perturbation.

    Returns
    -------
    polars.DataFrame
        One row per window and arm: scene, window, arm, n_tracks, position_m and rotation_rad (norms of the errors of
        the newest pose), nees_newest, nees_position, nees_rotation and nees_all (normalised errors squared over
        their degrees of freedom), innovations, steps, converged.
    """
    wanted = tuple(arms)
    rows = [
        {"scene": problem.scene, "window": place, "arm": arm, "n_tracks": problem.n_tracks, **numbers}
        for place, problem in enumerate(problems)
        for arm, numbers in _of_window(problem, beliefs, wanted, (seed + place)).items()
    ]
    return pl.DataFrame(rows)


def _of_window(
    problem: Problem, beliefs: Beliefs, arms: tuple[str, ...], seed: int
) -> dict[str, dict[str, float | int | bool]]:
    start = perturbed(problem, seed=seed)
    one = adjust(problem, start, Assumption(one_sigma(problem, 1.0))) if set(arms) & set(SCALARS) else None
    found = {}
    for arm in arms:
        if one is not None and arm in SCALARS:
            found[arm] = _numbers(problem, one, SCALARS[arm][1](beliefs) ** 2)
        else:
            given, assumption = ARMS[arm].apply(problem, beliefs)
            found[arm] = _numbers(problem, adjust(given, start, assumption), 1.0)
    return found


def _numbers(problem: Problem, found: Adjusted, scale: float) -> dict[str, float | int | bool]:
    """Numbers of an answer whose claimed covariance is multiplied by a scale."""
    error = problem.gauge.between(found.poses, problem.world_from_camera)
    claimed = scale * found.claimed
    position, rotation = error[-2:], error[-NEWEST:-2]
    return {
        "position_m": float(np.linalg.norm(position)),
        "rotation_rad": float(np.linalg.norm(rotation)),
        "nees_newest": normalised(error[-NEWEST:], claimed[-NEWEST:, -NEWEST:]),
        "nees_position": normalised(position, claimed[-2:, -2:]),
        "nees_rotation": normalised(rotation, claimed[-NEWEST:-2, -NEWEST:-2]),
        "nees_all": normalised(error, claimed),
        "innovations": found.innovations / scale,
        "steps": found.steps,
        "converged": found.converged,
    }


def normalised(error: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
    """Normalised error squared over its degrees of freedom."""
    return float(error @ np.linalg.solve(covariance, error) / len(error))
