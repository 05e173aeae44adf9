"""Differences between the levels of a factor, paired by scene: from sums by scene, level and place, to `Ratios`.

Two levels are compared in the scenes that were measured at both, at the places where at least `MIN_SCENES` of these
have data at both. The contribution of a scene to the error of a statistic is how far the statistic moves when the scene
is left out (jackknife).

The common variation of two curves is the range of their mean, including zero at age 0 (effect.common). Its highest and
lowest place are taken as measured. For a single number per level it is the mean over all levels (effect.scalar).
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.factors.ratios import Ratios
from tracknoise.findings.sampling.jackknife import degrees, parts
from tracknoise.findings.sampling.resampling import leave_one_out
from tracknoise.findings.sampling.units import MIN_SCENES

Values = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""Statistics from counts (...,) and sums (..., columns): (..., values)."""
_Jackknife = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Values, and what each scene adds to their error, with the scenes first."""
_Common = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""The same of what is common, (values,), and of the curves whose range it is, (scenes, places, values)."""


@dataclass(frozen=True, slots=True)
class Levels:
    """Sums of the scenes at all levels of a factor.

    Attributes
    ----------
    n : (scenes, levels, places) float64
        Counts.
    sums : (scenes, levels, places, columns) float64
        Sums.
    measured : (scenes, levels) bool
        Which scenes were measured at which levels, whether or not they have anything at any place.
    """

    n: NDArray[np.float64]
    sums: NDArray[np.float64]
    measured: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Paired:
    """Differences of all pairs of levels that have enough scenes.

    Attributes
    ----------
    ratios
        For each statistic; none if no pair has enough scenes.
    places : (places,) bool
        Which places some pair was compared at.
    n_pairs
        How many pairs were.
    n_scenes
        The fewest scenes that two levels share, of all pairs.
    """

    ratios: list[Ratios]
    places: NDArray[np.bool_]
    n_pairs: int
    n_scenes: int


def pair_curves(levels: Levels) -> Paired:
    """Compare the curves of mean, mean absolute, second moment about zero and central, in u and v.

    Parameters
    ----------
    levels
        Columns are the sums of du, dv, |du|, |dv|, du^2 and dv^2.
    """
    return _pair(levels, _curve_values, 2, lambda _, a, b: _range_of_middle(a, b))


def pair_numbers(levels: Levels) -> Paired:
    """Compare a number that is one sum over its count; `levels` has one place and one column."""
    value, parts = _mean_of_levels(levels)
    return _pair(levels, _share, 1, lambda scenes, *_: (value, parts[scenes], np.zeros((int(scenes.sum()), 0, 1))))


