"""The units that are resampled, as arrays of sums: scenes, or blocks of tracks within them if there are few scenes.

Scenes are the sampling units: findings about a condition hold for scenes like those that were measured. If scenes come
in groups, such as pieces of one recording, whole groups are resampled, or scenes within their groups
(`tracknoise.findings.sampling.groups`). With fewer than `MIN_SCENES` scenes no such finding is possible. Blocks are
then resampled within each scene. The findings hold for these scenes only, because they do not include the variation
between scenes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.groups import MIN_SCENES, NO_GROUPS, SceneGroups, scheme
from tracknoise.statistics.blocks import BLOCKS
from tracknoise.statistics.errors.moment_cells import ABOUT_ZERO
from tracknoise.statistics.grouping import Groups, group_rows, number_names
from tracknoise.tables.enumerations import Resampled

__all__ = ["MIN_SCENES", "SUMS", "UnitPlaces", "Units", "additive", "by_number", "unit_places", "units_of"]

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
        What is resampled; None if nothing can be: too few scenes, and no blocks.
    group : (scenes,) intp or None
        Number of the group of each scene, from 0. None if every scene is a group of its own.
    """

    sums: NDArray[np.float64]
    points: pl.DataFrame
    scenes: tuple[str, ...]
    scene: NDArray[np.intp]
    resampled: Resampled | None
    group: NDArray[np.intp] | None = None

    @property
    def scene_group(self) -> NDArray[np.intp]:
        """Number of the group of each scene, (scenes,)."""
        return np.arange(len(self.scenes)) if self.group is None else self.group

    @property
    def strata(self) -> NDArray[np.intp] | None:
        """Within what each unit is resampled, (units,): its scene or its group; None if there is one stratum."""
        if self.resampled == Resampled.blocks:
            return self.scene
        return self.scene_group[self.scene] if self.resampled == Resampled.within else None

    def across_groups(self) -> "Units":
        """The same, but scenes that would be resampled within their groups are resampled as if independent.

        Intervals are then too wide rather than too narrow. Within groups they are stretched, which takes statistics
        that have limits, such as kurtosis, beyond these.
        """
        return replace(self, resampled=Resampled.scenes, group=None) if self.resampled == Resampled.within else self

    def joined(self, sums: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums (units, ...) of what is resampled as a whole: of groups where these are resampled, else of units."""
        return sums if self.resampled != Resampled.groups else by_number(self.scene_group[self.scene], sums)

    def contributing(self, present: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """How many units, and how many scenes, take part in each number.

        Parameters
        ----------
        present : (..., units)
            Whether a unit does.

        Returns
        -------
        n_units, n_scenes : (...) intp
            Of groups, where these are resampled, `n_units` is the number.
        """
        by_scene = _any(present, self.scene)
        units = self.groups_present(present) if self.resampled == Resampled.groups else present.sum(axis=-1)
        return units, by_scene.sum(axis=-1)

    def groups_present(self, present: NDArray[np.bool_]) -> NDArray[np.intp]:
        """How many groups take part in each number, (...), with `present` as in `contributing`."""
        groups = _any(present, self.scene_group[self.scene])
        return np.asarray(groups.sum(axis=-1))


@dataclass(frozen=True, slots=True)
class UnitPlaces:
    """Where the rows of a table of one condition are added up.

    Attributes
    ----------
    points
        The rows by point.
    scenes
        Names of the scenes that have anything, sorted.
    unit : (rows,) intp
        Unit of each row. Every scene has `each` of them, one scene after the other.
    each
        How many units a scene has.
    resampled, group
        As in `Units`.
    """

    points: Groups
    scenes: tuple[str, ...]
    unit: NDArray[np.intp]
    each: int
    resampled: Resampled | None
    group: NDArray[np.intp] | None = None

    def units(self, columns: Sequence[NDArray[Any]]) -> Units:
        """Sums of `columns`, (rows,) each, by unit and point."""
        shape = len(self.scenes) * self.each, self.points.count
        flat = self.unit * self.points.count + self.points.index
        sums = [np.bincount(flat, column, shape[0] * shape[1]).reshape(shape) for column in columns]
        scene = np.repeat(np.arange(len(self.scenes)), self.each)
        return Units(np.stack(sums, axis=-1), self.points.keys, self.scenes, scene, self.resampled, self.group)

    def across_groups(self) -> "UnitPlaces":
        """The same, with units as from `Units.across_groups`."""
        return replace(self, resampled=Resampled.scenes, group=None) if self.resampled == Resampled.within else self


def by_number(number: NDArray[np.intp], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums over the rows (rows, ...) of each number from 0, (numbers, ...).

    Parameters
    ----------
    number : (rows,)
        Number of each row.
    values : (rows, ...)
        What is added up.
    """
    if not len(number) or np.array_equal(number, np.arange(len(number))):
        return values
    order, starts = _runs(number)
    return np.asarray(np.add.reduceat(values[order], starts, axis=0))


def _any(present: NDArray[np.bool_], number: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether any unit of each number from 0 is present, (..., numbers)."""
    if not len(number) or np.array_equal(number, np.arange(len(number))):
        return present
    order, starts = _runs(number)
    return np.logical_or.reduceat(present[..., order], starts, axis=-1)


def _runs(number: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Order in which equal numbers follow each other, and where each begins; every number from 0 occurs."""
    order = np.argsort(number, kind="stable")
    return order, np.searchsorted(number[order], np.arange(number.max() + 1))


def additive(moments: pl.DataFrame) -> pl.DataFrame:
    """Return a table of moments with the columns of `SUMS` in place of means and central sums.

    Parameters
    ----------
    moments
        Of scenes (`MOMENTS`, `ASPECTS`) or blocks (`BLOCKS`); whatever else it has stays.
    """
    absolute = {f"abs_{axis}": pl.col("n") * pl.col(f"mean_abs_{axis}").fill_null(0.0) for axis in "uv"}
    others = [name for name in moments.columns if not name.startswith(("m_", "mean_"))]
    return moments.select_seq(*others, **ABOUT_ZERO, **absolute)


def units_of(
    scenes: pl.DataFrame,
    blocks: pl.DataFrame | None = None,
    *,
    points: Sequence[str],
    columns: Sequence[str],
    groups: SceneGroups = NO_GROUPS,
) -> Units:
    """Sums by unit of one condition: by scene if there are enough (`scheme`), else by block.

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
    groups
        Groups of scenes that are not independent of each other. `scenes` then has a column dataset.
    """
    table, places = _placed(scenes, blocks, points, groups)
    return places.units([table[column].to_numpy() for column in columns])


def unit_places(rows: pl.DataFrame, *, points: Sequence[str], groups: SceneGroups = NO_GROUPS) -> UnitPlaces:
    """Where rows of one condition belong: of use where several things are summed over the same rows.

    Parameters
    ----------
    rows
        Columns scene, block and `points`.
    points, groups
        As in `units_of`.
    """
    return _placed(rows, rows, points, groups)[1]


def _placed(
    scenes: pl.DataFrame, blocks: pl.DataFrame | None, points: Sequence[str], groups: SceneGroups
) -> tuple[pl.DataFrame, UnitPlaces]:
    """The table whose rows are summed, and where they belong."""
    names, scene = number_names(scenes["scene"])
    group = groups.of(scenes["dataset"][0], names) if groups.names and names else np.arange(len(names))
    resampled = scheme(group)
    if resampled is not None or blocks is None or blocks.is_empty():
        known = None if resampled is None else group
        return scenes, UnitPlaces(_points(scenes, points), tuple(names), scene, 1, resampled, known)
    with_blocks, index = number_names(blocks["scene"])
    scene = np.searchsorted(names, with_blocks)[index]
    unit = scene * BLOCKS + blocks["block"].to_numpy().astype(np.intp)
    return blocks, UnitPlaces(_points(blocks, points), tuple(names), unit, BLOCKS, Resampled.blocks)


def _points(table: pl.DataFrame, points: Sequence[str]) -> Groups:
    """The rows by point; one point, unless there are no rows, where nothing identifies them."""
    if points:
        return group_rows(table, points)
    return Groups(pl.DataFrame(height=min(table.height, 1)), np.zeros(table.height, dtype=np.intp))
