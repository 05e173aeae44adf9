"""Groups of scenes that are not independent of each other: pieces of one recording, one place, or one motion.

Scenes of one group are alike, so that intervals that take them for independent are too narrow. What is resampled
depends on how many groups there are (scheme):

- scenes, if every scene is a group of its own.
- groups, if there are at least `MIN_SCENES` of them.
- within: scenes within their groups, if there are at least `MIN_SCENES` scenes and these exceed the groups by
  `MIN_WITHIN`. What is found then holds for these groups only, because it excludes the variation between groups.
- otherwise nothing: blocks of tracks within scenes may be resampled instead.

Scenes that are all of one group are what the experiment is about, and count as independent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
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
    """

    names: Mapping[tuple[str, str], str] = field(default_factory=dict)

    def of(self, dataset: str, scenes: Sequence[str]) -> NDArray[np.intp]:
        """Number of the group of each scene, (scenes,), from 0 in the order of their first scenes.

        If all are of one group, each has its own number.
        """
        named = [(1, self.names[dataset, scene]) if (dataset, scene) in self.names else (0, scene) for scene in scenes]
        number = {name: place for place, name in enumerate(dict.fromkeys(named))}
        if len(number) == 1:
            return np.arange(len(named))
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
    enough = len(group) >= MIN_SCENES and len(group) - n_groups >= MIN_WITHIN
    return Resampled.within if enough else None