def _curve_values(n: NDArray[np.float64], sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """(..., 8): as in `tracknoise.statistics.curves`, from sums about zero."""
    count = n[..., None]
    mean, absolute, second = sums[..., :2] / count, sums[..., 2:4] / count, sums[..., 4:]
    about_zero, central = second / (count - 1), (second - count * mean**2) / (count - 1)
    return np.concatenate([mean, absolute, about_zero, central], axis=-1)


def _share(n: NDArray[np.float64], sums: NDArray[np.float64]) -> NDArray[np.float64]:
    return sums / n[..., None]


def _jackknife(n: NDArray[np.float64], sums: NDArray[np.float64], values: Values) -> _Jackknife:
    """Values, and parts whose squares add up to their variance, however unequal the scenes."""
    whole = values(n.sum(axis=0), sums.sum(axis=0))
    moved = whole - values(leave_one_out(n), leave_one_out(sums))
    return whole, parts(moved, n[..., None])


def _range_of_middle(a: _Jackknife, b: _Jackknife) -> _Common:
    """Range over places and zero of the middle of two curves, (values,)."""
    middle, parts = ((x + y) / 2 for x, y in zip(a, b, strict=True))
    middle = np.concatenate([middle, np.zeros_like(middle[:1])])
    parts = np.concatenate([parts, np.zeros_like(parts[:, :1])], axis=1)
    columns = np.arange(middle.shape[1])
    top, bottom = middle.argmax(axis=0), middle.argmin(axis=0)
    spread: NDArray[np.float64] = middle[top, columns] - middle[bottom, columns]
    return spread, parts[:, top, columns] - parts[:, bottom, columns], parts


def _mean_of_levels(levels: Levels) -> _Jackknife:
    """Mean over the levels at which enough scenes have something, (values,), of all scenes that each has."""
    enough = ((levels.n[:, :, 0] > 0).sum(axis=0)) >= MIN_SCENES
    if not enough.any():
        return np.zeros(1), np.zeros((len(levels.n), 1))
    value, parts = _jackknife(levels.n[:, enough, 0], levels.sums[:, enough, 0], _share)
    return value.mean(axis=0), parts.mean(axis=1)


def _pair(
    levels: Levels,
    values: Values,
    coordinates: int,
    common: Callable[[NDArray[np.bool_], _Jackknife, _Jackknife], _Common],
) -> Paired:
    """Compare all pairs; the values of a statistic for each coordinate are adjacent."""
    pairs = list(combinations(range(levels.measured.shape[1]), 2))
    shared = [np.all(levels.measured[:, pair], axis=1) for pair in pairs]
    places = [_places(levels, pair, scenes) for pair, scenes in zip(pairs, shared, strict=True)]
    ratios = []
    for pair, scenes, compared in zip(pairs, shared, places, strict=True):
        if compared.any():
            there = np.ix_(np.flatnonzero(scenes), np.array(pair), np.flatnonzero(compared))
            a, b = (_jackknife(levels.n[there][:, level], levels.sums[there][:, level], values) for level in (0, 1))
            ratios.append(_ratios(levels.n[there], a, b, common(scenes, a, b), scenes))
    return Paired(
        ratios=_by_statistic(ratios, coordinates),
        places=np.any(places, axis=0) if places else np.zeros(levels.n.shape[2], dtype=np.bool_),
        n_pairs=len(ratios),
        n_scenes=min((int(scenes.sum()) for scenes in shared), default=0),
    )


def _places(levels: Levels, pair: tuple[int, int], scenes: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where enough scenes have something at both levels."""
    both = np.all(levels.n[:, pair] > 0, axis=1)
    enough: NDArray[np.bool_] = both[scenes].sum(axis=0) >= MIN_SCENES
    return enough


def _ratios(n: NDArray[np.float64], a: _Jackknife, b: _Jackknife, common: _Common, scenes: NDArray[np.bool_]) -> Ratios:
    """Ratios of a pair of levels, (places, values), from their counts (scenes that have both, 2, places).

    There is one curve per value; the parts of curves are (scenes, places, values).
    """
    difference = a[0] - b[0]
    freedom = degrees(n).min(axis=0)[:, None]  # of the level that is the worse off
    curve = np.arange(difference.shape[1], dtype=np.intp)
    return Ratios(
        difference=difference,
        common=np.broadcast_to(common[0], difference.shape),
        difference_parts=_among(scenes, a[1] - b[1]),
        common_parts=_among(scenes, np.broadcast_to(common[1][:, None], a[1].shape)),
        degrees=np.broadcast_to(freedom, difference.shape),
        curve=np.broadcast_to(curve, difference.shape),
        curve_parts=_among(scenes, common[2]),
    )


def _among(scenes: NDArray[np.bool_], some: NDArray[np.float64]) -> NDArray[np.float64]:
    """Parts of some of the scenes as parts of all scenes: those of the others are 0."""
    every = np.zeros((len(scenes), *some.shape[1:]))
    every[scenes] = some
    return every


def _by_statistic(ratios: list[Ratios], coordinates: int) -> list[Ratios]:
    """Join the points of all pairs, a statistic at a time."""
    if not ratios:
        return []
    width = ratios[0].difference.shape[1]
    return [_joined(ratios, slice(start, start + coordinates)) for start in range(0, width, coordinates)]


def _joined(ratios: list[Ratios], columns: slice) -> Ratios:
    """All points, one after another, of some columns of the values."""

    def flat(name: str) -> NDArray[np.float64]:
        arrays = [getattr(each, name)[..., columns] for each in ratios]
        return np.concatenate([array.reshape(*array.shape[:-2], -1) for array in arrays], axis=-1)

    width = columns.stop - columns.start
    first = np.repeat(np.arange(len(ratios)) * width, [each.difference[:, columns].size for each in ratios])
    return Ratios(
        difference=flat("difference"),
        common=flat("common"),
        difference_parts=flat("difference_parts"),
        common_parts=flat("common_parts"),
        degrees=flat("degrees"),
        curve=first + flat("curve").astype(np.intp) - columns.start,
        curve_parts=_stacked([np.moveaxis(each.curve_parts[..., columns], 2, 1) for each in ratios]),
    )


def _stacked(curves: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Curves (scenes, curves, places) of several pairs, with places of no error added to those that have fewer."""
    places = max(each.shape[2] for each in curves)
    padded = [np.pad(each, ((0, 0), (0, 0), (0, places - each.shape[2]))) for each in curves]
    return np.concatenate(padded, axis=1)
