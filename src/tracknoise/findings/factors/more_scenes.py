"""How many more scenes would settle a question: arrays only.

For a difference d with a margin m, a standard deviation s of single scenes and a test at the level of the intervals,
80 % of studies with n = ((z_level + z_80) s / (|d| - m))^2 + 2 scenes have a significant result (scenes). The last term
allows for Student's distribution. Where the reported difference exceeds the margin, it alone has to be shown to do so.
Otherwise all points have to be shown to be below the margin, and the one that needs the most scenes counts. Where a
difference lies within 20 % of the margin, no number is given: the estimate is too close to tell which of the two it is.
"""

from statistics import NormalDist

import numpy as np

from tracknoise.findings.factors.averages import Averages

POWER = 0.8
TOO_CLOSE = 0.2
"""Differences this close to the margin, relative to it, give no number of scenes."""


def more_scenes(found: Averages, chosen: int, points: Averages, *, margin: float, level: float) -> int | None:
    """Scenes that are needed by (scenes) beyond those that there are, at least one; None where this is unknown.

    Parameters
    ----------
    found, chosen
        Differences, and which of them is reported.
    points
        Differences at all points.
    margin
        Largest difference that counts as no effect.
    level
        Probability that an interval contains the true difference.
    """
    one = np.arange(len(found.mean)) == chosen
    open_ = found.of(one) if abs(found.mean[chosen]) > margin else points
    away = np.abs(np.abs(open_.mean) - margin)
    if np.any(away <= TOO_CLOSE * margin):
        return None
    z = NormalDist().inv_cdf((1 + level) / 2) + NormalDist().inv_cdf(POWER)
    units = open_.n_units * (z * open_.error / away) ** 2 + 2
    scenes = np.ceil(units * open_.n_scenes / open_.n_units)
    worst = int(np.argmax(scenes - open_.n_scenes))
    return max(int(scenes[worst] - open_.n_scenes[worst]), 1)
