"""Rows of a table in numbered groups, so that NumPy can sum them in a fixed order, and tables by condition.

Work on one condition copies the rows of that condition only. Names that all rows of a condition share are stored once.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.schema import Schema, check, empty, require_table

_ROWS_AT_ONCE = 2**17
"""Rows of small tables that are stacked before they are processed: it costs no more than processing one of them."""
_LARGEST_LOOKUP = 2**22
"""Combinations of keys up to which a lookup table is quicker than sorting."""
IntegerArray = NDArray[np.integer[Any]] | NDArray[np.bool_]
"""Keys to group by; false and true count as 0 and 1."""


@dataclass(frozen=True, slots=True)
class Groups:
    """Which group each row of a table belongs to.

    Attributes
    ----------
    keys
        One row per group, sorted: names by code point, enumerations in the order of their definition.
    index : (rows,) intp
        Row of `keys` for each row of the table.
    """

    keys: pl.DataFrame
    index: NDArray[np.intp]

    @property
    def count(self) -> int:
        """Number of groups."""
        return self.keys.height

    def sums(self, table: pl.DataFrame, columns: Sequence[str]) -> pl.DataFrame:
        """Totals of columns of the grouped table, Float64, one row per group, added up in the order of its rows."""
        totals = {name: np.bincount(self.index, table[name].to_numpy(), self.count) for name in columns}
        return pl.DataFrame(totals, schema=dict.fromkeys(columns, pl.Float64))


def group_rows(table: pl.DataFrame, by: Sequence[str]) -> Groups:
    """Group the rows of `table` that agree in all columns of `by` (at least one)."""
    keys = table[list(by)]
    codes = [_codes(keys[name]) for name in by]
    varying = [code for code in codes if code.any()] or codes[:1]
    index = varying[0] if len(varying) == 1 else number_combinations(varying)[1]
    return Groups(keys[_first_rows(index)], index)


def without_blocks(table: pl.DataFrame, by: Sequence[str], schema: Schema) -> pl.DataFrame:
    """Sums of all blocks together, as block 0; null where one of them is.

    Parameters
    ----------
    table
        With the columns of `schema`, of which `by` are keys, ``block`` is the block, and all others are added up.
    """
    rows = group_rows(table, by)
    added = rows.sums(table, [name for name in schema if name not in (*by, "block")]).fill_nan(None)
    return rows.keys.hstack(added).select_seq(
        (pl.lit(0) if name == "block" else pl.col(name)).cast(kind).alias(name) for name, kind in dict(schema).items()
    )


def number_names(names: pl.Series) -> tuple[list[str], NDArray[np.intp]]:
    """Number names in their order.

    Parameters
    ----------
    names
        Strings, without nulls. Equal ones are mostly next to each other: only the first of each run is looked up.

    Returns
    -------
    names : list of str
        Those that occur, sorted by code point.
    index : (rows,) intp
        The place of each row's name among them.
    """
    starts = np.append(0, np.flatnonzero((names[1:] != names[:-1]).to_numpy()) + 1)[: len(names)]
    heads = names[starts].to_list()
    place = {name: number for number, name in enumerate(sorted(set(heads)))}
    of_runs = np.array([place[name] for name in heads], dtype=np.intp)
    return list(place), np.repeat(of_runs, np.diff(starts, append=len(names)))


def _codes(column: pl.Series) -> NDArray[np.intp]:
    """Numbers of the values of a key column from 0 on, in their order; null comes first."""
    if column.null_count():
        codes = np.zeros(len(column), dtype=np.intp)
        codes[column.is_not_null().to_numpy()] = _codes(column.drop_nulls()) + 1
        return codes
    if column.dtype == pl.String:
        return number_names(column)[1]
    return _dense((column.to_physical() if column.dtype == pl.Enum else column).to_numpy())


def _dense(values: NDArray[Any]) -> NDArray[np.intp]:
    """Numbers of the values from 0 on, in their order."""
    integers = values.dtype.kind in "iu" and len(values)
    low, high = (int(values.min()), int(values.max())) if integers else (0, _LARGEST_LOOKUP + 1)
    if high - low > _LARGEST_LOOKUP:
        return np.asarray(np.unique(values, return_inverse=True)[1], dtype=np.intp)
    shifted = values.astype(np.int64) - low
    present = np.zeros(high - low + 1, dtype=np.intp)
    present[shifted] = 1
    numbers = shifted if present.all() else (np.cumsum(present) - 1)[shifted]
    return np.asarray(numbers, dtype=np.intp)


def _first_rows(index: NDArray[np.intp]) -> NDArray[np.intp]:
    """The first row of each group, (groups,)."""
    first = np.zeros(int(index.max(initial=-1)) + 1, dtype=np.intp)
    first[index[::-1]] = np.arange(len(index))[::-1]
    return first


def group_runs(tables: Sequence[pl.DataFrame], by: Sequence[str]) -> list[Groups]:
    """Group the rows of several tables that agree in all columns of `by`, with the same groups for every table.

    Only the first row of each run of equal rows is grouped. This is fast where equal rows are adjacent. `tables`: with
    the columns `by`, of the same types.
    """
    starts = [_run_starts(table.select(by)) for table in tables]
    heads = pl.concat([table.select(by)[rows] for table, rows in zip(tables, starts, strict=True)])
    groups = group_rows(heads, by)
    parts = np.split(groups.index, np.cumsum([len(rows) for rows in starts])[:-1])
    lengths = [np.diff(rows, append=table.height) for table, rows in zip(tables, starts, strict=True)]
    return [Groups(groups.keys, np.repeat(part, length)) for part, length in zip(parts, lengths, strict=True)]


def number_combinations(keys: Sequence[IntegerArray]) -> tuple[tuple[NDArray[np.intp], ...], NDArray[np.intp]]:
    """Number the rows by the combination of their keys.

    Parameters
    ----------
    keys
        Arrays of (rows,) integers from 0 on, at least one.

    Returns
    -------
    keys : tuple of (groups,) intp
        Those of every combination that occurs, sorted by the first key, then the second, and so on.
    index : (rows,) intp
        The combination of each row.
    """
    shape = tuple(int(key.max(initial=0)) + 1 for key in keys)
    codes = np.ravel_multi_index(tuple(key.astype(np.intp, copy=False) for key in keys), shape)
    if prod(shape) > _LARGEST_LOOKUP:
        present, index = np.unique(codes, return_inverse=True)
        return np.unravel_index(present, shape), index
    present = np.flatnonzero(np.bincount(codes, minlength=1))
    if len(present) < prod(shape):
        lookup = np.zeros(prod(shape), dtype=np.intp)
        lookup[present] = np.arange(len(present))
        codes = lookup[codes]
    return np.unravel_index(present, shape), codes


def _run_starts(table: pl.DataFrame) -> NDArray[np.intp]:
    """Rows that differ from the row before them; the first row is one of them."""
    differs = [pl.col(name).ne_missing(pl.col(name).shift()) for name in table.columns]
    starts: NDArray[np.bool_] = table.select(starts=pl.any_horizontal(differs))["starts"].to_numpy().copy()
    starts[:1] = True
    return np.flatnonzero(starts)


def reduce_each(
    tables: pl.DataFrame | Iterable[pl.DataFrame],
    schema: Schema,
    name: str,
    reduce: Callable[[pl.DataFrame], pl.DataFrame],
) -> pl.DataFrame:
    """Reduce each table and stack the results, with one table in memory at a time.

    Parameters
    ----------
    tables
        One table, or any number of tables, read one at a time.
    schema, name
        Expected columns, and the name of the table for the error message.
    reduce
        Makes a small table of a large one, and an empty table of an empty one.

    Raises
    ------
    SchemaError
        If a table does not have the columns of `schema`.
    """
    checked = (check(table, schema, name) for table in tables_of(tables, name))
    return pl.concat([reduce(empty(schema)), *map(reduce, checked)])


def tables_of(tables: object, name: str) -> Iterator[pl.DataFrame]:
    """Each of one or several tables. Raises SchemaError, naming it, at what is no table."""
    for table in [tables] if isinstance(tables, pl.DataFrame) or not isinstance(tables, Iterable) else tables:
        yield require_table(table, name)


def in_chunks(
    tables: pl.DataFrame | Iterable[pl.DataFrame], schema: Schema, name: str, *, rows: int = _ROWS_AT_ONCE
) -> Iterator[pl.DataFrame]:
    """Concatenate tables into fewer, larger ones. Each can be reduced before the next is read.

    How they are stacked depends only on their sizes and order.

    Parameters
    ----------
    tables
        One table, which is returned unchanged, or any number of tables, read one at a time.
    schema, name
        Expected columns, and the name of the table for the error message.
    rows
        Number of rows from which on a stack is complete.

    Yields
    ------
    polars.DataFrame
        In order.

    Raises
    ------
    SchemaError
        If a table does not have the columns of `schema`.
    """
    waiting, height = [], 0
    for table in tables_of(tables, name):
        waiting.append(check(table, schema, name))
        height += table.height
        if height >= rows:
            yield pl.concat(waiting)
            waiting, height = [], 0
    if waiting:
        yield pl.concat(waiting)


def add_up(tables: pl.DataFrame | Iterable[pl.DataFrame], schema: Schema, name: str) -> pl.DataFrame:
    """Counts `n` of rows that agree in all other columns, added up; in no particular order."""
    keys = [column for column in schema if column != "n"]
    total = empty(schema)
    for chunk in in_chunks(tables, schema, name):
        total = pl.concat([total, chunk]).group_by(keys).agg(total_if_known("n", pl.col("n").sum()))
    return total


def total_if_known(name: str, total: pl.Expr) -> pl.Expr:
    """An expression of a column of counts where no count of its group is null; null in other groups."""
    return pl.when(pl.col(name).null_count() == 0).then(total).alias(name)


Condition = tuple[Any, ...]
"""Values of `POOLED`."""
TablesByCondition = Mapping[Condition, pl.DataFrame]
"""Rows of each condition."""
Tables = pl.DataFrame | Iterable[pl.DataFrame] | TablesByCondition
"""One table, any number of tables that are read one at a time, or a mapping that is already by condition."""


def by_condition(
    tables: Tables, schema: Schema, name: str, reduce: Callable[[pl.DataFrame], pl.DataFrame] = lambda table: table
) -> TablesByCondition:
    """Rows of each condition, sorted by condition, otherwise in their order.

    Parameters
    ----------
    tables
        Of any scenes and conditions. A mapping by condition is only checked.
    schema, name
        Expected columns, and the name of the table for the error message.
    reduce
        Reduces the rows of any number of sequences before they are kept. It must return no rows for none.

    Raises
    ------
    SchemaError
        If a table does not have the columns of `schema`.
    """
    if isinstance(tables, Mapping):
        return {key: check(table, schema, name) for key, table in tables.items()}
    parts: dict[Condition, list[pl.DataFrame]] = {}
    for chunk in in_chunks(tables, schema, name):
        for key, part in reduce(chunk).partition_by(POOLED, as_dict=True, include_key=False).items():
            parts.setdefault(key, []).append(part)
    columns = reduce(empty(schema)).columns
    by_key = {}
    for key in sorted(parts):
        labels = dict(zip(POOLED, names(key, schema), strict=True))
        by_key[key] = pl.concat(parts[key]).select_seq(labels.get(column, pl.col(column)) for column in columns)
    return by_key


def scenes_by_dataset(conditions: Iterable[tuple[Condition, pl.DataFrame]]) -> dict[str, set[str]]:
    """Names of the scenes that have a row in any condition of a dataset."""
    scenes: dict[str, set[str]] = {}
    for key, table in conditions:
        if not table.is_empty():
            scenes.setdefault(key[0], set()).update(number_names(table["scene"])[0])
    return scenes


def names(key: Condition, schema: Schema) -> list[pl.Expr]:
    """The names of a condition as literal columns, which are stored once however many rows a table has."""
    return [pl.lit(value).cast(schema[name]).alias(name) for name, value in zip(POOLED, key, strict=True)]
