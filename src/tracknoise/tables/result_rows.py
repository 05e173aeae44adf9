"""The table of results, made of the tables of a run, and the ids of its rows.

Tables are what is stored and read. Results are derived from them, and nothing is turned back.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import polars as pl

from tracknoise.tables.quantities import QUANTITIES, ResultTopic
from tracknoise.tables.results import beside_untrusted_truth, finished, ids
from tracknoise.tables.run_table import Rows, RunTable, Value
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict

_SEPARATOR = ": "
_ROW = "row of the table"


def results_of(tables: Mapping[RunTable, pl.DataFrame]) -> pl.DataFrame:
    """The table of results that holds the numbers of tables.

    Parameters
    ----------
    tables
        Those that have rows; others are left out.

    Returns
    -------
    polars.DataFrame
        Schema `RESULTS`.
    """
    with_rows = [(table.rows, data) for table, data in tables.items() if table.rows is not None]
    shared = frozenset[ResultTopic]().union(*(rows.topics for rows, _ in with_rows if len(rows.topics) > 1))
    parts: list[pl.DataFrame] = []
    for topics in (shared, frozenset(ResultTopic) - shared):  # tables that have rows in common, and all others at once
        mine = ((rows, data) for rows, data in with_rows if rows.topics & topics)
        parts.append(finished(part for rows, data in mine for _, part in _parts_of(rows, data)))
    return pl.concat(parts)


def run_results(run: RunFolder, tables: Iterable[RunTable]) -> pl.DataFrame:
    """The table of results of a run: every number of its tables (schema `RESULTS`).

    Raises
    ------
    StoreError, SchemaError
        If the run is not finished, or a file is missing or damaged.
    """
    results = results_of({table: run.statistics(table) for table in tables})
    return results if TruthVerdict.of_run(run).is_usable else beside_untrusted_truth(results)


def with_ids(table: RunTable, found: pl.DataFrame) -> pl.DataFrame:
    """A table that has rows of results, with the column `ids`: by column of numbers, the id of its row, or null."""
    assert table.rows is not None, f"{table.name} has no rows of results"
    names = {
        value.column: pl.Series(value.column, [None] * found.height, dtype=pl.String) for value in table.rows.values
    }
    for value, part in _parts_of(table.rows, found):
        names[value.column] = names[value.column].scatter(part[_ROW], ids(part))
    return found.with_columns(ids=pl.struct(*names.values()))


def _parts_of(rows: Rows, table: pl.DataFrame) -> Iterator[tuple[Value, pl.DataFrame]]:
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
        unit = QUANTITIES[value.quantity].unit
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
