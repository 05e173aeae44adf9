"""The table of results, made of the tables of a run, and the ids of its rows.

Tables are what is stored and read. Results are derived from them, and nothing is turned back.
"""

from collections.abc import Collection, Iterator, Mapping
from typing import Any

import polars as pl

from tracknoise.tables.quantities import QUANTITIES, Quantity
from tracknoise.tables.results import finished, ids, quantity_of
from tracknoise.tables.run_table import Rows, RunTable, Value

_SEPARATOR = ": "
_ROW = "row of the table"


def results_of(tables: Mapping[RunTable, pl.DataFrame], only: Collection[str] | None = None) -> pl.DataFrame:
    """The table of results that holds the numbers of tables.

    Parameters
    ----------
    tables
        Those that have rows; others are left out.
    only
        Ids of the rows that are wanted; None for all.

    Returns
    -------
    polars.DataFrame
        Schema `RESULTS`.
    """
    with_rows = [(table.rows, table.quantities, data) for table, data in tables.items() if table.rows is not None]
    shared = frozenset[str]().union(*(rows.topics for rows, _, _ in with_rows if len(rows.topics) > 1))
    parts: list[pl.DataFrame] = []
    for has_shared in (True, False):  # tables that have rows in common, and all others at once
        mine = (each for each in with_rows if bool(each[0].topics & shared) is has_shared)
        every = (pair for each in mine for pair in _parts_of(*each))
        parts.append(finished(part for _, part in (every if only is None else _some(every, only))))
    return pl.concat(parts)


def _some(parts: Iterator[tuple[Value, pl.DataFrame]], only: Collection[str]) -> Iterator[tuple[Value, pl.DataFrame]]:
    """Rows with these ids, of the quantities that they name."""
    quantities = {quantity_of(name) for name in only}
    for value, part in parts:
        if value.quantity in quantities:
            yield value, part.filter(ids([part]).is_in([*only]))


def with_ids(table: RunTable, found: pl.DataFrame) -> pl.DataFrame:
    """A table that has rows of results, with the column `ids`: by column of numbers, the id of its row, or null."""
    assert table.rows is not None, f"{table.name} has no rows of results"
    names = {
        value.column: pl.Series(value.column, [None] * found.height, dtype=pl.String) for value in table.rows.values
    }
    parts = list(_parts_of(table.rows, table.quantities, found))
    every, start = ids(part for _, part in parts), 0
    for value, part in parts:
        names[value.column] = names[value.column].scatter(part[_ROW], every.slice(start, part.height))
        start += part.height
    return found.with_columns(ids=pl.struct(*names.values()))


def _parts_of(rows: Rows, own: Mapping[str, Quantity], table: pl.DataFrame) -> Iterator[tuple[Value, pl.DataFrame]]:
    """Rows of results of a table: a part for each of its values that has any, with the numbers of its rows."""
    for column, names in rows.packed.items():
        texts = [pl.col(name).cast(pl.String).fill_null("") for name in names]
        table = table.with_columns(pl.concat_str(texts, separator=_SEPARATOR).alias(f"packed {column}"))
    keys = {**rows.keys, **{column: f"packed {column}" for column in rows.packed}}
    if table.is_empty():
        return
    kinds, table = table.schema, table.with_row_index(_ROW)
    groups: dict[tuple[tuple[str, Any], ...], pl.DataFrame] = {}
    for value in rows.values:
        is_first = (group := tuple(value.rows.items())) not in groups
        if is_first:
            groups[group] = table.filter(*(pl.col(name).eq_missing(pl.lit(wanted)) for name, wanted in group))
        part = groups[group]
        if not (is_first or value.always) and part[value.column].null_count():
            part = part.filter(pl.col(value.column).is_not_null())
        if part.is_empty():
            continue
        unit = (own.get(value.quantity) or QUANTITIES[value.quantity]).unit
        constants = {"topic": value.topic or rows.topic, "quantity": value.quantity, "unit": unit, **value.labels}
        named = {name: column for name, column in keys.items() if name not in value.labels}
        sources = {**named, "value": value.column, **value.carried}
        yield (
            value,
            part.select(
                _ROW,
                *(pl.lit(constant).alias(name) for name, constant in constants.items() if name not in sources),
                *(_encoded(column, kinds.get(column)).alias(target) for target, column in sources.items()),
            ),
        )


def _encoded(column: str, kind: pl.DataType | None) -> pl.Expr:
    """A column as results have it: what is true or false becomes `yes` or `no`; a verdict may have no number."""
    if kind is None:
        return pl.lit(None)
    if kind == pl.Boolean and column != "cut":
        return pl.when(pl.col(column)).then(pl.lit("yes")).when(~pl.col(column)).then(pl.lit("no"))
    return pl.col(column)
