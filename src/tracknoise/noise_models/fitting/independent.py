"""What is independent of each other, and left out as a whole: groups of scenes, or blocks where scenes are few."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.findings.sampling.units import Units, by_number
from tracknoise.tables.enumerations import Resampled


def independent_sums(units: Units) -> NDArray[np.float64]:
    """Sums of what is left out in turn, (groups, points, columns); of blocks where blocks are resampled."""
    if units.resampled == Resampled.blocks:
        return units.sums
    return by_number(units.scene_group[units.scene], units.sums)


def group_numbers(table: pl.DataFrame, groups: SceneGroups) -> NDArray[np.intp]:
    """Number of the group of the scene of each row, from 0, (rows,).

    Parameters
    ----------
    table
        Column scene; if there are groups, also a column dataset, with one value.
    groups
        Of scenes that are not independent of each other.
    """
    names = table["scene"].unique().sort().to_list()
    number = groups.of(table["dataset"][0], names) if groups.names and names else np.arange(len(names))
    return np.asarray(number[np.searchsorted(names, table["scene"].to_list())], dtype=np.intp)
