"""Whether white noise and walk depend on what a front end knows while it runs.

A factor on white noise and walk is piecewise linear in the logarithm of its covariate. Factors multiply. They are
fitted to changes of errors, by the likelihood

    -sum(n log v + S / v),  v = (covariates.expected) / n    (conditions)

with counts n and sums S of half squared lengths by class of the covariates at both ends of changes.

What a factor gains over a constant one is measured on scenes that were left out, those of a group together. Of the
covariates whose gain exceeds `LEAST_GAIN` nat per change, with an interval that does not reach 0, the best one is kept.
A second covariate is kept by the same rule, if it gains as much beyond the first one. Both factors are then fitted
together, to sums by the classes of both covariates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy import linalg
from scipy.optimize import minimize

from tracknoise.estimators.components import LEAST_GROUPS, group_numbers
from tracknoise.estimators.model import Factor, Interval
from tracknoise.inference.jackknife import student_interval
from tracknoise.inference.track_noise import COMPONENTS
from tracknoise.inference.units import NO_GROUPS, SceneGroups
from tracknoise.statistics.noise_sums import MOTION, PER_OCTAVE, log_centre
from tracknoise.tables.schema import CHANGE_TERMS

if TYPE_CHECKING:
    from tracknoise.estimators.components import FittedComponents


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
    "match_score": Trend.FALLING,
}
"""By covariate; that of all others is `Trend.ANY`."""
_LABELS = ("group", "classes", "before", "now")
_SUMS = ("count", "squares", "now_scaled", "before_scaled", "unscaled")
_SHARES = (0.05, 0.35, 0.65, 0.95)
"""Shares of the changes below the knots."""
_NARROWEST = 0.25
"""Least distance of two knots, natural logarithm."""
_RIDGE = 1.0
"""Weight of a squared log factor, nat: classes without data stay near 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Knots:
    """Where a factor may bend, and how it may change."""

    of: str  # name of the covariate
    places: Array  # (knots,) float64: natural logarithms of the covariate, increasing

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
    """Sums by class of covariates at both ends of changes, one cell each."""

    group: NDArray[np.intp]  # (cells,) intp: number of the group of scenes, from 0
    classes: NDArray[np.intp]  # (cells,) intp: the same number where all classes are the same
    # before, now: (cells, covariates) float64: natural logarithms of the covariates
    before: Array
    now: Array
    # count, squares: (cells,) float64, columns of `tracknoise.tables.schema.NOISE_COVARIATES`
    count: Array
    squares: Array
    # (cells,) float64, px^2: expected squares that the factor at the second end multiplies, that at the first, and none
    now_scaled: Array
    before_scaled: Array
    unscaled: Array

    @classmethod
    def of(
        cls, table: pl.DataFrame, ends: Sequence[tuple[str, str]], per_octave: int, sizes: Mapping[str, float]
    ) -> "Cells":
        """From sums with a column group; `ends` are columns of classes, before and now, of each covariate.

        `sizes`: half traces of the components, px^2.
        """
        columns = [column for pair in ends for column in pair]
        group, classes = (
            table.select(pl.struct(by).rank("dense")).to_series().to_numpy().astype(np.intp) - 1
            for by in (["group"], columns)
        )
        before, now = (
            np.stack([log_centre(table[pair[end]].to_numpy().astype(np.int64), per_octave) for pair in ends], axis=1)
            for end in (0, 1)
        )
        sums = {name: table[name].to_numpy().astype(np.float64) for name in ("n", *CHANGE_TERMS)}
        own = {one.name: sizes[one.name] * sums[one.name] for one in COMPONENTS if one.name in sums}
        scaled, unscaled = (
            sum(
                (own[one.name] for one in COMPONENTS if one.name in own and one.has_factor is has), np.zeros(len(table))
            )
            for has in (True, False)
        )
        before_scaled, now_scaled = (sizes["white"] * sums[name] for name in ("white_before", "n"))
        return cls(
            group, classes, before, now, sums["n"], sums["squares"], now_scaled + scaled, before_scaled, unscaled
        )

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
        new, old = self.now_scaled * f_now, self.before_scaled * f_before
        mean = np.maximum((new + old + self.unscaled) / self.count, 1e-300)
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


LEAST_GAIN = 0.01
"""Nat per change."""
_FOLDS = 10


