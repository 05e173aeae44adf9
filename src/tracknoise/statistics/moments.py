"""Moments of errors in disjoint cells of observations, which can be pooled.

A central power sum of order (p, q) is sum((x - mean_x)^p (y - mean_y)^q), not divided by the count.

All other statistics of errors are computed from those of du, dv by age or frame. Scenes can therefore be pooled,
resampled and added later without reading the observations again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb
from types import MappingProxyType
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.grouping import Groups, IntegerArray, group_rows, number_combinations
from tracknoise.statistics.prepared import PreparedObservations, PreparedSequence
from tracknoise.tables.enumerations import Population, Trimming
from tracknoise.tables.schema import AXIS, BLOCKS, MOMENTS, ORIGIN, POPULATION, TRIMMING, Schema, check

Order = tuple[int, int]

FOURTH: tuple[Order, ...] = tuple((total - q, q) for total in (2, 3, 4) for q in range(total + 1))
"""(2, 0), (1, 1), (0, 2), (3, 0), ... (0, 4): every joint order from 2 to 4."""
VARIANCES: tuple[Order, ...] = ((2, 0), (0, 2))


@dataclass(frozen=True, slots=True)
class JointMoments:
    """Moments of g samples of pairs (x, y)."""

    # Order (p, q) of each column of `central`. With an order, every lower one down to 2 in total that its binomial
    # expansion needs must be there.
    orders: tuple[Order, ...]
    n: NDArray[np.int64]  # (g,): pairs in each sample
    mean: NDArray[np.float64]  # (g, 2): 0 where `n` is 0
    central: NDArray[np.float64]  # (g, len(orders): central power sums

    def of(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> "JointMoments":
        """Moments of some samples: which, (g,) bool, or their numbers."""
        return JointMoments(self.orders, self.n[chosen], self.mean[chosen], self.central[chosen])


def stack_moments(parts: Sequence[JointMoments]) -> JointMoments:
    """The samples of several moments of the same orders, one after another."""
    n, mean, central = (np.concatenate([getattr(part, name) for part in parts]) for name in ("n", "mean", "central"))
    return JointMoments(parts[0].orders, n, mean, central)


def measure_moments(
    pairs: NDArray[np.float64], group: NDArray[np.intp], count: int, *, orders: Sequence[Order] = FOURTH
) -> JointMoments:
    """Moments of each group of pairs, in two passes: means first, then powers of what differs from them.

    Shapes: pairs (rows, 2), group (rows,). `count`: some may be empty.
    """
    n = np.bincount(group, minlength=count)
    means, deviations = _centre(pairs, group, n)
    highest = max((max(order) for order in orders), default=0)
    x, y = (_powers(deviation, highest) for deviation in deviations)
    central = [np.bincount(group, x[p] * y[q], count) for p, q in orders]
    return JointMoments(tuple(orders), n, np.stack(means, axis=1), _columns(central, count))


def pool_moments(parts: JointMoments, group: NDArray[np.intp], count: int) -> JointMoments:
    """Moments of the union of the samples in each group, from the moments of the samples alone.

    Shifting a sample's central power sums to the pooled mean is a binomial expansion, which is exact (Chan, Golub and
    LeVeque 1979 for order 2, Pebay 2008 for higher and joint orders); the shifted sums then add up.
    """
    n = np.bincount(group, parts.n, count).astype(np.int64)
    means, shifts = _centre(parts.mean, group, n, weight=parts.n)
    central = [np.bincount(group, _about(parts, shifts, order), count) for order in parts.orders]
    return JointMoments(parts.orders, n, np.stack(means, axis=1), _columns(central, count))


def _centre(
    pairs: NDArray[np.float64],
    group: NDArray[np.intp],
    n: NDArray[np.int64],
    *,
    weight: NDArray[np.int64] | None = None,
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Of both columns the weighted mean of each group, (g,), and what each row differs from it, (rows,)."""
    means, deviations = [], []
    for column in np.ascontiguousarray(pairs.T):
        mean, deviation = np.zeros(len(n)), column
        for _ in range(2):  # the second round removes what rounding left of a mean that is large beside the spread
            weighted = deviation if weight is None else weight * deviation
            step = np.bincount(group, weighted, len(n)) / np.maximum(n, 1)
            mean, deviation = mean + step, deviation - step[group]
        means.append(mean)
        deviations.append(deviation)
    return means, deviations


def _columns(values: Sequence[NDArray[Any]], count: int) -> NDArray[np.float64]:
    """Arrays of (count,) side by side; there may be none."""
    return np.array(values, dtype=np.float64).reshape(len(values), count).T


def _about(parts: JointMoments, shifts: Sequence[NDArray[np.float64]], order: Order) -> NDArray[np.float64]:
    """Power sum of one order of each sample about the point that lies `shifts` below its mean, (samples,)."""
    p, q = order
    x, y = _powers(shifts[0], p), _powers(shifts[1], q)
    total = parts.n * x[p] * y[q]  # sums of order 1 about the sample's own mean are 0
    for column, (a, b) in enumerate(parts.orders):
        if a <= p and b <= q:
            total = total + comb(p, a) * comb(q, b) * parts.central[:, column] * x[p - a] * y[q - b]
    return total


