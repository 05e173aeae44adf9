"""What is independent of each other, and left out as a whole: groups of scenes, or blocks where scenes are few.

With fewer than `LEAST_GROUPS` groups, single scenes are left out. What is found then holds for these groups only.
"""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.findings.sampling.units import Units, by_number
from tracknoise.tables.enumerations import Resampled

LEAST_GROUPS = 3


def independent_sums(units: Units) -> NDArray[np.float64]:
    """Sums of what is left out in turn, (groups, points, columns); of blocks where blocks are resampled."""
    if units.resampled == Resampled.blocks:
        return units.sums
    number = units.scene_group[units.scene]
    return by_number(number, units.sums) if _are_enough(number) else units.sums


def independent_noun(units: Units) -> str:
    """What `independent_sums` are of, in the plural; blocks are scenes where each scene has no more than one."""
    if units.resampled == Resampled.blocks:
        of_scene = np.bincount(units.scene[units.sums[..., 0].any(axis=1)])
        return "blocks of tracks" if of_scene.max(initial=0) > 1 else "scenes"
    n_groups = len(np.unique(units.scene_group))
    return "groups of scenes" if LEAST_GROUPS <= n_groups < len(units.scenes) else "scenes"


def group_numbers(table: pl.DataFrame, groups: SceneGroups) -> NDArray[np.intp]:
    """Number of what the scene of each row is left out with, from 0, (rows,): its group, or the scene itself.

    Parameters
    ----------
    table
        Column scene; if there are groups, also a column dataset, with one value.
    groups
        Of scenes that are not independent of each other.
    """
    names = table["scene"].unique().sort().to_list()
    number = groups.of(_dataset(table), names)
    chosen = number if _are_enough(number) else np.arange(len(names))
    return np.asarray(chosen[np.searchsorted(names, table["scene"].to_list())], dtype=np.intp)


def _dataset(table: pl.DataFrame) -> str:
    return str(table["dataset"][0]) if "dataset" in table.columns and table.height else ""


def _are_enough(number: NDArray[np.intp]) -> bool:
    return len(np.unique(number)) >= LEAST_GROUPS
