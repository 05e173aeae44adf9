"""Errors that all features of a frame have in common: their share of the variance, and what they add to sigma.

Let p be what one half of the tracks of a frame says about the other half: the motion of the image by one small error of
the pose (`tracknoise.truth_faults.pose_errors`). With errors e, means over errors of the same age k, and the number n_k
of predictions, the share of the variance of errors that all features of a frame have in common is

    share = sum_k n_k mean_k(e' p) / sum_k n_k mean_k(e' e)    (common.share)

The mean of e' p is not changed by noise that is independent from track to track, and that of e' e is without outliers.
It contains shifts, rotations about any axis, and whatever else moves the image as a camera does.

A shift by the same draw in all observations of a frame, and one that walks with the frames, differ in what they do to
poses. So their variances are fitted to the means of each age,

    mean_k(e' p) / 2 = white + k walk,  white, walk >= 0    (common.parts)

with weights n_k / mean_k(e' e)^2. White is that about the first position, which has a part of its own where the noise
of the tracker has one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators.model import Interval
from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.intervals import Method, Statistics, pooled
from tracknoise.inference.units import SceneGroups, Units
from tracknoise.tables.enumerations import FittedTo, Product

Array = NDArray[np.float64]

_COLUMNS = ("predictions", "predicted", "n", "squares")
_LEAST = 50


@dataclass(frozen=True, slots=True, eq=False)
class CommonErrors:
    """What was measured of errors in common, by scene, or by block where there are few scenes."""

    units: Units
    used: NDArray[np.bool_]  # (ages,): with enough errors and predictions
    level: float

    @classmethod
    def of(cls, rigid: pl.DataFrame, sums: pl.DataFrame, *, groups: SceneGroups, level: float) -> "CommonErrors | None":
        """None where nothing was measured, as at all speeds but the lowest, or where all errors are 0.

        `rigid`: schema `RIGID`, of one tracker and speed. `sums`: schema `NOISE_SUMS`, of the same.
        """
        table = pl.concat([_predictions(rigid), _squares(sums)], how="diagonal").fill_null(0)
        units = units_of(table.drop("block"), table, points=["age"], columns=_COLUMNS, groups=groups)
        whole = units.sums.sum(axis=0).T
        used = (whole[0] >= _LEAST) & (whole[2] >= _LEAST)
        if not used.any() or not (whole[3, used] > 0).any():
            return None
        return cls(units, np.asarray(used), level)

    @property
    def share(self) -> Interval:
        """(common.share), from 0 to 1."""
        counts = self._whole[0, self.used]

        def shares(sums: Array) -> Array:
            predicted, total = (np.einsum("k,k...->...", counts, self._means(sums, place)) for place in (0, 2))
            return np.asarray(predicted / np.where(total > 0, total, np.nan))[None, None]

        return self._estimated(shares, 1)[0].within(0.0, 1.0)

    def variances(self, by_white: Sequence[float], by_walk: Sequence[float]) -> list[Interval]:
        """Sums of the variances of (common.parts), each times a factor, px^2; the walk is per frame of the recording.

        Which of the two are above 0 is what all scenes together say.
        """
        factors, solution = np.array([by_white, by_walk]).T, self._solution()

        def statistics(sums: Array) -> Array:
            found = np.einsum("fc,ck,k...->f...", factors, solution, self._means(sums, 0) / 2.0)
            return np.asarray(found[:, None])

        return [one.within(0.0, np.inf) for one in self._estimated(statistics, len(factors))]

    def _solution(self) -> Array:
        """(2, ages): what multiplies means of products to give white and walk by least squares."""
        age = self.units.points["age"].to_numpy()[self.used].astype(np.float64)
        weight = self._whole[0, self.used] / np.maximum(self._means(self._whole, 2), 1e-300) ** 2
        products, columns = self._means(self._whole, 0), np.stack([np.ones_like(age), age])
        weighted = columns * weight
        found = np.zeros_like(columns)
        if len(age) > 1:
            found = np.linalg.solve(weighted @ columns.T, weighted)
            if (found @ products >= 0.0).all():
                return np.asarray(found)
        alone = weighted / (weighted * columns).sum(axis=1, keepdims=True)
        left = (weight * np.square(products - columns * (alone @ products)[:, None])).sum(axis=1)
        is_better = np.arange(2) == (np.argmin(left) if len(age) > 1 else 0)
        return np.where(is_better[:, None], alone, 0.0)

    @property
    def _whole(self) -> Array:
        return np.asarray(self.units.sums.sum(axis=0).T)

    def _means(self, sums: Array, place: int) -> Array:
        """Mean at each age of the sums after a count, (ages, ...); 0 without any."""
        return np.asarray(sums[place + 1, self.used] / np.maximum(sums[place, self.used], 1.0))

    def _estimated(self, statistics: Statistics, count: int) -> list[Interval]:
        units = self.units
        sizes = np.broadcast_to(units.sums[..., 2].sum(axis=1), (count, 1, len(units.sums)))
        method = Method(IntervalKind.student, self.level)
        found = pooled(units, np.zeros((0, len(units.sums))), statistics, method, sizes=sizes)
        bounds = zip(found.value[:, 0], found.low[:, 0], found.high[:, 0], strict=True)
        return [Interval.of(*map(float, own)) for own in bounds]


def _predictions(rigid: pl.DataFrame) -> pl.DataFrame:
    own = rigid.filter(pl.col("fitted_to") == FittedTo.own)
    products = pl.col("rigid_uu") + pl.col("rigid_vv")
    return own.select("dataset", "scene", "block", "age", predictions=pl.col("n").cast(pl.Float64), predicted=products)


def _squares(sums: pl.DataFrame) -> pl.DataFrame:
    errors = sums.filter(pl.col("product") == Product.error)
    squares = pl.col("uu") + pl.col("vv")
    return errors.select("dataset", "scene", "block", "age", n=pl.col("n").cast(pl.Float64), squares=squares)
