"""Moments of the errors in disjoint cells of observations, and of unions of cells."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.errors.joint import (
    FOURTH,
    VARIANCES,
    JointMoments,
    Order,
    measure_moments,
    pool_moments,
    stack_moments,
)
from tracknoise.statistics.grouping import Groups, IntegerArray, group_rows, number_combinations
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.schema import AXIS, BLOCKS, MOMENTS, ORIGIN, POPULATION, TRIMMING, Schema, check

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
    """Moments of the errors of observations that agree in all keys.

    Attributes
    ----------
    keys : tuple of (cells,) intp
        Sorted by the first key, then the second, and so on.
    signed, absolute
        Moments of (du, dv), and of their absolute values.
    """

    keys: tuple[NDArray[np.intp], ...]
    signed: JointMoments
    absolute: JointMoments

    def union(self, chosen: NDArray[np.bool_], *, by: int) -> "MomentCells":
        """Moments of all chosen cells that agree in the first keys.

        Parameters
        ----------
        chosen : (cells,) bool
            Which cells.
        by
            Number of keys to keep.
        """
        keys, index = number_combinations([key[chosen] for key in self.keys[:by]])
        signed, absolute = (
            pool_moments(moments.of(chosen), index, len(keys[0])) for moments in (self.signed, self.absolute)
        )
        return MomentCells(keys, signed, absolute)


def by_trimming(
    cells: MomentCells, population: str, *, by: int, chosen: NDArray[np.bool_], kept: NDArray[np.bool_]
) -> dict[tuple[str, str], MomentCells]:
    """Moments of the chosen cells, and of those of them that trimming kept: what `tabulate` needs.

    Parameters
    ----------
    cells
        Moments of the errors of a population.
    population
        Its name.
    by
        Number of keys to keep.
    chosen, kept : (cells,) bool
        Which cells.
    """
    selections = {Trimming.untrimmed: chosen, Trimming.trimmed: chosen & kept}
    return {(population, trimming): cells.union(selected, by=by) for trimming, selected in selections.items()}


def measure_cells(
    error_px: NDArray[np.float64], keys: Sequence[IntegerArray], *, orders: Sequence[Order] = FOURTH
) -> MomentCells:
    """Moments of the errors of each cell, added up in the order of rows.

    Parameters
    ----------
    error_px
        (rows, 2) float64.
    keys
        Arrays of (rows,) integers from 0 on.
    orders
        Which central power sums of signed errors. Those of absolute errors are made with the orders above 2 only.
    """
    found, index = number_combinations(keys)
    signed = measure_moments(error_px, index, len(found[0]), orders=orders)
    absolute = measure_moments(np.abs(error_px), index, len(found[0]), orders=_variances(orders))
    return MomentCells(found, signed, absolute)


def tabulate(
    selections: Mapping[tuple[str, str], MomentCells], conditions: pl.DataFrame, *, names: Sequence[str], axis: str
) -> pl.DataFrame:
    """Moments of selections of observations as a table.

    Parameters
    ----------
    selections
        Moments of each population and trimming, in the order of these enumerations. The first key is the row of
        `conditions`.
    conditions
        Columns of `ORIGIN`.
    names
        Of the keys after the first; the last is ``at``.
    axis
        What ``at`` is: ``age`` or ``frame``.

    Returns
    -------
    polars.DataFrame
        Columns of `ORIGIN`, `names`, population, trimming, axis and moments. Sorted by the columns of `ORIGIN`, block
        if there is one, population, trimming and at.
    """
    cells = _stacked(list(selections.values()))
    condition, *keys = cells.keys
    which = np.repeat(np.arange(len(selections)), [len(part.keys[0]) for part in selections.values()])
    order = np.lexsort((keys[-1], which, *reversed(keys[:-1]), condition))
    labels = pl.DataFrame(list(selections), schema=dict(_LABELS), orient="row")[which[order]]
    columns = {name: pl.Series(key[order], dtype=BLOCKS[name]) for name, key in zip(names, keys, strict=True)}
    values = _values(cells.signed.of(order), cells.absolute.of(order))
    table = conditions[condition[order]].hstack([*labels.get_columns(), *values.get_columns()])
    return table.with_columns(pl.lit(axis, dtype=AXIS).alias("axis"), **columns)


def merge(moments: pl.DataFrame, *, by: Sequence[str], orders: Sequence[Order] = FOURTH) -> pl.DataFrame:
    """Pool the rows that agree in `by`, as if the moments had been measured on all their observations at once.

    Parameters
    ----------
    moments
        A moments table, or what `merge` made of one. A row may occur several times, as in a bootstrap.
    by
        Key columns to keep, at least one.
    orders
        Which central power sums of signed errors. Those of absolute errors are pooled with the orders above 2 only.

    Returns
    -------
    polars.DataFrame
        Columns `by`, then `n` and the moments as in `MOMENTS`; sorted by `by`. Means are null where n is 0.

    Raises
    ------
    SchemaError
        If a column of moments is missing or of another type.
    """
    values = ["n", *_MEANS, *_sums(orders, "m_"), *_ABSOLUTE_MEANS, *_sums(_variances(orders), "m_abs_")]
    schema = {name: MOMENT_VALUES[name] for name in values}
    check(moments.select(column for column in values if column in moments.columns), schema, "moments")
    others = [column for column in moments.columns if column not in MOMENT_VALUES and column not in by]
    ordered = moments.sort(others, maintain_order=True) if others else moments
    return merge_groups(ordered, group_rows(ordered, by), orders=orders)


def merge_groups(moments: pl.DataFrame, groups: Groups, *, orders: Sequence[Order] = FOURTH) -> pl.DataFrame:
    """Pool the rows of each group, as `merge` does, in the order of the rows.

    Parameters
    ----------
    moments, orders
        As in `merge`.
    groups
        Of the rows of `moments`.

    Returns
    -------
    polars.DataFrame
        The keys of the groups, then as `merge`.
    """
    signed, absolute = (
        pool_moments(_joint(moments, powers, means, prefix), groups.index, groups.count)
        for powers, means, prefix in ((orders, _MEANS, "m_"), (_variances(orders), _ABSOLUTE_MEANS, "m_abs_"))
    )
    known = pl.when(pl.col("n") > 0).then(pl.col(*_MEANS, *_ABSOLUTE_MEANS))
    return groups.keys.hstack(_values(signed, absolute).with_columns(known))


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
