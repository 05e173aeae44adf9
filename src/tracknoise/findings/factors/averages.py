"""Means over scenes and their standard errors, for scenes that may come in groups: arrays only.

Every scene has the same weight. A value that a scene lacks is NaN, and the scene takes no part in that mean. With n
scenes in G groups, a mean has the standard error s / sqrt(n) and its degrees of freedom (average):

- scenes: s is the standard deviation of the scenes; n - 1 degrees of freedom.
- groups: the scenes of a group are averaged first; groups then count as scenes do.
- within: s^2 is the variance of scenes within their groups, pooled; n - G degrees of freedom. The standard error
  excludes the variation between groups.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from tracknoise.tables.enumerations import Resampled


@dataclass(frozen=True, slots=True)
class Averages:
    """Means over scenes, at any number of points.

    Attributes
    ----------
    mean, error, degrees : (points,) float64
        Means, their standard errors and degrees of freedom by (average).
    n_units, n_scenes : (points,) intp
        Scenes or groups that are averaged, and scenes in them.
    parts : (dimensions, points) float64
        What each scene, group, or direction within groups, adds to the error: the squares add up to that of `error`.
    """

    mean: NDArray[np.float64]
    error: NDArray[np.float64]
    degrees: NDArray[np.float64]
    n_units: NDArray[np.intp]
    n_scenes: NDArray[np.intp]
    parts: NDArray[np.float64]

    def of(self, points: NDArray[np.bool_]) -> "Averages":
        """Some of the points."""
        mean, error, degrees = self.mean[points], self.error[points], self.degrees[points]
        n_units, n_scenes = self.n_units[points], self.n_scenes[points]
        return Averages(mean, error, degrees, n_units, n_scenes, self.parts[:, points])


def average(values: NDArray[np.float64], group: NDArray[np.intp], resampled: Resampled) -> Averages:
    """Means over scenes by (average).

    Parameters
    ----------
    values : (scenes, points)
        NaN where a scene has none.
    group : (scenes,)
        Number of the group of each scene, from 0 on.
    resampled
        `scenes`, `groups` or `within`.
    """
    if resampled == Resampled.within:
        return _within(values, group)
    n_scenes = (~np.isnan(values)).sum(axis=0)
    return _between(values if resampled == Resampled.scenes else _group_means(values, group), n_scenes)


def _between(units: NDArray[np.float64], n_scenes: NDArray[np.intp]) -> Averages:
    """Means of independent units."""
    there = ~np.isnan(units)
    n = there.sum(axis=0)
    mean = np.where(there, units, 0.0).sum(axis=0) / np.maximum(n, 1)
    parts = np.where(there, units - mean, 0.0) / np.sqrt(np.maximum(n * (n - 1), 1))
    return Averages(mean, np.linalg.norm(parts, axis=0), np.maximum(n - 1.0, 1.0), n, n_scenes, parts)


def _group_means(values: NDArray[np.float64], group: NDArray[np.intp]) -> NDArray[np.float64]:
    """Means of the scenes of each group, (groups, points), NaN where none has a value."""
    there = ~np.isnan(values)
    member = (group == np.arange(group.max(initial=-1) + 1)[:, None]).astype(np.float64)
    count = member @ there
    return np.asarray(member @ np.where(there, values, 0.0) / np.where(count > 0, count, np.nan), dtype=np.float64)


def _within(values: NDArray[np.float64], group: NDArray[np.intp]) -> Averages:
    """Means whose errors are of the scenes within their groups."""
    there, of_groups = ~np.isnan(values), _group_means(values, group)
    n = there.sum(axis=0)
    degrees = n - (~np.isnan(of_groups)).sum(axis=0).astype(np.float64)
    mean = np.where(there, values, 0.0).sum(axis=0) / np.maximum(n, 1)
    residual = np.where(there, values - of_groups[group], 0.0) / np.sqrt(np.maximum(n * degrees, 1.0))
    error = np.linalg.norm(residual, axis=0)
    return Averages(mean, error, np.maximum(degrees, 1.0), n, n, _directions_within(group) @ residual)


def _directions_within(group: NDArray[np.intp]) -> NDArray[np.float64]:
    """Orthonormal directions among the scenes of each group, and a last one without length: (n - G + 1, scenes).

    The last one makes the number of rows one more than the degrees of freedom, as it is for scenes.
    """
    rows = []
    for number in range(group.max(initial=-1) + 1):
        members = np.flatnonzero(group == number)
        row = np.zeros((len(members) - 1, len(group)))
        row[:, members] = linalg.helmert(len(members)) if len(members) > 1 else 0.0
        rows.append(row)
    return np.concatenate([*rows, np.zeros((1, len(group)))])
