"""The units that are resampled, as arrays of sums: scenes, or blocks of tracks within them if there are few scenes.

Scenes are the sampling units: findings about a condition hold for scenes like those that were measured. With fewer
than `MIN_SCENES` scenes no such finding is possible. Blocks are then resampled within each scene. The findings hold
for these scenes only, because they do not include the variation between scenes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.blocks import BLOCKS
from tracknoise.statistics.grouping import group_rows
from tracknoise.statistics.moment_cells import ABOUT_ZERO
from tracknoise.tables.enumerations import Resampled

MIN_SCENES = 6
"""Fewest scenes that are resampled as such, and that a test at 5 % can do with."""

SUMS = ("n", "u", "v", "uu", "uv", "vv", "abs_u", "abs_v")
"""What `additive` makes of moments: the count, and sums of du, dv, their products about zero, and |du|, |dv|."""


@dataclass(frozen=True, slots=True)
class Units:
    """Sums of every unit of one condition.

    Attributes
    ----------
    sums : (units, points, columns) float64
        0 where a unit has no data.
    points
        Labels of the points: one row each, sorted.
    scenes
        Names of the scenes that have anything, sorted.
    scene : (units,) intp
        Place of each unit's scene in `scenes`, never decreasing.
    resampled
        `scenes` or `blocks`; None if neither can be: too few scenes, and no blocks.
    """

    sums: NDArray[np.float64]
    points: pl.DataFrame
    scenes: tuple[str, ...]
    scene: NDArray[np.intp]
    resampled: Resampled | None

    def contributing(self, present: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """How many units, and how many scenes, take part in each number.

        Parameters
        ----------
        present : (..., units)
            Whether a unit does.

        Returns
        -------
        n_units, n_scenes : (...) intp
        """
        if not self.scenes:
            zeros = np.zeros(present.shape[:-1], dtype=np.intp)
            return zeros, zeros
        starts = np.searchsorted(self.scene, np.arange(len(self.scenes)))
        by_scene = np.logical_or.reduceat(present, starts, axis=-1)
        return present.sum(axis=-1), by_scene.sum(axis=-1)


def additive(moments: pl.DataFrame) -> pl.DataFrame:
    """Return a table of moments with the columns of `SUMS` in place of means and central sums.

    Parameters
    ----------
    moments
        Of scenes (`MOMENTS`, `ASPECTS`) or blocks (`BLOCKS`); whatever else it has stays.
    """
    absolute = {f"abs_{axis}": pl.col("n") * pl.col(f"mean_abs_{axis}").fill_null(0.0) for axis in "uv"}
    return moments.with_columns(**ABOUT_ZERO, **absolute).select(pl.exclude("^m_.*$", "^mean_.*$"))


def units_of(
    scenes: pl.DataFrame, blocks: pl.DataFrame | None = None, *, points: Sequence[str], columns: Sequence[str]
) -> Units:
    """Sums by unit of one condition: by scene if there are at least `MIN_SCENES`, else by block.

    Parameters
    ----------
    scenes
        Columns scene, `points` and `columns`; rows that agree in scene and point are added up.
    blocks
        The same with a column block, under `BLOCKS`; what it holds adds up to what `scenes` holds.
    points
        Columns that identify the points at which there are sums; without any there is one point.
    columns
        What is summed.
    """
    names = scenes["scene"].unique().sort().to_list()
    if len(names) >= MIN_SCENES:
        return _scattered(scenes, names, None, points, columns, Resampled.scenes)
    if blocks is None or blocks.is_empty():
        return _scattered(scenes, names, None, points, columns, None)
    return _scattered(blocks, names, "block", points, columns, Resampled.blocks)


def _scattered(
    table: pl.DataFrame,
    names: list[str],
    block: str | None,
    points: Sequence[str],
    columns: Sequence[str],
    resampled: Resampled | None,
) -> Units:
    """Rows put, and added up, where they belong."""
    one_point = table.with_columns(pl.lit(0, dtype=pl.UInt8).alias("point")) if not points else table
    groups = group_rows(one_point, points or ["point"])
    scene = group_rows(table, ["scene"])
    place = np.searchsorted(names, scene.keys["scene"].to_list())[scene.index]
    each = 1 if block is None else BLOCKS
    unit = place * each + (0 if block is None else table[block].to_numpy().astype(np.intp))
    shape = (len(names) * each, groups.count)
    flat = unit * groups.count + groups.index
    sums = [np.bincount(flat, table[column].to_numpy(), shape[0] * shape[1]).reshape(shape) for column in columns]
    keys = groups.keys if points else pl.DataFrame()
    return Units(np.stack(sums, axis=-1), keys, tuple(names), np.repeat(np.arange(len(names)), each), resampled)
