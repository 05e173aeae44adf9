"""Two truths of the same observations: sums of their difference, and of the errors by each of them.

With x_1 and x_2 the true positions of an observation x by the first and the second truth:

- disagreement = x_2 - x_1, first = x - x_1, second = x - x_2 (truths.disagreement)
"""

from collections.abc import Iterator

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.grouping import group_rows
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import Trimming, TruthQuantity
from tracknoise.tables.schema import (
    SECOND_TRUTH,
    TRIMMING,
    TRUTH_DIFFERENCES,
    TRUTH_QUANTITY,
    check,
    empty,
)

_SUMS = ("n", "u", "v", "uu", "uv", "vv")


def truth_differences(sequence: PreparedSequence) -> pl.DataFrame:
    """Sums of the disagreement of two truths and of the errors by each, by age.

    Parameters
    ----------
    sequence
        Trimmed. Only observations at its speed `slowest` count, which the first truth says are visible, and whose true
        position the second knows.

    Returns
    -------
    polars.DataFrame
        Schema `TRUTH_DIFFERENCES`, sorted by its columns before `n`. Without rows unless there is a second truth.
    """
    if not set(SECOND_TRUTH) <= set(sequence.observations.columns):
        return empty(TRUTH_DIFFERENCES)
    second_px = sequence.observations.select(*SECOND_TRUTH).to_numpy()
    known = sequence.seen.visible & sequence.at_slowest & ~np.isnan(second_px).any(axis=1)
    parts = [part for trimming in Trimming for part in _of_trimming(sequence, second_px, known, trimming)]
    table = pl.concat([empty(TRUTH_DIFFERENCES), *parts])
    keys = [name for name in TRUTH_DIFFERENCES if name not in _SUMS]
    return check(table.sort(keys), TRUTH_DIFFERENCES, "truth differences")


def _of_trimming(
    sequence: PreparedSequence, second_px: NDArray[np.float64], known: NDArray[np.bool_], trimming: Trimming
) -> Iterator[pl.DataFrame]:
    rows = np.flatnonzero(known & sequence.seen.kept if trimming == Trimming.trimmed else known)
    first = sequence.seen.error_px[rows]
    second = sequence.observations.select("u_px", "v_px").to_numpy()[rows] - second_px[rows]
    values = {
        TruthQuantity.disagreement: first - second,
        TruthQuantity.first: first,
        TruthQuantity.second: second,
    }
    of = pl.lit(trimming, dtype=TRIMMING).alias("trimming")
    for quantity, value in values.items():
        named = pl.lit(quantity, dtype=TRUTH_QUANTITY).alias("quantity")
        yield _summed(sequence, rows, value).with_columns(named, of).select(*TRUTH_DIFFERENCES)


def _summed(sequence: PreparedSequence, rows: NDArray[np.intp], value: NDArray[np.float64]) -> pl.DataFrame:
    """Sums by condition, block and age."""
    keys = {
        "condition": sequence.seen.condition[rows],
        "block": sequence.block[rows],
        "age": sequence.seen.age[rows].astype(np.uint32),
    }
    found = group_rows(pl.DataFrame(keys), list(keys))
    u, v = value.T
    terms = zip(_SUMS, (np.ones_like(u), u, v, u * u, u * v, v * v), strict=True)
    sums = {name: np.bincount(found.index, term, found.count) for name, term in terms}
    named = sequence.seen.conditions[found.keys["condition"].to_numpy()].hstack(found.keys.drop("condition"))
    return named.with_columns(**sums).with_columns(pl.col("n").cast(TRUTH_DIFFERENCES["n"]))
