"""Tables of estimates with their intervals, in which each condition has rows of its own."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import polars as pl

from tracknoise.findings.estimate import EstimateArray
from tracknoise.findings.sampling.bounds import Method
from tracknoise.findings.sampling.draws import N_DRAWS, Draws, draws_by_dataset
from tracknoise.findings.sampling.groups import NO_GROUPS, SceneGroups
from tracknoise.findings.sampling.units import Units
from tracknoise.statistics.conditions import TablesByCondition, names, scenes_by_dataset
from tracknoise.tables.defaults import KIND_OF_INTERVAL, LEVEL
from tracknoise.tables.enumerations import IntervalKind
from tracknoise.tables.schema import Schema, empty

_NUMBERS = ("low", "high", "n_units", "n_scenes")


@dataclass(frozen=True, slots=True)
class Sampling:
    """How the scenes of every condition are resampled.

    Parameters
    ----------
    kind, level
        As in `tracknoise.findings.sampling.bounds.Method`.
    groups
        Groups of scenes that are not independent of each other.
    n_draws, seed
        As in `tracknoise.findings.sampling.draws.draws`; Student's intervals need no draws.
    """

    kind: str = KIND_OF_INTERVAL
    level: float = LEVEL
    groups: SceneGroups = NO_GROUPS
    n_draws: int = N_DRAWS
    seed: int = 0

    def draws(self, scenes: Mapping[str, Iterable[str]]) -> dict[str, Draws]:
        """Draws of the scenes of each dataset."""
        return draws_by_dataset(scenes, n_draws=self.n_draws, seed=self.seed, groups=self.groups)


USUAL = Sampling()
"""Student's intervals over independent scenes."""


def condition_table(
    conditions: TablesByCondition,
    schema: Schema,
    rows: Callable[[pl.DataFrame, Draws, Method], pl.DataFrame],
    sampling: Sampling,
) -> pl.DataFrame:
    """Rows of every condition that has a table, with its names, in columns of a schema; not sorted.

    Parameters
    ----------
    conditions
        Table of each condition.
    schema
        Columns of the result.
    rows
        Makes the rows of a condition, but for its names.
    sampling
        How scenes are resampled.

    Raises
    ------
    SettingsError
        If there is no such kind, or the level is not between 0 and 1.
    """
    method = Method(sampling.kind, sampling.level)
    needed = sampling if method.kind != IntervalKind.student else replace(sampling, n_draws=0)
    drawn = needed.draws(scenes_by_dataset(conditions.items()))
    parts = [
        rows(part, drawn[key[0]], method).with_columns_seq(names(key, schema))
        for key, part in conditions.items()
        if part.height
    ]
    typed = [part.select_seq(pl.col(name).cast(kind) for name, kind in schema.items()) for part in parts]
    return pl.concat([empty(schema), *typed])


def estimated(labels: pl.DataFrame, found: EstimateArray, units: Units, schema: Schema, *, value: str) -> pl.DataFrame:
    """Labels with the estimates that they are of, in a column named `value`, their bounds, and how these were made."""
    columns = {value: "value", **{name: name for name in _NUMBERS}}
    numbers = pl.DataFrame({name: getattr(found, source).ravel() for name, source in columns.items()})
    made = {"kind": found.kind, "level": found.level, "resampled": units.resampled}
    return labels.hstack(numbers).with_columns_seq(
        pl.lit(text, dtype=schema[name]).alias(name) for name, text in made.items()
    )
