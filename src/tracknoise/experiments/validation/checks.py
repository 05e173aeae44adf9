"""What the self-test compares: a row for each quantity, with its limits and the part of the package that it tests."""

from collections.abc import Collection, Sequence
from enum import StrEnum

import numpy as np
import polars as pl

from tracknoise.exceptions import with_type
from tracknoise.tables.schema import Schema

TOLERANCE = 1e-6
"""Largest difference from an exact value, relative to the larger of it and 1. Rounding stays below 1e-9."""


class Area(StrEnum):
    """Part of the package that a check is about. An area uses the results of those before it."""

    geometry = "true positions"
    visibility = "visibility"
    errors = "errors and ages"
    trimming = "trimming"
    curves = "curves"
    changes = "changes"
    lifetimes = "lifetimes"
    rates = "outlier ratio and counts"
    intervals = "intervals"
    zero_mean = "zero mean"
    growth = "growth"
    shape = "shape"
    factors = "factor effects"


SUSPECTS: dict[Area, str] = {
    Area.geometry: "sequences, geometry, truth",
    Area.visibility: "truth/visibility",
    Area.errors: "measurement",
    Area.trimming: "statistics/trimming and populations",
    Area.curves: "statistics/curves, moments and populations",
    Area.changes: "statistics/increments and change_curves",
    Area.lifetimes: "statistics/lifetimes",
    Area.rates: "statistics/outliers and counts",
    Area.intervals: "findings/sampling and findings/intervals",
    Area.zero_mean: "findings/zero_mean and findings/flips",
    Area.growth: "findings/growth",
    Area.shape: "findings/shape",
    Area.factors: "findings/factors",
}
"""Folders or modules of the package that are responsible for each area."""

CHECKS: Schema = {
    "area": pl.Enum(Area),
    "world": pl.String,
    "quantity": pl.String,
    "n": pl.Int64,
    "n_wrong": pl.Int64,
    "place": pl.String,
    "expected": pl.String,
    "measured": pl.String,
}
"""One row per quantity of one world: how many values were compared, how many are wrong, and the one that is farthest
from its expected value. `place` says which value that is; it is null if the quantity has one value only.
"""


def exact(
    area: Area,
    world: str,
    expected: pl.DataFrame,
    measured: pl.DataFrame,
    *,
    values: Sequence[str],
    by: Collection[str] = (),
) -> pl.DataFrame:
    """Compare every value of two tables.

    Parameters
    ----------
    area, world
        As in `CHECKS`.
    expected, measured
        Tables with the same key columns. `measured` may have more columns. Null and text must agree exactly.
    values
        The columns that are compared. All other columns of `expected` are keys.
    by
        Key columns of which each value is a quantity of its own.

    Returns
    -------
    polars.DataFrame
        Schema `CHECKS`. A row that only one of the tables has is wrong in all its values.
    """
    keys = [name for name in expected.columns if name not in values]
    typed = measured.select(*(pl.col(name).cast(expected.schema[name]) for name in keys), *values, _there=pl.lit(1))
    known = expected.with_columns(_known=pl.lit(1))
    both = known.join(typed, on=keys, how="full", coalesce=True, nulls_equal=True, suffix="_measured").sort(keys)
    parts = both.partition_by(list(by), maintain_order=True) if by else [both]
    rows = [
        _compared(area, world, part, name, keys, by)
        for part in parts
        for name in values
        if part[name].null_count() + part[f"{name}_measured"].null_count() < 2 * part.height
    ]
    return pl.DataFrame(rows, schema=dict(CHECKS), orient="row")


def within(
    area: Area, world: str, quantity: str, value: float | None, *, low: float, high: float, n: int = 1
) -> pl.DataFrame:
    """Compare a number with limits that include them.

    Parameters
    ----------
    n
        Number of values behind the number.
    """
    good = value is not None and low <= value <= high
    limits = f"{low:.4g} to {high:.4g}"
    row = (area, world, quantity, n, int(not good), None, limits, "none" if value is None else f"{value:.4g}")
    return pl.DataFrame([row], schema=dict(CHECKS), orient="row")


def answer(area: Area, world: str, quantity: str, found: Sequence[str], *, allowed: Collection[str]) -> pl.DataFrame:
    """Compare verdicts with those that are right; there must be at least one."""
    wrong = [verdict for verdict in found if verdict not in allowed]
    shown = wrong[0] if wrong else (found[0] if found else "none")
    expected = " or ".join(allowed)
    row = (area, world, quantity, len(found), len(wrong) if found else 1, None, expected, shown)
    return pl.DataFrame([row], schema=dict(CHECKS), orient="row")


def failed(area: Area, world: str, error: BaseException) -> pl.DataFrame:
    """The check that a world can be measured, which ended in an error."""
    row = (area, world, "measurement", 1, 1, None, "no error", with_type(error))
    return pl.DataFrame([row], schema=dict(CHECKS), orient="row")


def _compared(
    area: Area, world: str, part: pl.DataFrame, name: str, keys: Sequence[str], by: Collection[str]
) -> tuple[object, ...]:
    """A row of `CHECKS`: one column of some rows."""
    expected, measured = part[name], part[f"{name}_measured"]
    wrong, distance = _wrong(expected, measured)
    wrong = wrong | part["_known"].is_null().to_numpy() | part["_there"].is_null().to_numpy()
    worst = int(np.argmax(np.where(wrong, distance + 1.0, 0.0)))
    place = ", ".join(f"{key} {part[key][worst]}" for key in keys if key not in by)
    quantity = " ".join([*(str(part[key][0]) for key in by), name])
    return area, world, quantity, part.height, int(wrong.sum()), place, _text(expected[worst]), _text(measured[worst])


def _wrong(expected: pl.Series, measured: pl.Series) -> tuple[np.ndarray, np.ndarray]:
    """Whether each value is wrong, and by how much; by infinity where one of the two is missing."""
    if not expected.dtype.is_numeric():
        differs = expected.cast(pl.String).ne_missing(measured.cast(pl.String)).to_numpy()
        return differs, differs.astype(np.float64)
    a, b = (series.cast(pl.Float64).fill_null(np.nan).to_numpy() for series in (expected, measured))
    distance = np.where(np.isnan(a) & np.isnan(b), 0.0, np.nan_to_num(np.abs(a - b), nan=np.inf))
    return distance > TOLERANCE * np.maximum(1.0, np.nan_to_num(np.abs(a))), distance


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4f}"
    return "none" if value is None else str(value)
