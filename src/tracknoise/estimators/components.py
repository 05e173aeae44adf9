"""The components of the noise of one tracker: which are there, how large they are, and how certain that is.

Each product at each age gives one equation, (error_products.expected) divided by its count:

    y = x A_0 + x_1 A_1 + ...,  y and A_j symmetric 2x2    (equations)

Its standard error is taken to be t sqrt(2 / n + OWN^2), where t is half the trace of the product, or of the change if
the product is lagged. That is what n Gaussian errors have, and a share for what the components do not describe. Where n
is large, all equations count by their relative error. t counts as at least `_SMALLEST` times the largest one: where all
but the first position is nearly exact, the weights would otherwise differ by more than the precision of the numbers.

How well components describe what they were not fitted to is measured by the log likelihood of an error given the one
before, of Gaussian errors with the mean variance of the two coordinates:

    log p(e_k | e_(k-1)) = -log v - m / v + constant,  v = V(e_k | e_(k-1)),  m its measured mean square    (held_out)

From r e_(k-1), with moments S_00 = `before`, S_11 = `error` and S_01 = (S_11 + S_00 - `change`) / 2, the best
prediction is b r e_(k-1) with b = S_01 / S_00, all as the components have it, and v = S_11 - b S_01. What is left out
in turn is independent of the rest: groups of scenes, or blocks of tracks where scenes are few. With fewer than
`LEAST_GROUPS` groups, single scenes are left out; what is found then holds for these groups only.

A component is dropped if the interval of its variance reaches 0, or if what was left out is not described better with
it. This is done one at a time, the least certain first, and the others are fitted again. As there are four components,
these intervals have a quarter of the usual error probability. The order may mislead where components are alike. If
others, which are no more and all certain, describe better what was left out, these are kept.

Some decisions are close. A component that was kept is doubtful if its interval at `ALMOST_CERTAIN` reaches 0. One that
was dropped is doubtful if its interval at the level of the model does not. The opposite decision on each gives an
alternative. Intervals are the smallest ones that contain those of the model and of its alternatives.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.optimize import nnls

from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators.model import NO_COMPONENT, Component, Interval
from tracknoise.exceptions import SettingsError
from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.intervals import Method, pooled
from tracknoise.inference.track_noise import NAMES, TrackNoise
from tracknoise.inference.units import Resampled, SceneGroups, Units, by_number
from tracknoise.tables.enumerations import Product

LEAST_GROUPS = 3


def independent_sums(units: Units) -> NDArray[np.float64]:
    """Sums of what is left out in turn, (groups, points, columns); of blocks where blocks are resampled."""
    if units.resampled == Resampled.blocks:
        return units.sums
    number = units.scene_group[units.scene]
    return by_number(number, units.sums) if _are_enough(number) else units.sums


def independent_noun(units: Units) -> str:
    """What `independent_sums` are of, in the plural; blocks are scenes where each scene has no more than one."""
    if units.resampled == Resampled.blocks:
        of_scene = np.bincount(units.scene[units.sums[..., 0].any(axis=1)])
        return "blocks of tracks" if of_scene.max(initial=0) > 1 else "scenes"
    n_groups = len(np.unique(units.scene_group))
    return "groups of scenes" if LEAST_GROUPS <= n_groups < len(units.scenes) else "scenes"


def group_numbers(table: pl.DataFrame, groups: SceneGroups) -> NDArray[np.intp]:
    """Number of what the scene of each row is left out with, from 0, (rows,): its group, or the scene itself.

    `table`: column scene. If there are groups, also a column dataset, with one value.
    """
    names = table["scene"].unique().sort().to_list()
    number = groups.of(_dataset(table), names)
    chosen = number if _are_enough(number) else np.arange(len(names))
    return np.asarray(chosen[np.searchsorted(names, table["scene"].to_list())], dtype=np.intp)


def _dataset(table: pl.DataFrame) -> str:
    return str(table["dataset"][0]) if "dataset" in table.columns and table.height else ""


def _are_enough(number: NDArray[np.intp]) -> bool:
    return len(np.unique(number)) >= LEAST_GROUPS


Array = NDArray[np.float64]

COLUMNS = ("n", "uu", "uv", "vv", *NAMES)
"""Columns of sums, by product and age."""
OWN = 0.05
"""How far off the components may be, relative to a second moment."""
LEAST = 50
"""Fewest products of an equation."""
_SMALLEST = 1e-6
"""Half trace of a product, relative to the largest one."""
_TINY = 1e-12
"""px^2, where there is no noise."""
_ROUNDS, _ENOUGH = 2000, 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """Second moments and what multiplies the components in them."""

    second: Array  # (equations, 3, ...): uu, uv and vv, px^2
    factors: Array  # (equations, 4, ...): of the components

    @classmethod
    def of(cls, sums: Array) -> "Equations":
        """From sums (COLUMNS, equations, ...); NaN where a count is 0."""
        counts = np.where(sums[0] > 0, sums[0], np.nan)
        means = np.moveaxis(sums[1:] / counts, 0, 1)
        return cls(means[:, :3], means[:, 3:])

    @property
    def half_trace(self) -> Array:
        """(equations, ...) float64, px^2."""
        return np.asarray(0.5 * (self.second[:, 0] + self.second[:, 2]))

    def solved(self, weights: Array, active: Sequence[int]) -> Array:
        """Components (len(active), 3, ...) by least squares: entries uu, uv, vv, which may be negative."""
        x, y = np.nan_to_num(self.factors[:, list(active)]), np.nan_to_num(self.second)
        left = np.moveaxis(np.einsum("e,ei...,ej...->ij...", weights, x, x), (0, 1), (-2, -1))
        right = np.moveaxis(np.einsum("e,ei...,ek...->ik...", weights, x, y), (0, 1), (-2, -1))
        return np.moveaxis(np.linalg.pinv(left, hermitian=True) @ right, (-2, -1), (0, 1))

    def half_traces(self, weights: Array, active: Sequence[int]) -> Array:
        """Half the trace of each active component by least squares, (len(active), ...) float64, px^2."""
        solved = self.solved(weights, active)
        return np.asarray(0.5 * (solved[:, 0] + solved[:, 2]))

    def bounded(self, weights: Array, active: Sequence[int]) -> Array:
        """The same for one set of sums, without negative eigenvalues: (len(active), 3); 0 where all weights are 0."""
        x = np.nan_to_num(self.factors[:, list(active)])
        left, right = (x * weights[:, None]).T @ x, (x * weights[:, None]).T @ np.nan_to_num(self.second)
        found = np.array([without_negative(row) for row in self.solved(weights, active)])
        for _ in range(_ROUNDS):
            before = found.copy()
            for place in np.flatnonzero(np.diag(left)):
                rest = right[place] - left[place] @ found + left[place, place] * found[place]
                found[place] = without_negative(rest / left[place, place])
            if np.abs(found - before).max() <= _ENOUGH * np.abs(found).max():
                break
        return found


def weights_of(counts: Array, points: pl.DataFrame, equations: Equations) -> Array:
    """Weights (equations,) of squared residuals; 0 where there are fewer than `LEAST` products.

    Half traces are first the measured ones, then those of a fit: where few products happen to be small, they would
    count for too much.
    """
    every = range(len(NAMES))
    first = _weights(counts, points, equations.half_trace)
    modelled = np.einsum("ea,a->e", equations.factors, _half(equations.bounded(first, every)))
    return _weights(counts, points, modelled)


def _half(entries: Array) -> Array:
    return np.asarray(0.5 * (entries[:, 0] + entries[:, 2]))


def _weights(counts: Array, points: pl.DataFrame, half_trace: Array) -> Array:
    scale = _scales(points, half_trace)
    enough = (counts >= LEAST) & (scale > 0.0) & (points["product"] != Product.before).to_numpy()
    floored = np.maximum(scale, _SMALLEST * scale.max(initial=0.0))
    usual = np.where(enough, floored, 1.0) ** 2 * _relative_variance(counts)
    return np.where(enough, 1.0 / usual, 0.0)


def _relative_variance(counts: Array) -> Array:
    """Of an equation of so many products, over the square of its half trace."""
    return np.asarray(2.0 / np.maximum(counts, 1.0) + OWN**2)


def _scales(points: pl.DataFrame, half_trace: Array) -> Array:
    """Half the trace of each product; for lagged ones that of the change at the same age."""
    own = points.with_columns(pl.col("product").cast(pl.String), scale=half_trace)
    changes = own.filter(pl.col("product") == Product.change).select("age", change="scale")
    lagged = pl.col("product") == Product.lagged
    joined = own.join(changes, on="age", how="left", maintain_order="left")
    return joined.select(pl.when(lagged).then("change").otherwise("scale").fill_null(0.0)).to_series().to_numpy()


def without_negative(entries: Array) -> Array:
    """The nearest matrix without negative eigenvalues, as entries uu, uv, vv, (3,)."""
    values, vectors = np.linalg.eigh(matrix(entries))
    nearest = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return np.array([nearest[0, 0], nearest[0, 1], nearest[1, 1]])


def matrix(entries: Array) -> Array:
    """Entries uu, uv, vv as a symmetric (2, 2) matrix."""
    return np.array([[entries[0], entries[1]], [entries[1], entries[2]]])


Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """Equations of errors, and of the same products at the same ages that predict them."""

    # error, before, change: (steps,): places among all equations, by increasing age; 0 where there is none
    error: Rows
    before: Rows
    change: Rows
    predicted: NDArray[np.bool_]  # (steps,): whether `before` and `change` are known

    @classmethod
    def of(cls, points: pl.DataFrame) -> "Steps":
        """From the columns product and age: one row per equation, sorted by age within each product."""
        numbered = points.with_columns(pl.col("product").cast(pl.String)).with_row_index("row")
        rows = numbered.filter(product=Product.error).select("age", error="row")
        for kind in (Product.before, Product.change):
            same = numbered.filter(product=kind).select("age", pl.col("row").alias(kind))
            rows = rows.join(same, on="age", how="left", maintain_order="left")
        known = rows.select(pl.all_horizontal(pl.all().is_not_null())).to_series().to_numpy()
        error, before, change = (
            rows[kind].fill_null(0).to_numpy().astype(np.intp)
            for kind in (Product.error, Product.before, Product.change)
        )
        return cls(error, before, change, known)

    def log_likelihoods(self, counts: Array, measured: Array, modelled: Array) -> Array:
        """Log likelihood of the errors of each scene, per error, by (held_out), nat, without its constant.

        Shapes: counts (equations, scenes), measured, modelled (equations, scenes) px^2; returns (scenes,). NaN for
        scenes without errors.
        """
        n = np.nan_to_num(counts[self.error])
        variance, square = self._conditional(measured, modelled)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = -np.log(variance) - square / variance
        total, errors = np.where(n > 0, n * found, 0.0).sum(axis=0), n.sum(axis=0)
        return np.asarray(total / np.where(errors > 0, errors, np.nan))

    def _conditional(self, measured: Array, modelled: Array) -> tuple[Array, Array]:
        """Modelled variance and measured mean square of what the error before does not predict, (steps, scenes)."""
        s11, s00, s01 = self._moments(modelled)
        slope = np.where(self.predicted[:, None], s01 / np.where(s00 > 0.0, s00, np.inf), 0.0)
        o11, o00, o01 = self._moments(measured)
        return s11 - slope * s01, o11 - 2.0 * slope * o01 + slope**2 * o00

    def _moments(self, values: Array) -> tuple[Array, Array, Array]:
        s11, s00 = values[self.error], np.nan_to_num(values[self.before])
        return s11, s00, 0.5 * (s11 + s00 - np.nan_to_num(values[self.change]))


@dataclass(frozen=True, slots=True, eq=False)
class LeftOut:
    """What is left out in turn, and all others."""

    # own, others: equations of what is left out, and of all others, (equations, ..., units)
    own: Equations
    others: Equations
    counts: Array  # (equations, units) float64, of what is left out
    steps: Steps  # how errors are predicted

    @classmethod
    def of(cls, points: pl.DataFrame, sums: Array) -> "LeftOut | None":
        """From sums (units, equations, columns) of independent units; None if fewer than two have any errors.

        `points`: columns product and age: one row per equation. `sums`: columns
        `tracknoise.estimators.components.COLUMNS`.
        """
        some, steps = sums[sums[..., 0].any(axis=1)], Steps.of(points)
        if len(some) < 2:
            return None
        own, others = (Equations.of(np.transpose(each, (2, 1, 0))) for each in (some, some.sum(axis=0) - some))
        return cls(own, others, some[..., 0].T, steps)

    def score(self, weights: Array, active: Sequence[int]) -> float:
        """Mean log likelihood of what was left out, under the active components fitted to all others, nat per error."""
        half = np.maximum(self.others.half_traces(weights, active), 0.0)
        modelled = np.einsum("eau,au->eu", np.nan_to_num(self.own.factors[:, list(active)]), half)
        found = self.steps.log_likelihoods(self.counts, self.own.half_trace, modelled)
        return float(np.average(found, weights=self.counts.sum(axis=0)))


@dataclass(frozen=True, slots=True, eq=False)
class Bounded:
    """Estimates of n numbers, px^2, with their bounds, (n,) each; NaN where there is no interval."""

    value: Array
    low: Array
    high: Array


@dataclass(frozen=True, slots=True, eq=False)
class WeightedSums:
    """What components are fitted to."""

    units: Units  # sums by product and age, columns `tracknoise.estimators.components.COLUMNS`
    weights: Array  # (equations,) float64, of squared residuals
    left_out: LeftOut | None  # what is left out in turn; None if nothing can be
    _scores: dict[tuple[int, ...], float] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, units: Units, weights: Array) -> "WeightedSums":
        """Of the units of a condition."""
        return cls(units, weights, LeftOut.of(units.points, independent_sums(units)))

    def half_traces(self, active: Sequence[int], *, scale: str, level: float) -> Bounded:
        """Half traces of the active components. Intervals are those of Student from the jackknife on a scale."""

        def statistics(sums: Array) -> Array:
            return Equations.of(sums).half_traces(self.weights, active)[:, None]

        found = pooled(
            self.units,
            np.zeros((0, len(self.units.sums))),
            statistics,
            Method(IntervalKind.student, level),
            scales=[scale] * len(active),
            sizes=self.units.sums[..., 0].sum(axis=1)[None],
        )
        return Bounded(found.value[:, 0], found.low[:, 0], found.high[:, 0])

    def gains(self, active: Sequence[int]) -> Array:
        """What each active component gains in log likelihood on what was left out, nat per error; NaN with one."""
        if len(active) < 2:
            return np.full(len(active), np.nan)
        every = self.held_out(active)
        others = [[one for one in active if one != left] for left in active]
        return np.array([every - self.held_out(rest) for rest in others])

    def held_out(self, active: Sequence[int]) -> float:
        """Mean log likelihood of what was left out in turn, nat per error; NaN if nothing can be left out.

        It is computed once for each choice of components, because a selection asks for most of them several times.
        """
        if self.left_out is None:
            return float("nan")
        chosen = tuple(active)
        if chosen not in self._scores:
            self._scores[chosen] = self.left_out.score(self.weights, chosen)
        return self._scores[chosen]


ALMOST_CERTAIN = 0.999
"""Level of the interval of a component that is kept without doubt."""
_ROUNDING = 1e-12
"""A variance that is smaller, relative to the largest component, counts as 0."""


@dataclass(frozen=True, slots=True, eq=False)
class Dropped:
    """Why a component was dropped, and how large its standard deviation may be, px; None if that is not known."""

    why: str
    most_px: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """Numbers of the components that were kept, what else they might be, and those that were dropped."""

    active: tuple[int, ...]
    alternatives: tuple[tuple[int, ...], ...]
    dropped: dict[int, Dropped]


def select(sums: "WeightedSums", *, level: float) -> Selection:
    """Choose the components, and say what is known of the others."""
    strict = _strict(level)
    active, eliminated, dropped = _chosen(sums, strict)
    better = f"other components describe {independent_noun(sums.units)} that were left out better"
    swapped = {one: Dropped(better, _most(sums, (*active, one), strict)) for one in eliminated if one not in active}
    out = {one: why for one, why in {**dropped, **swapped}.items() if one not in active}
    return Selection(active, _alternatives(sums, active, level), out)


def _strict(level: float) -> float:
    return 1.0 - (1.0 - level) / len(NAMES)


def _chosen(sums: "WeightedSums", level: float) -> tuple[tuple[int, ...], tuple[int, ...], dict[int, Dropped]]:
    """What is kept, and what `_eliminated` found."""
    eliminated, dropped = _eliminated(sums, level)
    return _better(sums, eliminated, level), eliminated, dropped


def _eliminated(sums: "WeightedSums", level: float) -> tuple[tuple[int, ...], dict[int, Dropped]]:
    """What is left if components are dropped one at a time, and those that were dropped."""
    active, dropped = list(range(len(NAMES))), dict[int, Dropped]()
    while True:
        found, gains = sums.half_traces(active, scale="linear", level=level), sums.gains(active)
        worst = _least_certain(found, gains)
        if worst is None or len(active) == 1:
            return tuple(active), dropped
        dropped[active[worst]] = _reason(found, gains, worst, independent_noun(sums.units))
        del active[worst]


def _better(sums: "WeightedSums", active: tuple[int, ...], level: float) -> tuple[int, ...]:
    """The components, no more than the active ones, that describe best what was left out."""
    others = [each for size in range(1, len(active) + 1) for each in combinations(range(len(NAMES)), size)]
    own = sums.held_out(active)
    better = {each: found for each in others if (found := sums.held_out(each)) > own}
    certain = [each for each in better if _are_certain(sums.half_traces(each, scale="linear", level=level))]
    return max(certain, key=lambda each: better[each], default=active)


def _are_certain(found: "Bounded") -> bool:
    return bool((found.low > _least_variance(found)).all())


def _least_variance(found: "Bounded") -> float:
    """Variance up to which one counts as 0."""
    return _ROUNDING * float(found.value.max())


def _least_certain(found: "Bounded", gains: Array) -> int | None:
    """Place of the component to drop; None if all are to be kept."""
    least = _least_variance(found)
    reaches = np.where(np.isnan(found.low), found.value <= least, found.low <= least)
    doubtful = reaches | (gains <= 0.0)
    if not doubtful.any():
        return None
    width = np.where(np.isnan(found.low), 1.0, found.value - found.low)
    certainty = found.value / np.where(width > 0.0, width, 1.0)
    return int(np.argmin(np.where(doubtful, certainty, np.inf)))


def _reason(found: "Bounded", gains: Array, place: int, left_out: str) -> Dropped:
    """Why a component is dropped, given the name of what is left out."""
    most = _upper_root(found.high[place])
    if found.low[place] <= _least_variance(found):
        return Dropped("the interval of its variance reaches 0", most)
    if found.value[place] <= 0.0:
        return Dropped("its variance is estimated as 0, without an interval", most)
    return Dropped(
        f"{left_out} that were left out are not described better with it ({gains[place]:+.2g} nat per error)", most
    )


def _most(sums: "WeightedSums", active: Sequence[int], level: float) -> float | None:
    """How large the standard deviation of the last component may be, px."""
    return _upper_root(sums.half_traces(active, scale="linear", level=level).high[-1])


def _upper_root(high: float) -> float | None:
    return None if np.isnan(high) else float(np.sqrt(max(high, 0.0)))


def _alternatives(sums: "WeightedSums", active: Sequence[int], level: float) -> tuple[tuple[int, ...], ...]:
    found = sums.half_traces(active, scale="linear", level=ALMOST_CERTAIN)
    doubtful = [one for one, low in zip(active, found.low, strict=True) if low <= 0.0 and len(active) > 1]
    fewer = [tuple(one for one in active if one != left) for left in doubtful]
    more = [(*active, other) for other in range(len(NAMES)) if other not in active]
    return (*fewer, *(each for each in more if sums.half_traces(each, scale="linear", level=level).low[-1] > 0.0))


@dataclass(frozen=True, eq=False)
class FittedComponents:
    """Components, and what they were fitted to."""

    components: dict[str, Component]  # by name, in the order of `NAMES`
    sums: WeightedSums  # sums, and weights of their equations
    selection: Selection  # numbers of the components that were kept, and alternatives
    level: float  # of the intervals

    @property
    def noise(self) -> TrackNoise:
        """The covariances, without their intervals."""
        return TrackNoise(**{name: part.covariance for name, part in self.components.items()})

    @property
    def undropped(self) -> TrackNoise:
        """The covariances if no component is dropped: where `select` decides closely, these hardly change."""
        return _noise(Equations.of(self.sums.units.sums.sum(axis=0).T), self.sums, range(len(NAMES)))

    def of_units(self) -> Array:
        """Components of each unit alone, (units, 4, 2, 2) px^2, by least squares.

        Those take part that non-negative least squares over all units find: the choice of `select` needs certainty,
        which few scenes do not give. No unit is bounded, because that would bias a mean over units. What the units have
        together counts for each component as one more measurement, as uncertain as the component would be large alone.
        """
        sums, root = self.sums.units.sums, np.sqrt(self.sums.weights)
        own, counts, every = Equations.of(sums.transpose(2, 1, 0)), sums[..., 0].T, Equations.of(sums.sum(axis=0).T)
        half, _ = nnls(root[:, None] * np.nan_to_num(every.factors), root * np.nan_to_num(every.half_trace))
        active = [int(one) for one in np.flatnonzero(half)] or list(self.selection.active)
        together = every.solved(self.sums.weights, active)
        alone = np.array([every.half_traces(self.sums.weights, [one])[0] for one in active])
        whole = self.sums.weights * _relative_variance(sums[..., 0].sum(axis=0))
        weights = np.where(counts > 0, whole[:, None] / _relative_variance(counts), 0.0)
        x, y = np.nan_to_num(own.factors[:, active]), np.nan_to_num(own.second)
        left = np.einsum("eu,eiu,eju->uij", weights, x, x)
        right = np.einsum("eu,eiu,eku->uik", weights, x, y)
        known = np.diag(1.0 / np.maximum(np.abs(alone), _TINY) ** 2)
        found = np.zeros((len(left), len(NAMES), 3))
        found[:, active] = np.linalg.solve(left + known, right + known @ together)
        return found[..., [0, 1, 1, 2]].reshape(len(found), len(NAMES), 2, 2)


def sums_of_units(sums: pl.DataFrame, groups: SceneGroups) -> Units:
    """What components are fitted to: the sums of a condition by unit.

    `sums`: rows of the condition, schema `NOISE_SUMS`.
    """
    return units_of(sums.drop("block"), sums, points=["product", "age"], columns=COLUMNS, groups=groups)


def fit_components(units: Units, *, level: float) -> FittedComponents:
    """Fit the components to the sums of a condition. `units`: sums by product and age, columns `COLUMNS`."""
    equations, sums = _weighted(units)
    selection = select(sums, level=level)
    every = {**_kept(equations, sums, selection, level), **_none(selection.dropped)}
    return FittedComponents({name: every[number] for number, name in enumerate(NAMES)}, sums, selection, level)


def fit_noise(units: Units, *, level: float) -> TrackNoise:
    """The covariances that `fit_components` returns. Without intervals and alternatives it takes half the time."""
    equations, sums = _weighted(units)
    active, *_ = _chosen(sums, _strict(level))
    return _noise(equations, sums, active)


def _noise(equations: Equations, sums: WeightedSums, active: Sequence[int]) -> TrackNoise:
    """The covariances of the active components."""
    covariances = equations.bounded(sums.weights, active)
    return TrackNoise(**{NAMES[number]: matrix(entries) for number, entries in zip(active, covariances, strict=True)})


def _weighted(units: Units) -> tuple[Equations, WeightedSums]:
    """Equations of all units together, and the weighted sums of each."""
    whole = units.sums.sum(axis=0).T
    if np.count_nonzero(whole[0] >= LEAST) < len(NAMES):
        raise SettingsError("noise model: found too few errors to fit, expected tracks of several frames")
    equations = Equations.of(whole)
    return equations, WeightedSums.of(units, weights_of(whole[0], units.points, equations))


def _kept(equations: Equations, sums: WeightedSums, selection: Selection, level: float) -> dict[int, Component]:
    """Components by number."""
    sizes = [_sizes(sums, active, level) for active in (selection.active, *selection.alternatives)]
    covariances = equations.bounded(sums.weights, selection.active)
    return {
        number: _component(entries, [each[number] for each in sizes if number in each])
        for number, entries in zip(selection.active, covariances, strict=True)
    }


def _sizes(sums: WeightedSums, active: Sequence[int], level: float) -> dict[int, tuple[float, float]]:
    """Bounds of the half trace of each active component, px^2."""
    found = sums.half_traces(active, scale="log", level=level)
    return {number: (low, high) for number, low, high in zip(active, found.low, found.high, strict=True)}


def _component(entries: Array, bounds: Sequence[tuple[float, float]]) -> Component:
    low, high = np.array(bounds).T
    return Component(
        covariance=matrix(entries),
        sigma=_root_interval(0.5 * (entries[0] + entries[2]), np.fmin.reduce(low), np.fmax.reduce(high)),
    )


def _none(dropped: Mapping[int, Dropped]) -> dict[int, Component]:
    """Components without noise."""
    found = {}
    for number, one in dropped.items():
        sigma = Interval(value=0.0, low=None if one.most_px is None else 0.0, high=one.most_px)
        found[number] = replace(NO_COMPONENT, sigma=sigma, why_dropped=one.why)
    return found


def _root_interval(square: float, low: float, high: float) -> Interval:
    """The square root of an estimate, with bounds that contain it."""
    value = float(np.sqrt(max(square, 0.0)))
    bounds = [None if np.isnan(bound) else float(np.sqrt(max(bound, 0.0))) for bound in (low, high)]
    lower, upper = bounds
    return Interval(
        value=value,
        low=None if lower is None else min(lower, value),
        high=None if upper is None else max(upper, value),
    )
