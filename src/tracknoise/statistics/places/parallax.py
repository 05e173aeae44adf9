"""Parallax in the image: how far true positions move relative to the median of all features.

A rotation of the camera moves all features nearly alike. What is left after the median is subtracted comes from
translation, and differs with depth.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.prepared import PreparedSequence

_FEWEST = 10
"""The median motion of fewer features than this is not used."""
_KEYS = ["condition", "frame"]


def parallax_px(sequence: PreparedSequence, rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """Motion of true positions since errors were zero, less the median of all features over the same frames.

    Parameters
    ----------
    sequence
        Any.
    rows : (n,) intp
        Rows of the observations.

    Returns
    -------
    (n,) float64
        Lengths, px. NaN where the true position in either frame is unknown, or too few others are known.
    """
    seen = sequence.seen
    since = seen.at[rows] - (sequence.key_frame or 0)
    true, lengths = _true_positions(sequence), np.full(len(seen.track), np.nan)
    for age in np.unique(since):
        found = _over(true, int(age))
        of_age = np.full(len(lengths), np.nan)
        of_age[found["row"].to_numpy()] = found["length"].to_numpy()
        lengths[rows[since == age]] = of_age[rows[since == age]]
    return lengths[rows]


def _over(table: pl.DataFrame, age: int) -> pl.DataFrame:
    """Columns row and length: motion over as many frames, less the median."""
    earlier = table.with_columns(frame=pl.col("frame") + age).select("condition", "track", "frame", u0="u", v0="v")
    moved = table.join(earlier, on=["condition", "track", "frame"])
    moved = moved.select("row", *_KEYS, u=pl.col("u") - pl.col("u0"), v=pl.col("v") - pl.col("v0"))
    medians = moved.group_by(_KEYS).agg(pl.col("u", "v").median().name.suffix("_median"), n=pl.len())
    both = moved.join(medians.filter(pl.col("n") >= _FEWEST), on=_KEYS)
    length = ((pl.col("u") - pl.col("u_median")).pow(2) + (pl.col("v") - pl.col("v_median")).pow(2)).sqrt()
    return both.select("row", length=length)


def _true_positions(sequence: PreparedSequence) -> pl.DataFrame:
    """Columns row, condition, track, frame, u and v of observations at the lowest speed with a true position."""
    seen = sequence.seen
    columns = {"condition": seen.condition, "track": seen.track, "frame": seen.frame}
    true = sequence.observations.select(u="u_true_px", v="v_true_px")
    table = true.with_row_index("row").with_columns(**{name: pl.Series(values) for name, values in columns.items()})
    return table.filter(pl.Series(sequence.at_slowest)).drop_nulls(["u", "v"])
