"""Names, units and fixed numbers of the statistics, the order of conditions and axes, and where errors are zero."""

import re
from collections.abc import Collection, Iterable, Mapping

import polars as pl

from tracknoise.tables.enumerations import Axis
from tracknoise.tables.schema import CONDITION

POOLED = ["dataset", *CONDITION]
"""Columns that identify a condition of a dataset once its scenes are pooled."""
UNITS = {"mean": "px", "absolute": "px", "second": "px^2", "central": "px^2"}
"""Role of every statistic of errors, and its unit."""
NAMES = {
    "age": {"mean": "nu", "absolute": "eta", "second": "Phi", "central": "central"},
    "frame": {"mean": "mu", "absolute": "kappa", "second": "Sigma", "central": "central"},
}
"""Name of each statistic by its role, for both axes that curves run along."""
REFERENCE_AGE = 10
"""Largest age at which the summary reports errors, frames of the nominal sequence."""
LONG_LIVED_AGES = (5, 10, 20, 50, 100)
"""Ages that define long-lived tracks, frames of the nominal sequence."""
LENGTHS: tuple[tuple[int, int | None], ...] = ((2, 2), (3, 4), (5, 9), (10, 19), (20, 49), (50, None))
"""Classes of lengths of tracks, in observations, for noise that is corrected for a fit."""
WINDOWS = (3, 5, 10, 15, 20, 30)
"""Lengths of the windows in which an estimator sees a track, in observations."""
LEAST_MOTION_PX = 0.1
"""Shortest motion of a true position between two frames that has a direction, px."""
LAGS = 5
"""Largest lag of the autocorrelation, in steps of the tracker."""


STEPS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 96, 128, 192, 256)
"""Ages, in steps of the tracker, at which tables have rows that would be too many at every age."""
PLACE_AGES = (1, 5, 10, 20)
"""Ages at which errors are divided by place, frames of the nominal sequence."""
MAP_COLUMNS, MAP_ROWS = 20, 14
"""Cells of the map of the image."""
EDGE_BOUNDS_PX = (0.0, 2.0, 4.0, 7.5, 15.0)
"""Bounds of the classes of distances to a depth edge, px."""
NEAR_EDGE_PX = 7.5
"""A feature nearer to a depth edge than this lies beside it, px: half the window of a Lucas-Kanade tracker."""
INCIDENCE_STEP_DEG = 15
"""Width of the classes of angles of incidence, degrees."""


_PLAIN = ("diffuse", "default")
"""Names of lightings without a direction."""


def lightings_in_order(lightings: Collection[str], named: Iterable[str] | None) -> list[str]:
    """Lightings in the order of the experiment, by default plain ones first; the others by name.

    Parameters
    ----------
    lightings
        Those that were measured.
    named
        Those that the experiment names, if it does; some may not have been measured.
    """
    first = [name for name in dict.fromkeys(named or _PLAIN) if name in lightings]
    return first + sorted({*lightings} - {*first}, key=natural_key)


def natural_key(name: str) -> list[tuple[int, str]]:
    """Sort key that puts ``LR9`` before ``LR10``: digits count as numbers."""
    parts = re.split(r"(\d+)", name)
    return [(int(part), "") if place % 2 else (0, part) for place, part in enumerate(parts)]


def since_zero(key_frames: Mapping[str, int]) -> pl.Expr:
    """Distance of `at` from where errors are zero by construction (Int64): an age, or frames after the key frame.

    `key_frames`: where curves run along frames, by direction. Rows have the columns direction, axis and at.
    """
    key = pl.col("direction").replace_strict(dict(key_frames), default=0, return_dtype=pl.Int64)
    return pl.col("at").cast(pl.Int64) - pl.when(pl.col("axis") == Axis.frame).then(key).otherwise(0)


def dropped_above(trims: pl.DataFrame) -> float | None:
    """Percentile of the tracks' largest errors above which a run's tracks were dropped; None where none was.

    Parameters
    ----------
    trims
        Schema `TRIMS`, of one run.
    """
    percentiles: list[float] = trims["percentile"].drop_nulls().unique().to_list()
    return percentiles[0] if percentiles and percentiles[0] < 100 else None


def upright(points: pl.DataFrame, *, signed: pl.Expr) -> pl.DataFrame:
    """Values in turned images as values in the axes of the upright image; `rotation` stays as it is.

    An image turned by 90 degrees counter-clockwise has the upright image's pixel (u, v) at (v, width - 1 - u): an
    error (du, dv) in the turned image is (-dv, du) in the upright one. A quarter turn thus swaps the coordinates of
    any statistic, and the u of signed ones changes sign.

    Parameters
    ----------
    points
        With columns rotation (degrees counter-clockwise: 0, 90, 180 or 270), u and v.
    signed
        True in rows whose u and v have a sign, such as mean errors; false for absolute errors and second moments.
    """
    sign = pl.when(signed).then(-1.0).otherwise(1.0)
    for angle in (90, 180, 270):  # as many quarter turns back as there were
        turned = pl.col("rotation") >= angle
        u, v = pl.when(turned).then(sign * pl.col("v")).otherwise("u"), pl.when(turned).then("u").otherwise("v")
        points = points.with_columns(u=u, v=v)
    return points
