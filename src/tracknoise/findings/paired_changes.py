"""What effects change, relative to the same scenes without them: means over scenes, with intervals."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.factors.averages import average
from tracknoise.findings.factors.exceeding import half_widths_alone
from tracknoise.tables.defaults import LEVEL
from tracknoise.tables.effects_schema import CLEAN, EFFECT_VALUES
from tracknoise.tables.enumerations import Resampled
from tracknoise.tables.schema import check

_POINT = ["effect", "size", "tracker", "age", "statistic"]
_SCENE = ["scene", "size", "tracker", "age", "statistic"]


def paired_changes(values: pl.DataFrame, *, level: float = LEVEL) -> pl.DataFrame:
    """Changes within scenes, averaged over scenes, with Student's intervals.

    Parameters
    ----------
    values
        Schema `EFFECT_VALUES`. Scenes are independent of each other.
    level
        Probability that an interval contains the true change.

    Returns
    -------
    polars.DataFrame
        Effect, size, tracker, age and statistic in the order of the values, then clean, changed, change, change_low,
        change_high and n_scenes: see `EFFECT_CHANGES`. Scenes in which one of the two values is missing take no part.

    Raises
    ------
    SchemaError
        If the table has other columns.
    """
    checked = check(values, EFFECT_VALUES, "effect values")
    clean = checked.filter(effect=CLEAN).select_seq(*_SCENE, clean="value")
    pairs = checked.filter(pl.col("effect") != CLEAN).join(clean, on=_SCENE, how="left", maintain_order="left")
    points = pairs.select_seq(_POINT).unique(maintain_order=True).with_row_index("point")
    placed = pairs.join(points, on=_POINT, maintain_order="left").with_columns_seq(pl.col("scene").rank("dense") - 1)
    before, after = (_matrix(placed, column, points.height) for column in ("clean", "value"))
    known = np.where(np.isnan(before + after), np.nan, 0.0)
    means = [_mean(array + known) for array in (before, after)]
    found = average(after - before, np.zeros(len(before), np.intp), Resampled.scenes)
    width = np.where(found.n_scenes > 1, half_widths_alone(found, 1.0 - level), np.nan)
    change = np.where(found.n_scenes > 0, found.mean, np.nan)
    columns = {"clean": means[0], "changed": means[1], "change": change}
    columns |= {"change_low": change - width, "change_high": change + width}
    return points.drop("point").with_columns_seq(
        **{name: pl.Series(column, nan_to_null=True) for name, column in columns.items()},
        n_scenes=pl.Series(found.n_scenes, dtype=pl.Int32),
    )


def _matrix(placed: pl.DataFrame, column: str, count: int) -> NDArray[np.float64]:
    """(scenes, points) float64; NaN where there is no value."""
    scenes, points = placed["scene"].to_numpy(), placed["point"].to_numpy()
    matrix = np.full((int(scenes.max()) + 1 if len(scenes) else 0, count), np.nan)
    matrix[scenes, points] = placed[column].cast(pl.Float64).fill_null(np.nan).to_numpy()
    return matrix


def _mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of the scenes that have a value; NaN where none has."""
    there = ~np.isnan(values)
    count = there.sum(axis=0)
    return np.asarray(np.where(there, values, 0.0).sum(axis=0) / np.where(count > 0, count, np.nan))
