"""Sums by scene and by block, of every condition and aspect, from which intervals of curves are computed."""

from collections.abc import Iterator
from typing import Any

import polars as pl

from tracknoise.findings.sampling.units import additive
from tracknoise.statistics.conditions import TablesByCondition
from tracknoise.tables.enumerations import Aspect
from tracknoise.tables.schema import BLOCKS

CurveSums = tuple[tuple[Any, ...], pl.DataFrame, pl.DataFrame | None]
"""Condition, aspect, `at_least` and population; sums by scene; and by block, if there are any."""
_WHICH = ["aspect", "at_least", "population"]
_TO_ORDER_2 = ["aspect", "at_least", *(column for column in BLOCKS if column != "block")]


def moments_to_order_2(aspects: pl.DataFrame) -> pl.DataFrame:
    """Of `ASPECTS` the columns that are needed, which are those of blocks, too."""
    return aspects.select_seq(_TO_ORDER_2)


def error_sums(errors: TablesByCondition, blocks: TablesByCondition, population: str) -> Iterator[CurveSums]:
    """Of the errors of every track in image axes; `errors` are of `MOMENTS`, `blocks` of `BLOCKS`."""
    for key, part in errors.items():
        scenes = additive(part.filter(pl.col("n") > 0, population=population))
        if not scenes.is_empty():
            within = additive(blocks[key].filter(population=population)) if key in blocks else None
            yield (*key, Aspect.all, None, population), scenes, within


def aspect_sums(aspects: TablesByCondition, blocks: TablesByCondition) -> Iterator[CurveSums]:
    """Of each aspect of the errors; `blocks` are of `ASPECT_BLOCKS`."""
    for key, part in aspects.items():
        seen = part.filter(pl.col("n") > 0)
        for which in seen.select_seq(_WHICH).unique().rows():
            chosen = [pl.col(name).eq_missing(value) for name, value in zip(_WHICH, which, strict=True)]
            within = additive(blocks[key].filter(chosen)) if key in blocks else None
            yield (*key, *which), additive(seen.filter(chosen)), within
