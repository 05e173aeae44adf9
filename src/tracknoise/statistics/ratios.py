"""Ratios of two sums over features, by age: each is one function here, and one entry of the catalogue of quantities.

The value at age k is the sum of a number over the visible features of that age, divided by their count (ratio). Ages
are those of `tracknoise.statistics.definitions.STEPS`.
"""

from collections.abc import Callable, Mapping

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.definitions import STEPS
from tracknoise.statistics.places import summed
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.schema import RATIOS, empty, typed

GROSS_PX = 3.0
"""Length from which on an error is gross, px."""


def _is_gross(sequence: PreparedSequence, rows: NDArray[np.intp]) -> NDArray[np.float64]:
    return np.asarray(np.hypot(*sequence.seen.error_px[rows].T) > GROSS_PX, dtype=np.float64)


NUMERATORS: Mapping[str, Callable[[PreparedSequence, NDArray[np.intp]], NDArray[np.float64]]] = {
    "gross_error_share": _is_gross,
}
"""What is summed, by quantity: a number for each of the rows of the observations, which are visible."""


def ratio_sums(sequence: PreparedSequence) -> pl.DataFrame:
    """Sums of every ratio, before and after trimming. Returns schema `RATIOS`, sorted by its columns before n."""
    seen = sequence.seen
    steps = np.abs(seen.at - (sequence.key_frame or 0)) / seen.speed
    chosen = seen.visible & np.isin(steps, STEPS)
    parts = [empty(RATIOS)]
    for quantity, numerator in NUMERATORS.items():
        for trimming, selected in seen.by_trimming(chosen).items():
            rows = np.flatnonzero(selected)
            table = summed(sequence, rows, {}, {"sum": numerator(sequence, rows)})
            labelled = table.with_columns(quantity=pl.lit(quantity), trimming=pl.lit(str(trimming)))
            parts.append(typed(labelled, RATIOS))
    keys = list(RATIOS)[: list(RATIOS).index("n")]
    return pl.concat(parts).sort(keys)
