"""The findings of a run as one JSON document, for programs."""

import json
import math
from typing import Any

import polars as pl

from tracknoise.findings.headlines.headline import RunTables

FORMAT = 1


def findings_json(tables: RunTables) -> str:
    """The sentences, and the verdicts with the numbers behind them.

    Parameters
    ----------
    tables
        By their names: findings, zero_mean, gaussianity, time_structure, dependence, intervals and triangulated_noise.

    Returns
    -------
    str
        An object with `format`; the rows of each table, but of `zero_mean` only those of all ages together, and of
        `intervals` only those of numbers that have no axis. A row is an object of its columns. What is missing is
        null, what is infinite the string ``Infinity`` or ``-Infinity``.
    """
    chosen = {
        "findings": tables["findings"],
        "zero_mean": tables["zero_mean"].filter(pl.col("at").is_null()),
        "gaussianity": tables["gaussianity"],
        "time_structure": tables["time_structure"],
        "dependence": tables["dependence"],
        "intervals": tables["intervals"].filter(pl.col("at").is_null()),
        "triangulated_noise": tables["triangulated_noise"],
    }
    document = {"format": FORMAT, **{name: _rows(table) for name, table in chosen.items()}}
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _rows(table: pl.DataFrame) -> list[dict[str, Any]]:
    return [{name: _value(value) for name, value in row.items()} for row in table.iter_rows(named=True)]


def _value(value: object) -> object:
    if isinstance(value, float) and math.isinf(value):
        return "Infinity" if value > 0 else "-Infinity"
    return value
