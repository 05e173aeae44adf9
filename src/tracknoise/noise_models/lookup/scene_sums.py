"""Sums of products of errors by scene, condition and age, as arrays, and what they are looked up by."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.groups import SceneGroups, scheme
from tracknoise.tables.enumerations import Lookup, Product, Resampled

Array = NDArray[np.float64]

_SUMS = ("n", "uu", "uv", "vv")


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

    def labels(self, lookup: Lookup) -> NDArray[np.intp]:
        """Number of the row of a table that each scene and condition is looked up in, (scenes, conditions)."""
        condition = np.arange(len(self.conditions))
        if lookup is Lookup.one:
            condition = np.zeros_like(condition)
        elif lookup is Lookup.tracker:
            names = [name for name, _ in self.conditions]
            condition = np.unique(names, return_inverse=True)[1]
        motion = self.motion if lookup is Lookup.motion else np.zeros_like(self.motion)
        return np.asarray(condition + len(self.conditions) * motion[:, None])

    def left_out(self, lookup: Lookup) -> Array:
        """What a table was made of without the scene that is looked up in it, (scenes, conditions, ages, 4)."""
        labels, found = self.labels(lookup), np.zeros_like(self.sums)
        for label in np.unique(labels):
            mine = labels == label
            of_scenes = np.where(mine[..., None, None], self.sums, 0.0).sum(axis=1)
            others = of_scenes.sum(axis=0) - of_scenes
            found[mine] = np.broadcast_to(others[:, None], found.shape)[mine]
        return found

    def alone(self, lookup: Lookup) -> NDArray[np.bool_]:
        """Scenes that are the only ones of all of their rows, (scenes,)."""
        return np.asarray((self.left_out(lookup)[..., 0].sum(axis=-1) == 0.0).all(axis=1))


def reference_view(sums: Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Rows of the upright view, played forward if there is one: turned errors cannot be added to others.

    Parameters
    ----------
    sums
        Of any sequences, schema `NOISE_SUMS`.
    """
    table = pl.concat(sums)
    return table.filter(pl.col("rotation") == table["rotation"].min(), pl.col("direction") == table["direction"].max())


def scene_sums(sums: pl.DataFrame, groups: SceneGroups) -> Iterator[tuple[str, Product, SceneSums]]:
    """Sums of each dataset and of the products `error` and `change`, all lightings and cameras together.

    Parameters
    ----------
    sums
        What `reference_view` returns.
    groups
        Groups of scenes, such as those of one motion.
    """
    for (dataset,), table in sorted(sums.partition_by("dataset", as_dict=True).items()):
        for product in (Product.error, Product.change):
            some = table.filter(product=product)
            if some.height:
                yield str(dataset), product, _dense(some, str(dataset), groups)


def _dense(table: pl.DataFrame, dataset: str, groups: SceneGroups) -> SceneSums:
    scenes, scene = _numbered(table["scene"])
    trackers, tracker = _numbered(table["tracker"])
    speeds, speed = _numbered(table["speed"])
    ages, age = _numbered(table["age"])
    known, condition = np.unique(tracker * len(speeds) + speed, return_inverse=True)
    dense = np.zeros((len(scenes), len(known), len(ages), len(_SUMS)))
    np.add.at(dense, (scene, condition, age), table.select(pl.col(_SUMS).cast(pl.Float64)).to_numpy())
    conditions = tuple((str(trackers[code // len(speeds)]), int(speeds[code % len(speeds)])) for code in known)
    named = [groups.names.get((dataset, name), name) for name in scenes]
    motion = np.unique(named, return_inverse=True)[1]
    return SceneSums(tuple(scenes), motion, *_units(groups.of(dataset, scenes)), conditions, dense)


def _numbered(column: pl.Series) -> tuple[list[Any], NDArray[np.intp]]:
    """Values that occur, sorted, and the number of the value of each row."""
    values = column.unique().sort()
    return values.to_list(), np.searchsorted(values.to_numpy(), column.to_numpy())


def _units(group: NDArray[np.intp]) -> tuple[NDArray[np.intp], Resampled]:
    """Units of intervals, and what they are.

    Of two scenes in a group, each predicts the other one, so that their gains are the same but for chance.
    """
    sizes, kind = np.bincount(group), scheme(group)
    if (kind is None and sizes.max() > 1) or (kind == Resampled.within and (sizes == 2).any()):
        kind = Resampled.groups
    units = group if kind == Resampled.groups else np.arange(len(group))
    return np.asarray(units, dtype=np.intp), kind or Resampled.scenes
