"""Conditions of so few scenes, or groups of them, that blocks of tracks are resampled within each scene.

A scene counts where it has what is pooled. One whose images show no features has frames only, and a tracker may be
missing in some scenes of a view.
"""

from collections.abc import Iterator

import polars as pl

from tracknoise.findings.sampling.groups import SceneGroups, scheme
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.enumerations import Population
from tracknoise.tables.schema import ORIGIN
from tracknoise.tables.store import RunFolder

_OF = "population"


def has_errors(population: str) -> pl.Expr:
    """Rows of `MOMENTS` and `SCALES` with visible observations, or with those that an experiment is about."""
    return (pl.col("n") > 0) & pl.col(_OF).is_in(sorted({Population.visible, population}))


def conditions_of_few_scenes(run: RunFolder, population: str, groups: SceneGroups) -> pl.DataFrame:
    """Conditions of which the frames, the tracks or the errors are of too few scenes for these to be resampled.

    Parameters
    ----------
    run
        With at least one measured sequence.
    population
        Which observations the experiment is about.
    groups
        Groups of scenes that are not independent of each other.

    Returns
    -------
    polars.DataFrame
        Columns `POOLED`: a row for each.

    Raises
    ------
    StoreError, SchemaError
        If a table is damaged.
    """
    found = pl.concat(_scenes(run, has_errors(population)), how="diagonal").unique(maintain_order=True)
    few = [
        key[: len(POOLED)]
        for key, part in found.partition_by([*POOLED, "of"], as_dict=True).items()
        if scheme(groups.of(key[0], part["scene"].sort().to_list())) is None
    ]
    schema = {name: ORIGIN[name] for name in POOLED}
    return pl.DataFrame(list(dict.fromkeys(few)), schema=schema, orient="row")


def _scenes(run: RunFolder, with_errors: pl.Expr) -> Iterator[pl.DataFrame]:
    """Conditions and scenes of the frames, of the tracks, and of each population of the errors: column of."""
    keys, origin = sorted(run.manifest().sequences), list(ORIGIN)
    for name in ("frames", "ends"):
        for table in run.stacked_tables(name, keys, only=origin):
            yield table.select_seq(*origin, of=pl.lit(name)).unique(maintain_order=True)
    for table in run.stacked_tables("moments", keys, only=[*origin, _OF, "n"]):
        rows = table.filter(with_errors).select_seq(*origin, of=pl.col(_OF).cast(pl.String))
        yield rows.unique(maintain_order=True)
