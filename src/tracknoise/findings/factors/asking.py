"""What is asked of differences between levels: the margin, the level, and which scenes or groups are averaged."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.factors.answers import Question
from tracknoise.findings.sampling.groups import scheme
from tracknoise.findings.sampling.rotation import rotations
from tracknoise.tables.enumerations import Resampled

N_DRAWS = 499
"""Rotations: enough to distinguish p-values of a few percent."""


def ask(
    both: NDArray[np.bool_],
    group: NDArray[np.intp],
    *,
    margin: float,
    level: float,
    n_draws: int = N_DRAWS,
    seed: int = 0,
    cancels: bool = False,
) -> Question | None:
    """The question about differences; None where scenes or groups are too few, or the margin is unknown.

    Parameters
    ----------
    both : (scenes, pairs)
        Which scenes were measured at both levels of each pair.
    group : (scenes,)
        Number of the group of each scene.
    margin
        Largest difference that counts as no effect; NaN where it is unknown.
    level
        Probability that an interval contains the true difference.
    n_draws, seed
        Number of rotations, and their seed.
    cancels
        Whether differences at several points may cancel.
    """
    resampled = scheme(group[both.any(axis=1)])
    if resampled is None or not np.isfinite(margin):
        return None
    n_groups = len(np.unique(group))
    within = len(group) - n_groups + 1
    dimensions = {Resampled.scenes: len(group), Resampled.groups: n_groups}.get(resampled, within)
    directions = rotations(dimensions, n_draws=n_draws, seed=seed)
    return Question(margin, level, group, resampled, directions, cancels=cancels)
