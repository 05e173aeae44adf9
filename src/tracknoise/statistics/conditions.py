"""Tables of all scenes, one per condition.

Work on one condition then copies the rows of that condition only. Names that all rows of a condition share are stored
once.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import polars as pl

from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import in_chunks, number_names
from tracknoise.tables.schema import Schema, check, empty

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
    found = {}
    for key in sorted(parts):
        known = dict(zip(POOLED, names(key, schema), strict=True))
        found[key] = pl.concat(parts[key]).select_seq(known.get(column, pl.col(column)) for column in columns)
    return found


def scenes_by_dataset(conditions: Iterable[tuple[Condition, pl.DataFrame]]) -> dict[str, set[str]]:
    """Names of the scenes that have a row in any condition of a dataset."""
    found: dict[str, set[str]] = {}
    for key, table in conditions:
        if not table.is_empty():
            found.setdefault(key[0], set()).update(number_names(table["scene"])[0])
    return found


def names(key: Condition, schema: Schema) -> list[pl.Expr]:
    """The names of a condition as literal columns, which are stored once however many rows a table has."""
    return [pl.lit(value).cast(schema[name]).alias(name) for name, value in zip(POOLED, key, strict=True)]
