"""Conditions of so few scenes, or groups of them, that blocks of tracks are resampled within each scene.

A scene counts where it has what is pooled. One whose images show no features has frames only, and a tracker may be
missing in some scenes of a view.
"""

import polars as pl

from tracknoise.findings.sampling.groups import SceneGroups, scheme
from tracknoise.statistics.conditions import Condition, TablesByCondition
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import number_names
from tracknoise.tables.enumerations import Population
from tracknoise.tables.schema import ORIGIN

_OF = "population"


def has_errors(population: str) -> pl.Expr:
    """Rows of `MOMENTS` and `SCALES` with visible observations, or with those that an experiment is about."""
    return (pl.col("n") > 0) & pl.col(_OF).is_in(sorted({Population.visible, population}))


def conditions_of_few_scenes(
    moments: TablesByCondition, ends: TablesByCondition, frames: TablesByCondition, groups: SceneGroups
) -> pl.DataFrame:
    """Conditions of which the frames, the tracks or the errors are of too few scenes for these to be resampled.

    Parameters
    ----------
    moments
        Those of observations with errors (`has_errors`).
    ends, frames
        Schema `ENDS` and `FRAME_COUNTS`.
    groups
        Groups of scenes that are not independent of each other.

    Returns
    -------
    polars.DataFrame
        Columns `POOLED`: a row for each, sorted.
    """
    few = {key for table in (frames, ends) for key, part in table.items() if _are_few(key, part["scene"], groups)}
    for key, part in moments.items():
        names, populations = part["scene"], part[_OF]
        if any(_are_few(key, names.filter(populations == each), groups) for each in populations.unique()):
            few.add(key)
    return pl.DataFrame(sorted(few), schema={name: ORIGIN[name] for name in POOLED}, orient="row")


def _are_few(condition: Condition, scenes: pl.Series, groups: SceneGroups) -> bool:
    return scheme(groups.of(condition[0], number_names(scenes)[0])) is None
