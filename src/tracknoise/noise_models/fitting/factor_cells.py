"""Factors on white noise and walk by covariates, fitted to sums of changes by the classes of these.

A factor is piecewise linear in the logarithm of its covariate. Factors multiply. They are fitted by the likelihood

    -sum(n log v + S / v),  v = (covariates.expected) / n    (conditions)

with counts n and sums S of half squared lengths by class of the covariates at both ends of changes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import linalg
from scipy.optimize import minimize

from tracknoise.statistics.noise.covariates import MOTION, log_centre

Array = NDArray[np.float64]


class Trend(Enum):
    """How a factor may change with its covariate: bounds of what it increases by from knot to knot, logarithms."""

    RISING = (0.0, 10.0)
    FALLING = (-10.0, 0.0)
    ANY = (-10.0, 10.0)


TRENDS = {
    MOTION: Trend.RISING,
    "lk_residual": Trend.RISING,
    "lk_min_eigenvalue": Trend.FALLING,
    "min_eigenvalue": Trend.FALLING,
    "descriptor_distance": Trend.RISING,
    "descriptor_ratio": Trend.RISING,
}
"""By covariate; that of all others is `Trend.ANY`."""
_LABELS = ("group", "classes", "before", "now")
_SUMS = ("count", "squares", "white_before", "walk", "drift")
_SHARES = (0.05, 0.35, 0.65, 0.95)
"""Shares of the changes below the knots."""
_NARROWEST = 0.25
"""Least distance of two knots, natural logarithm."""
_RIDGE = 1.0
"""Weight of a squared log factor, nat: classes without data stay near 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Knots:
    """Where a factor may bend, and how it may change.

    Parameters
    ----------
    of
        Name of the covariate.
    places
        (knots,) float64: natural logarithms of the covariate, increasing.
    """

    of: str
    places: Array

    @property
    def trend(self) -> Trend:
        """How the factor may change."""
        return TRENDS.get(self.of, Trend.ANY)

    @property
    def constant(self) -> "Knots":
        """The same without a bend: a factor that does not depend on the covariate."""
        return replace(self, places=self.places[:1])

    def weights(self, at: Array) -> Array:
        """(n, knots): by how much each knot counts at (n,), as in linear interpolation, constant beyond the ends."""
        return np.stack([np.interp(at, self.places, row) for row in np.eye(len(self.places))], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Sums by class of covariates at both ends of changes, one cell each.

    Attributes
    ----------
    group
        (cells,) intp: number of the group of scenes, from 0.
    classes
        (cells,) intp: the same number where all classes are the same.
    before, now
        (cells, covariates) float64: natural logarithms of the covariates.
    count, squares, white_before, walk, drift
        (cells,) float64, columns of `tracknoise.tables.schema.NOISE_COVARIATES`.
    sizes
        Half traces of W, Q and D, px^2.
    """

    group: NDArray[np.intp]
    classes: NDArray[np.intp]
    before: Array
    now: Array
    count: Array
    squares: Array
    white_before: Array
    walk: Array
    drift: Array
    sizes: tuple[float, float, float]

    @classmethod
    def of(
        cls, table: pl.DataFrame, ends: Sequence[tuple[str, str]], per_octave: int, sizes: tuple[float, float, float]
    ) -> "Cells":
        """From sums with a column group; `ends` are columns of classes, before and now, of each covariate."""
        columns = [column for pair in ends for column in pair]
        group, classes = (
            table.select(pl.struct(by).rank("dense")).to_series().to_numpy().astype(np.intp) - 1
            for by in (["group"], columns)
        )
        before, now = (
            np.stack([log_centre(table[pair[end]].to_numpy().astype(np.int64), per_octave) for pair in ends], axis=1)
            for end in (0, 1)
        )
        count, squares, white, walk, drift = (
            table[name].to_numpy().astype(np.float64) for name in ("n", "squares", "white_before", "walk", "drift")
        )
        return cls(group, classes, before, now, count, squares, white, walk, drift, sizes)

    @property
    def n_groups(self) -> int:
        """How many groups of scenes there are."""
        return int(self.group.max()) + 1

    def chosen(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> "Cells":
        """Some of the cells."""
        return replace(self, **{name: getattr(self, name)[rows] for name in (*_LABELS, *_SUMS)})

    def together(self) -> "Cells":
        """Cells of all groups together, as group 0."""
        _, first, place = np.unique(self.classes, return_index=True, return_inverse=True)
        sums: dict[str, Any] = {name: np.bincount(place, getattr(self, name), len(first)) for name in _SUMS}
        return replace(self.chosen(first), group=np.zeros(len(first), dtype=np.intp), **sums)

    def knots(self, names: Sequence[str]) -> list[Knots]:
        """Knots of each covariate at shares of the changes, not too near to each other."""
        return [Knots(name, _places(at, self.count)) for name, at in zip(names, self.now.T, strict=True)]

    def cost(self, knots: Sequence[Knots], logs: Array) -> float:
        """Minus (conditions), with the log factors at all knots in turn."""
        return self._cost(self._weights(knots), logs)[0]

    def fitted(self, knots: Sequence[Knots]) -> Array:
        """Log factors at all knots in turn."""
        cells = self.together()
        weights = cells._weights(knots)
        sums = linalg.block_diag(*[np.tri(len(one.places)) for one in knots])  # of the first one and its increases

        def objective(increases: Array) -> tuple[float, Array]:
            logs = sums @ increases
            cost, slope = cells._cost(weights, logs)
            return cost + _RIDGE * float(logs @ logs), sums.T @ (slope + 2.0 * _RIDGE * logs)

        bounds = [bound for one in knots for bound in (Trend.ANY.value, *[one.trend.value] * (len(one.places) - 1))]
        found = minimize(objective, np.zeros(len(sums)), jac=True, method="L-BFGS-B", bounds=bounds)
        return np.asarray(sums @ found.x)

    def _weights(self, knots: Sequence[Knots]) -> tuple[Array, Array]:
        """By how much each knot counts at both ends of the changes of each cell, (cells, all knots)."""
        before, now = (
            np.hstack([one.weights(at) for one, at in zip(knots, place.T, strict=True)])
            for place in (self.before, self.now)
        )
        return before, now

    def _cost(self, weights: tuple[Array, Array], logs: Array) -> tuple[float, Array]:
        """Minus (conditions), and its derivative by the log factors."""
        f_before, f_now = (np.exp(one @ logs) for one in weights)
        white, walk, drift = self.sizes
        new, old = (white * self.count + walk * self.walk) * f_now, white * self.white_before * f_before
        mean = np.maximum((new + old + drift * self.drift) / self.count, 1e-300)
        cost = float((self.count * np.log(mean) + self.squares / mean).sum())
        slope = (self.count - self.squares / mean) / mean / self.count
        return cost, np.asarray((slope * old) @ weights[0] + (slope * new) @ weights[1])


def _places(at: Array, count: Array) -> Array:
    order = np.argsort(at, kind="stable")
    share = np.cumsum(count[order]) / count.sum()
    kept: list[float] = []
    for place in at[order][np.minimum(np.searchsorted(share, _SHARES), len(order) - 1)]:
        if not kept or place - kept[-1] >= _NARROWEST:
            kept.append(float(place))
    return np.array(kept)