def _powers(values: NDArray[np.float64], highest: int) -> list[NDArray[np.float64]]:
    """values^0 to values^highest."""
    powers = [np.ones_like(values)]
    for _ in range(highest):
        powers.append(powers[-1] * values)
    return powers


SECOND: tuple[Order, ...] = ((2, 0), (1, 1), (0, 2))
KEYS = [*ORIGIN, "population", "trimming", "axis", "at"]
"""Columns that identify a row of moments."""
_N, _MEAN_U, _MEAN_V = pl.col("n"), pl.col("mean_u").fill_null(0.0), pl.col("mean_v").fill_null(0.0)
ABOUT_ZERO: Mapping[str, pl.Expr] = MappingProxyType(
    {
        "u": _N * _MEAN_U,
        "v": _N * _MEAN_V,
        "uu": pl.col("m_uu") + _N * _MEAN_U**2,
        "uv": pl.col("m_uv") + _N * _MEAN_U * _MEAN_V,
        "vv": pl.col("m_vv") + _N * _MEAN_V**2,
    }
)
"""Sums about zero, which add up, from n, means and central sums."""
_MEANS, _ABSOLUTE_MEANS = ["mean_u", "mean_v"], ["mean_abs_u", "mean_abs_v"]
MOMENT_VALUES = {column: kind for column, kind in MOMENTS.items() if column not in KEYS}
"""Columns of moments that are no keys, with their types."""
_LABELS: Schema = {"population": POPULATION, "trimming": TRIMMING}


@dataclass(frozen=True, slots=True)
class MomentCells:
    """Moments of the errors of observations that agree in all keys."""

    keys: tuple[NDArray[np.intp], ...]  # sorted by the first key, then the second, and so on
    # signed, absolute: moments of (du, dv), and of their absolute values
    signed: JointMoments
    absolute: JointMoments

    def union(self, chosen: NDArray[np.bool_], *, by: int) -> "MomentCells":
        """Moments of all chosen cells that agree in the first keys."""
        keys, index = number_combinations([key[chosen] for key in self.keys[:by]])
        signed, absolute = (
            pool_moments(moments.of(chosen), index, len(keys[0])) for moments in (self.signed, self.absolute)
        )
        return MomentCells(keys, signed, absolute)


def by_trimming(
    cells: MomentCells, population: str, *, by: int, chosen: NDArray[np.bool_], kept: NDArray[np.bool_]
) -> dict[tuple[str, str], MomentCells]:
    """Moments of the chosen cells, and of those of them that trimming kept: what `tabulate` needs."""
    selections = {Trimming.untrimmed: chosen, Trimming.trimmed: chosen & kept}
    return {(population, trimming): cells.union(selected, by=by) for trimming, selected in selections.items()}


def measure_cells(
    error_px: NDArray[np.float64], keys: Sequence[IntegerArray], *, orders: Sequence[Order] = FOURTH
) -> MomentCells:
    """Moments of the errors of each cell, added up in the order of rows.

    Shapes: error_px (rows, 2), keys arrays of (rows,).
    """
    combined, index = number_combinations(keys)
    signed = measure_moments(error_px, index, len(combined[0]), orders=orders)
    absolute = measure_moments(np.abs(error_px), index, len(combined[0]), orders=_variances(orders))
    return MomentCells(combined, signed, absolute)


def tabulate(
    selections: Mapping[tuple[str, str], MomentCells], conditions: pl.DataFrame, *, names: Sequence[str], axis: str
) -> pl.DataFrame:
    """Moments of selections of observations as a table.

    Returns: columns of `ORIGIN`, `names`, population, trimming, axis and moments. Sorted by the columns of `ORIGIN`,
    block if there is one, population, trimming and at. `conditions`: columns of `ORIGIN`.
    """
    cells = _stacked(list(selections.values()))
    condition, *keys = cells.keys
    selection = np.repeat(np.arange(len(selections)), [len(part.keys[0]) for part in selections.values()])
    order = np.lexsort((keys[-1], selection, *reversed(keys[:-1]), condition))
    labels = pl.DataFrame(list(selections), schema=dict(_LABELS), orient="row")[selection[order]]
    columns = {name: pl.Series(key[order], dtype=BLOCKS[name]) for name, key in zip(names, keys, strict=True)}
    values = _values(cells.signed.of(order), cells.absolute.of(order))
    table = conditions[condition[order]].hstack([*labels.get_columns(), *values.get_columns()])
    return table.with_columns(pl.lit(axis, dtype=AXIS).alias("axis"), **columns)


