"""Groups of scenes that are not independent of each other: pieces of one recording, one place, or one motion.

Scenes of one group are alike, so that intervals that take them for independent are too narrow. What is resampled
depends on how many groups there are (scheme):

- scenes, if every scene is a group of its own.
- groups, if there are at least `MIN_SCENES` of them.
- within: scenes within several groups, if there are at least `MIN_SCENES` scenes and these exceed the groups by
  `MIN_WITHIN`. What is found then holds for these groups only, because it excludes the variation between groups.
- otherwise nothing: blocks of tracks within scenes may be resampled instead.

Scenes that are all of one group are what the experiment is about, and count as independent, except for copies: scenes
with the same images are never independent.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.tables.enumerations import Resampled

MIN_SCENES = 6
"""Fewest scenes, or groups of scenes, that are resampled as such, and that a test at 5 % can do with."""
MIN_WITHIN = 3
"""Fewest scenes more than groups: the degrees of freedom of the variation within groups."""


@dataclass(frozen=True, slots=True)
class SceneGroups:
    """The group of each scene.

    Parameters
    ----------
    names
        By dataset and scene. A scene that is not in it is a group of its own.
    copies
        Scenes with the images of another, by dataset and scene: the name of the other.
    """

    names: Mapping[tuple[str, str], str] = field(default_factory=dict)
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
    and their groups (`tracknoise.findings.sampling.units.Units.across_groups`).

    Parameters
    ----------
    names
        By dataset and scene; scenes that keep their names are missing.
    others
        Groups of the scenes that keep their names.
    """

    names: Mapping[tuple[str, str], str]
    others: SceneGroups

    @classmethod
    def of(cls, scenes: Mapping[str, Iterable[str]], groups: SceneGroups) -> "JoinedScenes":
        """Of the scenes of each dataset."""
        names: dict[tuple[str, str], str] = {}
        for dataset, every in scenes.items():
            known = sorted(every)
            group = groups.of(dataset, known)
            if scheme(group) == Resampled.groups:
                names |= {(dataset, scene): f"group {own}" for scene, own in zip(known, group, strict=True)}
        others = {key: group for key, group in groups.names.items() if key not in names}
        return cls(names, SceneGroups(others, groups.copies))

    def rename(self, table: pl.DataFrame, dataset: str) -> pl.DataFrame:
        """A table of one dataset with these names in its column scene."""
        names = {scene: name for (of, scene), name in self.names.items() if of == dataset}
        return table.with_columns_seq(pl.col("scene").replace(names)) if names else table

    def scenes(self, scenes: Mapping[str, Iterable[str]]) -> dict[str, set[str]]:
        """Scenes of each dataset by their new names."""
        return {of: {self.names.get((of, scene), scene) for scene in every} for of, every in scenes.items()}

    def resampled(self, units: Resampled | None, dataset: str, scenes: Sequence[str]) -> Resampled | None:
        """What intervals are over, given what units of some scenes of a dataset, by their new names, were made of.

        It is `within` if scenes were resampled as if independent, but some are of one group: intervals then hold for
        these groups only.
        """
        if units != Resampled.scenes:
            return units
        joined = any(of == dataset for of, _ in self.names)
        return Resampled.groups if joined else scheme(self.others.of(dataset, scenes))
