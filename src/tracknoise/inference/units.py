"""The units that are resampled: scenes, groups of scenes that are not independent, or blocks of tracks within scenes.

Scenes of one group are pieces of one recording, one place, or one motion. They are alike, so that intervals that take
them for independent are too narrow. What is resampled depends on how many groups there are (scheme):

- scenes, if every scene is a group of its own.
- groups, if there are at least `MIN_SCENES` of them.
- within: scenes within several groups, if there are at least `MIN_SCENES` scenes and these exceed the groups by
  `MIN_WITHIN`. What is found then holds for these groups only, because it excludes the variation between groups.
- otherwise nothing: blocks of tracks within scenes may be resampled instead.

Scenes that are all of one group are what the experiment is about, and count as independent, except for copies: scenes
with the same images are never independent.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray


class Resampled(StrEnum):
    """Units that intervals resample.

    scenes: independent scenes. groups: groups of scenes that are not independent of each other. within: scenes within
    their groups, so that intervals hold for these groups only. blocks: blocks of tracks within scenes, so that
    intervals hold for these scenes only.
    """

    scenes = "scenes"
    groups = "groups"
    within = "within"
    blocks = "blocks"


MIN_SCENES = 6
"""Fewest scenes, or groups of scenes, that are resampled as such, and that a test at 5 % can do with."""
MIN_WITHIN = 3
"""Fewest scenes more than groups: the degrees of freedom of the variation within groups."""


@dataclass(frozen=True, slots=True)
class SceneGroups:
    """The group of each scene."""

    # By dataset and scene. A scene that is not in it is a group of its own.
    names: Mapping[tuple[str, str], str] = field(default_factory=dict)
    # scenes with the images of another, by dataset and scene: the name of the other
    copies: Mapping[tuple[str, str], str] = field(default_factory=dict)

    def of(self, dataset: str, scenes: Sequence[str]) -> NDArray[np.intp]:
        """Number of the group of each scene, (scenes,), from 0 in the order of their first scenes.

        If all are of one group, each has its own number, which copies share.
        """
        named = [(1, self.names[dataset, scene]) if (dataset, scene) in self.names else (0, scene) for scene in scenes]
        if len(set(named)) == 1:
            named = [(0, self.copies.get((dataset, scene), scene)) for scene in scenes]
        number = {name: place for place, name in enumerate(dict.fromkeys(named))}
        return np.array([number[name] for name in named], dtype=np.intp)


NO_GROUPS = SceneGroups()
"""Every scene is independent of the others."""


def scheme(group: NDArray[np.intp]) -> Resampled | None:
    """What is resampled by (scheme); None if scenes or groups are too few.

    Parameters
    ----------
    group : (scenes,)
        Number of the group of each scene.
    """
    n_groups = len(np.unique(group))
    if n_groups >= MIN_SCENES:
        return Resampled.scenes if n_groups == len(group) else Resampled.groups
    enough = n_groups > 1 and len(group) >= MIN_SCENES and len(group) - n_groups >= MIN_WITHIN
    return Resampled.within if enough else None


@dataclass(frozen=True, slots=True)
class JoinedScenes:
    """New names of scenes, the same for all scenes of a group, where groups are resampled by (scheme).

    Statistics that know nothing of groups then take each group for one scene. Scenes of fewer groups keep their names
    and their groups (`tracknoise.analysis.condition_units.Units.across_groups`).
    """

    names: Mapping[tuple[str, str], str]  # by dataset and scene; scenes that keep their names are missing
    others: SceneGroups  # groups of the scenes that keep their names

    @classmethod
    def of(cls, scenes: Mapping[str, Iterable[str]], groups: SceneGroups) -> "JoinedScenes":
        """Of the scenes of each dataset."""
        names: dict[tuple[str, str], str] = {}
        for dataset, of_dataset in scenes.items():
            ordered = sorted(of_dataset)
            group = groups.of(dataset, ordered)
            if scheme(group) == Resampled.groups:
                names |= {(dataset, scene): f"group {number}" for scene, number in zip(ordered, group, strict=True)}
        other_groups = {key: group for key, group in groups.names.items() if key not in names}
        return cls(names, SceneGroups(other_groups, groups.copies))

    def rename(self, table: pl.DataFrame, dataset: str) -> pl.DataFrame:
        """A table of one dataset with these names in its column scene."""
        names = {scene: name for (of_dataset, scene), name in self.names.items() if of_dataset == dataset}
        return table.with_columns_seq(pl.col("scene").replace(names)) if names else table

    def scenes(self, scenes: Mapping[str, Iterable[str]]) -> dict[str, set[str]]:
        """Scenes of each dataset by their new names."""
        return {
            dataset: {self.names.get((dataset, scene), scene) for scene in own_scenes}
            for dataset, own_scenes in scenes.items()
        }

    def resampled(self, units: Resampled | None, dataset: str, scenes: Sequence[str]) -> Resampled | None:
        """What intervals are over, given what units of some scenes of a dataset, by their new names, were made of.

        It is `within` if scenes were resampled as if independent, but some are of one group: intervals then hold for
        these groups only.
        """
        if units != Resampled.scenes:
            return units
        joined = any(of_dataset == dataset for of_dataset, _ in self.names)
        return Resampled.groups if joined else scheme(self.others.of(dataset, scenes))


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


def sorting(group: NDArray[np.signedinteger[Any]]) -> NDArray[np.intp]:
    """Order of rows by their groups, numbers (n,) from 0, otherwise as they are; fast where these are small."""
    return np.argsort(group.astype(np.min_scalar_type(int(group.max(initial=0)))), kind="stable")


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


BLOCKS = 16
"""Number of blocks of a sequence and condition; smaller where there are fewer tracks."""
