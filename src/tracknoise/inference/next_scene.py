"""How much scenes differ, and where the value of the next scene is expected: arrays only.

With y_i the value of scene i on the scale of the statistic (`tracknoise.inference.jackknife.SCALES`), its mean
over n scenes and their standard deviation s (spread between scenes), the next scene's own value lies in

    mean of y +- t s sqrt(1 + 1 / n)    (prediction)

with the probability of the level, if the y_i are Gaussian; t has n - 1 degrees of freedom. Where g groups of scenes are
resampled, n is g in (prediction), and s^2 is divided by (n - sum of n_g^2 / n) / (n - 1). This is right if all scenes
of a group are equal, and slightly too wide otherwise. The next scene is then one of another group; where scenes within
groups are resampled, it is one of these groups. All scenes count alike. s includes the error of each scene's own
value, so that it also holds for a next scene with as many tracks.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from tracknoise.inference.jackknife import SCALES
from tracknoise.inference.units import MIN_SCENES, Resampled, Units, by_number


@dataclass(frozen=True, slots=True)
class NextScene:
    """Spread between scenes, and prediction for the next one, NaN where there is none."""

    spread: NDArray[np.float64]  # (statistics, points): standard deviation between scenes on the scale of the statistic
    # low, high: (statistics, points): bounds by (prediction)
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def next_scene(units: Units, own: NDArray[np.float64], scales: Sequence[str], *, level: float) -> NextScene:
    """Spread of what scenes have of their own, and (prediction).

    Parameters
    ----------
    units
        Whose scenes and groups these are. There is no prediction where blocks or nothing is resampled.
    own : (statistics, points, scenes)
        Each scene's own value; NaN where it has none.
    scales
        Of each statistic, a name in `SCALES`. Where the value of a scene is at a limit of its scale, such as a scale of
        0, there is neither spread nor prediction.
    level
        Between 0 and 1.
    """
    spread, low, high = (np.full(own.shape[:-1], np.nan) for _ in range(3))
    for scale in sorted(set(scales)):
        rows = np.array([name == scale for name in scales])
        to = SCALES[scale]
        limited = ((own[rows] <= to.low) | (own[rows] >= to.high)).any(axis=-1)
        is_known = ~np.isnan(own[rows])
        y = np.where(is_known, to.to(np.where(is_known & ~limited[..., None], own[rows], 0.5)), 0.0)
        middle, s, reach = _prediction(units, y, is_known, level)
        spread[rows] = np.where(limited, np.nan, s)
        with np.errstate(over="ignore"):
            low[rows], high[rows] = (np.where(limited, np.nan, to.back(middle + end)) for end in (-reach, reach))
    return NextScene(spread, low, np.where(np.isinf(high), np.nan, high))


def _prediction(
    units: Units, y: NDArray[np.float64], is_known: NDArray[np.bool_], level: float
) -> tuple[NDArray[np.float64], ...]:
    """Mean, spread, and how far (prediction) reaches from the mean; y is 0 where it is not known."""
    n = is_known.sum(axis=-1)
    group = units.scene_group if units.resampled == Resampled.groups else np.arange(len(units.scenes))
    in_group = np.moveaxis(by_number(group, np.moveaxis(is_known.astype(np.float64), -1, 0)), 0, -1)
    groups = (in_group > 0).sum(axis=-1)
    mean = y.sum(axis=-1) / np.maximum(n, 1)
    squares = np.where(is_known, np.square(y - mean[..., None]), 0.0).sum(axis=-1)
    apart = n - np.square(in_group).sum(axis=-1) / np.maximum(n, 1)
    spread = np.sqrt(squares / np.where(apart > 0, apart, np.nan))
    enough = (groups >= MIN_SCENES) & (units.resampled not in (None, Resampled.blocks))
    count = np.where(enough, groups, 2)
    reach = special.stdtrit(count - 1.0, (1 + level) / 2) * spread * np.sqrt(1 + 1 / count)
    return mean, spread, np.where(enough, reach, np.nan)