def merge(moments: pl.DataFrame, *, by: Sequence[str], orders: Sequence[Order] = FOURTH) -> pl.DataFrame:
    """Pool the rows that agree in `by`, as if the moments had been measured on all their observations at once.

    `moments`: a moments table, or what `merge` made of one. A row may occur several times, as in a bootstrap; `by`: key
    columns to keep, at least one; `orders`: which central power sums of signed errors. Those of absolute errors are
    pooled with the orders above 2 only. Returns columns `by`, then `n` and the moments as in `MOMENTS`; sorted by `by`.
    Means are null where n is 0.
    """
    values = ["n", *_MEANS, *_sums(orders, "m_"), *_ABSOLUTE_MEANS, *_sums(_variances(orders), "m_abs_")]
    schema = {name: MOMENT_VALUES[name] for name in values}
    check(moments.select(column for column in values if column in moments.columns), schema, "moments")
    labels = [column for column in moments.columns if column not in MOMENT_VALUES and column not in by]
    ordered = moments.sort(labels, maintain_order=True) if labels else moments
    return merge_groups(ordered, group_rows(ordered, by), orders=orders)


def merge_groups(moments: pl.DataFrame, groups: Groups, *, orders: Sequence[Order] = FOURTH) -> pl.DataFrame:
    """Pool the rows of each group, as `merge` does, in the order of the rows.

    Returns: the keys of the groups, then as `merge`.
    """
    signed, absolute = (
        pool_moments(_joint(moments, powers, means, prefix), groups.index, groups.count)
        for powers, means, prefix in ((orders, _MEANS, "m_"), (_variances(orders), _ABSOLUTE_MEANS, "m_abs_"))
    )
    defined_means = pl.when(pl.col("n") > 0).then(pl.col(*_MEANS, *_ABSOLUTE_MEANS))
    return groups.keys.hstack(_values(signed, absolute).with_columns(defined_means))


def _variances(orders: Sequence[Order]) -> Sequence[Order]:
    """Orders of the sums of absolute errors that are pooled with those of signed ones."""
    return VARIANCES if len(orders) > len(SECOND) else ()


def _joint(table: pl.DataFrame, orders: Sequence[Order], means: list[str], prefix: str) -> JointMoments:
    return JointMoments(
        tuple(orders),
        table["n"].to_numpy(),
        table.select(pl.col(means).fill_null(0.0)).to_numpy(),
        table.select(_sums(orders, prefix)).to_numpy(),
    )


def _stacked(parts: Sequence[MomentCells]) -> MomentCells:
    keys = tuple(np.concatenate(key) for key in zip(*(part.keys for part in parts), strict=True))
    return MomentCells(
        keys, *(stack_moments([getattr(part, name) for part in parts]) for name in ("signed", "absolute"))
    )


def _values(signed: JointMoments, absolute: JointMoments) -> pl.DataFrame:
    columns = {"n": signed.n}
    for moments, means, prefix in ((signed, _MEANS, "m_"), (absolute, _ABSOLUTE_MEANS, "m_abs_")):
        columns |= dict(zip(means, moments.mean.T, strict=True))
        columns |= dict(zip(_sums(moments.orders, prefix), moments.central.T, strict=True))
    return pl.DataFrame(columns, schema={name: MOMENT_VALUES[name] for name in columns})


def _sums(orders: Sequence[Order], prefix: str) -> list[str]:
    return [prefix + "u" * p + "v" * q for p, q in orders]


def scene_moments(seen: PreparedObservations) -> pl.DataFrame:
    """Moments of the errors of every scene and condition, by population, trimming, and age or frame.

    Parameters
    ----------
    seen
        Observations of any number of scenes, trimmed.

    Returns
    -------
    polars.DataFrame
        Schema `MOMENTS`, sorted by its columns before `n`, with one row for each combination that has an observation.
        `untrimmed` counts every observation, `trimmed` those of tracks that were kept.
    """
    projected = seen.projected
    keys = (seen.condition, seen.at, seen.visible, seen.kept)
    cells = measure_cells(seen.error_px[projected], [key[projected] for key in keys])
    visible, kept = (key.astype(bool) for key in cells.keys[2:])
    selections = {
        **by_trimming(cells, Population.visible, by=2, chosen=visible, kept=kept),
        **by_trimming(cells, Population.projected, by=2, chosen=np.ones_like(kept), kept=kept),
    }
    table = tabulate(selections, seen.conditions, names=["at"], axis=seen.axis)
    return check(table.select(*MOMENTS), MOMENTS, "moments")


def block_moments(sequence: PreparedSequence) -> pl.DataFrame:
    """Moments of the errors of every scene, condition and block of tracks, by trimming, and age or frame.

    Returns schema `BLOCKS`, sorted by its columns before `n`, with one row for each combination that has an
    observation. Pooled over the blocks of a scene they are the scene's moments.
    """
    selections: dict[tuple[str, str], MomentCells] = {}
    for population in sequence.populations:
        selections |= _of_population(sequence, population)
    table = tabulate(selections, sequence.seen.conditions, names=["block", "at"], axis=sequence.seen.axis)
    return check(table.select(*BLOCKS), BLOCKS, "blocks")


def _of_population(sequence: PreparedSequence, population: str) -> dict[tuple[str, str], MomentCells]:
    seen = sequence.seen
    chosen = seen.members(population)
    keys = (seen.condition, sequence.block, seen.at, seen.kept)
    cells = measure_cells(seen.error_px[chosen], [key[chosen] for key in keys], orders=SECOND)
    kept = cells.keys[-1].astype(bool)
    return by_trimming(cells, population, by=3, chosen=np.ones_like(kept), kept=kept)
