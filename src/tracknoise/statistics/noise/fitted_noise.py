"""Noise of tracks whose true positions are fitted to them, free of what the fit absorbs.

The errors of a track of N observations whose point was fitted have 2 N - 3 degrees of freedom. For white noise of
variance s^2, the square of an error in u has the expectation s^2 (1 - H_uu), where H is the covariance of the true
position for noise of 1 px. So

    s_u^2 = sum du^2 / sum (1 - H_uu),  s^2 = sum (du^2 + dv^2) / sum (2 N - 3)    (noise.triangulated)

and likewise in v. For distances d from epipolar lines, of variance w for noise of 1 px,

    s^2 = sum d^2 / w / n    (noise.epipolar)

This table has the sums. Both have no bias for white noise. Neither sees errors along the epipolar line.
"""

from collections.abc import Iterator

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.definitions import LENGTHS
from tracknoise.statistics.grouping import group_rows
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.tables.enumerations import FittedMeasure, Trimming
from tracknoise.tables.schema import EPIPOLAR, FITTED_MEASURE, FITTED_NOISE, LEVERAGE, TRIMMING, check, empty

_SUMS = ("n", "squares_u", "freedom_u", "squares_v", "freedom_v", "squares", "freedom")


def fitted_noise(sequence: PreparedSequence) -> pl.DataFrame:
    """Sums of squared errors and distances, and their degrees of freedom.

    Parameters
    ----------
    sequence
        Trimmed.

    Returns
    -------
    polars.DataFrame
        Schema `FITTED_NOISE`, sorted by its columns before `n`, with one row for each combination that has an
        observation. Without rows unless true positions are triangulated.
    """
    if not {*EPIPOLAR, *LEVERAGE} <= set(sequence.observations.columns):
        return empty(FITTED_NOISE)
    length_low = _length_class(sequence)
    parts = [
        _summed(sequence, length_low, measure, trimming, values)
        for measure, values in zip(FittedMeasure, (_triangulated(sequence), _epipolar(sequence)), strict=True)
        for trimming in Trimming
    ]
    table = pl.concat([empty(FITTED_NOISE), *(part.select(*FITTED_NOISE) for part in parts)])
    return check(table.sort([name for name in FITTED_NOISE if name not in _SUMS]), FITTED_NOISE, "fitted noise")


def _length_class(sequence: PreparedSequence) -> NDArray[np.int64]:
    """Shortest length of the class of each observation's track, (rows,): lengths count observations with a pose."""
    posed = sequence.observations["truth"].to_numpy() != "no_pose"
    length = np.bincount(sequence.track_row, posed, minlength=sequence.tracks.height)[sequence.track_row]
    lowest = np.array([low for low, _ in LENGTHS])
    return np.asarray(lowest[np.maximum(np.searchsorted(lowest, length, side="right") - 1, 0)])


def _triangulated(sequence: PreparedSequence) -> NDArray[np.float64]:
    """Values of `_SUMS` of each observation, (rows, sums); NaN where it does not count."""
    taken = sequence.observations.select("leverage_uu", "leverage_vv").to_numpy()
    squares, freedom = np.square(sequence.seen.error_px), 1.0 - taken
    squares[~sequence.seen.visible] = np.nan
    (of_u, of_v), (free_u, free_v) = squares.T, freedom.T
    return np.column_stack([np.ones(len(of_u)), of_u, free_u, of_v, free_v, of_u + of_v, free_u + free_v])


def _epipolar(sequence: PreparedSequence) -> NDArray[np.float64]:
    distance, variance = sequence.observations.select(*EPIPOLAR).to_numpy().T
    squares, one, none = np.square(distance) / variance, np.ones(len(distance)), np.zeros(len(distance))
    return np.column_stack([one, none, none, none, none, squares, one])


def _summed(
    sequence: PreparedSequence,
    length_low: NDArray[np.int64],
    measure: FittedMeasure,
    trimming: Trimming,
    values: NDArray[np.float64],
) -> pl.DataFrame:
    """Sums by scene, condition, block and class of lengths."""
    known = ~np.isnan(values).any(axis=1)
    rows = np.flatnonzero(known & sequence.seen.kept if trimming == Trimming.trimmed else known)
    keys = {"condition": sequence.seen.condition[rows], "block": sequence.block[rows], "length_low": length_low[rows]}
    found = group_rows(pl.DataFrame(keys), list(keys))
    sums = {
        name: np.bincount(found.index, values[rows, place], found.count)
        for place, name in enumerate(_SUMS)
    }  # fmt: skip
    named = sequence.seen.conditions[found.keys["condition"].to_numpy()].hstack(found.keys.drop("condition"))
    return named.with_columns(*_labels(measure, trimming), **sums).select(
        pl.col(name).cast(kind) for name, kind in FITTED_NOISE.items()
    )


def _labels(measure: FittedMeasure, trimming: Trimming) -> Iterator[pl.Expr]:
    yield pl.lit(measure, dtype=FITTED_MEASURE).alias("measure")
    yield pl.lit(trimming, dtype=TRIMMING).alias("trimming")
    highest = {low: high for low, high in LENGTHS if high is not None}
    yield pl.col("length_low").replace_strict(highest, default=None, return_dtype=pl.UInt32).alias("length_high")