def conditions_of(
    covariates: pl.DataFrame,
    pairs: pl.DataFrame,
    fitted: "FittedComponents",
    *,
    groups: SceneGroups = NO_GROUPS,
    level: float,
) -> tuple[Factor, ...]:
    """The factors that are worth keeping: none, one or two.

    `covariates`: schema `NOISE_COVARIATES`, of one tracker and speed. `pairs`: schema `NOISE_PAIRS`, of the same.
    """
    first = _best(candidates(covariates, fitted, groups=groups, level=level))
    if first is None:
        return ()
    added = {both[1].of: both for both in second_candidates(pairs, first, fitted, groups=groups, level=level)}
    second = _best([both[1] for both in added.values()])
    return (first,) if second is None else added[second.of]


def candidates(
    covariates: pl.DataFrame, fitted: "FittedComponents", *, groups: SceneGroups = NO_GROUPS, level: float
) -> list[Factor]:
    """The factor by each covariate that varies, with what it gains; see `conditions_of` for the parameters."""
    found = []
    for (name,), part in _parts(covariates, ["covariate"], fitted, groups):
        cells = Cells.of(part, [("before", "now")], PER_OCTAVE, _sizes(fitted))
        knots = cells.knots([str(name)])
        if len(knots[0].places) > 1:
            gain = _gain(cells, knots, [knots[0].constant], level)
            found.append(_factor(knots[0], cells.fitted(knots), gain))
    return found


def second_candidates(
    pairs: pl.DataFrame, first: Factor, fitted: "FittedComponents", *, groups: SceneGroups = NO_GROUPS, level: float
) -> list[tuple[Factor, Factor]]:
    """Both factors, fitted together, for each other covariate, with what it gains beyond the first one."""
    found = []
    with_first = pairs.filter((pl.col("first") == first.of) | (pl.col("second") == first.of))
    for names, part in _parts(with_first, ["first", "second"], fitted, groups):
        cells = Cells.of(part, [("first_before", "first_now"), ("second_before", "second_now")], 1, _sizes(fitted))
        knots = cells.knots([str(name) for name in names])
        own, other = (0, 1) if names[0] == first.of else (1, 0)
        if len(knots[own].places) > 1 and len(knots[other].places) > 1:
            alone = [one if place == own else one.constant for place, one in enumerate(knots)]
            gain = _gain(cells, knots, alone, level)
            logs = np.split(cells.fitted(knots), [len(knots[0].places)])
            found.append((_factor(knots[own], logs[own], first.gain), _factor(knots[other], logs[other], gain)))
    return found


def _parts(
    table: pl.DataFrame, names: list[str], fitted: "FittedComponents", groups: SceneGroups
) -> list[tuple[tuple[object, ...], pl.DataFrame]]:
    """Rows by covariate, with the number of the group of their scene; none where too little is known."""
    scaled = sum(_sizes(fitted)[one.name] for one in COMPONENTS if one.has_factor)
    numbered = table.with_columns(group=pl.Series(group_numbers(table, groups)))
    if numbered["group"].n_unique() < LEAST_GROUPS or not scaled > 0.0:
        return []
    return sorted(numbered.partition_by(names, as_dict=True).items())


def _sizes(fitted: "FittedComponents") -> dict[str, float]:
    return {name: part.sigma.value**2 for name, part in fitted.components.items()}


def _factor(knots: Knots, logs: Array, gain: Interval) -> Factor:
    return Factor(of=knots.of, log_knots=tuple(knots.places.tolist()), log_factor=tuple(logs.tolist()), gain=gain)


def _best(found: Sequence[Factor]) -> Factor | None:
    kept = [one for one in found if one.gain.value > LEAST_GAIN and one.gain.low is not None and one.gain.low > 0.0]
    return max(kept, key=lambda one: one.gain.value, default=None)


def _gain(cells: Cells, knots: Sequence[Knots], simpler: Sequence[Knots], level: float) -> Interval:
    """What factors gain over simpler ones on scenes that were left out, nat per change."""
    count = cells.n_groups
    gain, n = np.zeros(count), np.zeros(count)
    for fold in range(min(_FOLDS, count)):
        left = cells.group % min(_FOLDS, count) == fold
        rest = cells.chosen(~left)
        with_all, with_fewer = rest.fitted(knots), rest.fitted(simpler)
        for group in np.unique(cells.group[left]):
            own = cells.chosen(cells.group == group)
            gain[group] = own.cost(simpler, with_fewer) - own.cost(knots, with_all)
            n[group] = own.count.sum()
    return mean_gain(gain, n, level)


def mean_gain(gain: Array, n: Array, level: float) -> Interval:
    """Gains (units,) over counts (units,), all together, with the interval over units; no bounds with one unit."""
    value = gain.sum() / n.sum()
    if len(gain) < 2:
        return Interval(value=float(value))
    without = (gain.sum() - gain) / (n.sum() - n)
    low, high = student_interval(value, without, level=level, sizes=n)
    return Interval.of(float(value), float(low), float(high))
