"""Sums of products of errors by scene, condition and age, as arrays, and what they are looked up by."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import prod

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.groups import SceneGroups, scheme
from tracknoise.statistics.grouping import group_rows
from tracknoise.tables.enumerations import Lookup, Product, Resampled

Array = NDArray[np.float64]

_SUMS = ("n", "uu", "uv", "vv")
_KEYS = ("dataset", "scene", "rotation", "direction", "tracker", "speed", "product", "age")
_LOOKED_UP = (Product.error, Product.change)
USED = (*_KEYS, *_SUMS)
"""Columns of `tracknoise.tables.schema.NOISE_SUMS` that are read."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneSums:
    """Sums of one product of one dataset.

    Attributes
    ----------
    scenes
        Names, sorted.
    motion : (scenes,) intp
        Number of the group of each scene. A scene without a group has a number of its own.
    unit : (scenes,) intp
        Number of the unit of intervals that each scene is part of: its group, or the scene itself.
    resampled
        What the units are.
    conditions
        Trackers and speeds, sorted.
    sums : (scenes, conditions, ages, 4) float64
        Count, and sums of uu, uv and vv, px^2.
    """

    scenes: tuple[str, ...]
    motion: NDArray[np.intp]
    unit: NDArray[np.intp]
    resampled: Resampled
    conditions: tuple[tuple[str, int], ...]
    sums: Array

    def count(self, lookup: Lookup) -> int:
        """Number of rows of a table."""
        motions = len(np.unique(self.motion)) if lookup is Lookup.motion else 1
        return (int(self._row(lookup).max()) + 1) * motions

    def left_out(self, lookup: Lookup) -> Array:
        """What a table was made of without the scene that is looked up in it, (scenes, conditions, ages, 4)."""
        row = self._row(lookup)
        own = np.stack([self.sums[:, row == one].sum(axis=1) for one in range(row.max() + 1)], axis=1)
        motion = self.motion if lookup is Lookup.motion else np.zeros_like(self.motion)
        every = np.empty_like(own)
        for one in np.unique(motion):
            every[motion == one] = own[motion == one].sum(axis=0)
        return np.asarray((every - own)[:, row])

    def _row(self, lookup: Lookup) -> NDArray[np.intp]:
        """Number of the row that each condition is looked up in, among those of one motion, (conditions,)."""
        if lookup is Lookup.one:
            return np.zeros(len(self.conditions), dtype=np.intp)
        if lookup is Lookup.tracker:
            return np.unique([name for name, _ in self.conditions], return_inverse=True)[1]
        return np.arange(len(self.conditions))

    def alone(self, lookup: Lookup) -> NDArray[np.bool_]:
        """Scenes that are the only ones of all of their rows, (scenes,)."""
        return np.asarray((self.left_out(lookup)[..., 0].sum(axis=-1) == 0.0).all(axis=1))


def condensed(sums: pl.DataFrame) -> pl.DataFrame:
    """Sums of the products `error` and `change`, all lightings and cameras together.

    Parameters
    ----------
    sums
        With at least the columns `USED`.

    Returns
    -------
    polars.DataFrame
        Columns `USED`.
    """
    some = sums.filter(pl.col("product").is_in(_LOOKED_UP))
    groups = group_rows(some, _KEYS)
    return groups.keys.hstack(groups.sums(some, _SUMS))


def scene_sums(sums: pl.DataFrame, groups: SceneGroups) -> Iterator[tuple[str, Product, SceneSums]]:
    """Sums of each dataset and product.

    Parameters
    ----------
    sums
        Of one view (`condensed`).
    groups
        Groups of scenes, such as those of one motion.
    """
    for dataset in sums["dataset"].unique().sort():
        for product in _LOOKED_UP:
            some = sums.filter(dataset=dataset, product=product)
            if some.height:
                yield dataset, product, _dense(some, dataset, groups)


def _dense(table: pl.DataFrame, dataset: str, groups: SceneGroups) -> SceneSums:
    scene, condition, age = (group_rows(table, by) for by in (["scene"], ["tracker", "speed"], ["age"]))
    shape = scene.count, condition.count, age.count
    cell = np.ravel_multi_index((scene.index, condition.index, age.index), shape)
    columns = [np.bincount(cell, table[name].to_numpy(), prod(shape)).reshape(shape) for name in _SUMS]
    scenes = scene.keys["scene"].to_list()
    named = [groups.names.get((dataset, name), name) for name in scenes]
    motion = np.unique(named, return_inverse=True)[1]
    units = _units(groups.of(dataset, scenes))
    return SceneSums(tuple(scenes), motion, *units, tuple(condition.keys.rows()), np.stack(columns, axis=-1))


def _units(group: NDArray[np.intp]) -> tuple[NDArray[np.intp], Resampled]:
    """Units of intervals, and what they are.

    Of two scenes in a group, each predicts the other one, so that their gains are the same but for chance.
    """
    sizes, kind = np.bincount(group), scheme(group)
    if (kind is None and sizes.max() > 1) or (kind == Resampled.within and (sizes == 2).any()):
        kind = Resampled.groups
    units = group if kind == Resampled.groups else np.arange(len(group))
    return np.asarray(units, dtype=np.intp), kind or Resampled.scenes
