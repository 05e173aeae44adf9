"""Tables of all scenes, held apart by condition.

What is done to one condition at a time then copies one at a time, whatever it is. The names of a condition, which all
of its rows share, take no room.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import polars as pl

from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import in_chunks
from tracknoise.tables.schema import Schema, check, empty

Condition = tuple[Any, ...]
"""Values of `POOLED`."""
TablesByCondition = Mapping[Condition, pl.DataFrame]
"""Rows of each condition."""
Tables = pl.DataFrame | Iterable[pl.DataFrame] | TablesByCondition
"""One table, or any number of them, which may be read as they are asked for; or already apart."""


def by_condition(
    tables: Tables, schema: Schema, name: str, reduce: Callable[[pl.DataFrame], pl.DataFrame] = lambda table: table
) -> TablesByCondition:
    """Rows of each condition, sorted by condition, otherwise in their order.

    Parameters
    ----------
    tables
        Of any scenes and conditions. Where they are already apart they stay as they are.
    schema, name
        What each must be, and what to call it where it is not.
    reduce
        Makes a small table of the rows of any number of sequences, before they are held; of none it must make none.

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
    return {key: pl.concat(parts[key]).with_columns(names(key, schema)).select(columns) for key in sorted(parts)}


def scenes_by_dataset(conditions: Iterable[tuple[Condition, pl.DataFrame]]) -> dict[str, set[str]]:
    """Names of the scenes that have a row in any condition of a dataset."""
    found: dict[str, set[str]] = {}
    for key, table in conditions:
        if not table.is_empty():
            found.setdefault(key[0], set()).update(table["scene"].unique())
    return found


def names(key: Condition, schema: Schema) -> list[pl.Expr]:
    """The names of a condition as literals, of which a table holds one each, however many rows it has."""
    return [pl.lit(value, dtype=schema[name]).alias(name) for name, value in zip(POOLED, key, strict=True)]
