"""Null controls: changes of the tracks or of the beliefs after which a gain has to vanish.

The second control hands covariates to other tracks. The third hands errors to other tracks of equal length, for each
observation on its own, so that the variance at each age stays and correlation in time is lost.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tracknoise.proof.arms import Beliefs
from tracknoise.proof.problem import Problem, errors_of


def with_permuted_covariates(problems: Sequence[Problem], *, seed: int = 0) -> list[Problem]:
    """Control N2: each covariate belongs to another track of the same length."""
    random = np.random.default_rng(seed)
    return [
        replace(
            problem,
            groups=tuple(replace(group, covariate=random.permutation(group.covariate)) for group in problem.groups),
        )
        for problem in problems
    ]


def with_permuted_errors(problems: Sequence[Problem], *, seed: int = 0) -> list[Problem]:
    """Control N3: each error belongs to another track of the same length, at the same place in the track."""
    random = np.random.default_rng(seed)
    changed = []
    for problem in problems:
        uv = []
        for group, errors in zip(problem.groups, errors_of(problem), strict=True):
            order = np.argsort(random.random(errors.shape[:2]), axis=0)
            uv.append(group.uv - errors + np.take_along_axis(errors, order[:, :, None], axis=0))
        changed.append(problem.with_uv(tuple(uv)))
    return changed


def with_noise_of(beliefs: Beliefs, other: Beliefs) -> Beliefs:
    """Control N4: the noise model of another tracker."""
    return replace(beliefs, noise=other.noise, by_covariate=other.by_covariate, exponent=other.exponent)


def with_drift_reversed(beliefs: Beliefs) -> Beliefs:
    """Control N5: the mean drift has the opposite sign."""
    return replace(beliefs, drift_px=-beliefs.drift_px)
