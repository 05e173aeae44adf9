"""Curves and changes of all units of a condition, each in units of the scale of its own scene.

Scenes differ in how large their errors are. In units of their own scale they all count alike, and what is left to
vary is the form of the curve. The scale c of a scene is the mean, over its errors, of their squares divided by the
second moment that all scenes have at the same age (scale):

    c = sum over ages of sum(e^2) / M(k), divided by the number of errors

where M is the second moment of errors that are already divided by c; two rounds are enough.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROUNDS = 2


@dataclass(frozen=True, slots=True)
class UnitSums:
    """Sums of one coordinate of every unit: scenes, or blocks of tracks within them.

    Attributes
    ----------
    n, squares : (units, ages)
        Number of errors, and the sum of their squares, px^2.
    lagged, changed : (units, lags)
        Sums of the products of changes that are a lag apart, and of their mean squares, px^2.
    scene : (units,)
        Number of each unit's scene.
    """

    n: Array
    squares: Array
    lagged: Array
    changed: Array
    scene: NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class SceneCurves:
    """The same in units of scale, of all units and of all but one; the last axis has all units first.

    Attributes
    ----------
    n, second : (ages, 1 + units)
        Number of errors, and their second moment about zero.
    related : (lags, 1 + units)
        (autocorrelation).
    log_scale : (1 + units,)
        Mean over scenes of the logarithm of (scale), log px^2.
    sizes : (units,)
        Errors of each unit.
    """

    n: Array
    second: Array
    related: Array
    log_scale: Array
    sizes: Array


def scene_curves(sums: UnitSums) -> SceneCurves:
    """Curves in units of the scale of each scene.

    Parameters
    ----------
    sums
        Of units with errors that are not all zero at any age.
    """
    scales = _scales(_of_scenes(sums.n, sums.scene), _of_scenes(sums.squares, sums.scene))
    own = scales[sums.scene, None]
    n, squares = _and_without(sums.n), _and_without(sums.squares / own)
    second = squares / np.where(n > 0, n, np.nan)
    changed = _and_without(sums.changed / own)
    related = _and_without(sums.lagged / own) / np.where(changed > 0, changed, np.nan)
    return SceneCurves(
        n,
        np.where(np.isnan(second), second[:, :1], second),
        np.where(np.isnan(related), related[:, :1], related),
        _log_scales(sums, scales, second[:, 0]),
        sums.n.sum(axis=1),
    )


def _scales(n: Array, squares: Array) -> Array:
    """(scale) of each scene, (scenes,); 1 for one without errors."""
    scales, total = np.ones(len(n)), np.maximum(n.sum(axis=0), 1)
    for _ in range(_ROUNDS):
        second = (squares / scales[:, None]).sum(axis=0) / total
        scales = _scale(n, squares, second)
    return scales


def _scale(n: Array, squares: Array, second: Array) -> Array:
    relative = (squares / np.where(second > 0, second, 1.0)).sum(axis=1)
    return np.where(relative > 0, relative / np.maximum(n.sum(axis=1), 1), 1.0)


def _log_scales(sums: UnitSums, scales: Array, second: Array) -> Array:
    """Mean logarithm of the scales, of all units and of all but one."""
    logs, count, members = np.log(scales), len(scales), np.bincount(sums.scene)[sums.scene]
    n, squares = (_of_scenes(table, sums.scene)[sums.scene] - table for table in (sums.n, sums.squares))
    others = np.log(_scale(n, squares, second))
    left = logs.sum() - logs[sums.scene]
    return np.append(logs.mean(), np.where(members == 1, left / max(count - 1, 1), (left + others) / count))


def _of_scenes(sums: Array, scene: NDArray[np.intp]) -> Array:
    """Sums of units added up by scene, (scenes, columns)."""
    n_scenes = int(scene.max()) + 1
    if len(scene) == n_scenes:  # each is a unit
        return sums
    return np.stack([sums[scene == one].sum(axis=0) for one in range(n_scenes)])


def _and_without(sums: Array) -> Array:
    """Sums over all units, then over all but each: (columns, 1 + units)."""
    total = sums.sum(axis=0)
    return np.concatenate([total[None], total - sums]).T
