"""What findings are made from: of the tables of single sequences, the part that is needed, all sequences together."""

from collections.abc import Callable
from dataclasses import dataclass

import polars as pl

from tracknoise.findings.sampling.resampling import MIN_SCENES
from tracknoise.statistics.effects import Reference
from tracknoise.statistics.grouping import POOLED, reduce_each
from tracknoise.tables.schema import ORIGIN, VIEW
from tracknoise.tables.store import SEQUENCE_TABLES, RunFolder


@dataclass(frozen=True, slots=True)
class Ingredients:
    """Tables of all sequences of a run.

    They are held in memory together and grow with the count of sequences, so that each is cut down as it is read.

    Attributes
    ----------
    moments
        Of the visible observations, and of those that the experiment is about.
    aspects, changes
        Of the reference view at the lowest speed, which figures show.
    aspect_blocks
        Of these, where scenes are too few to be resampled.
    blocks
        Where they are.
    ends
        By block there, otherwise of all blocks together, as block 0.
    frames
        All.
    """

    moments: pl.DataFrame
    aspects: pl.DataFrame
    changes: pl.DataFrame
    aspect_blocks: pl.DataFrame
    blocks: pl.DataFrame
    ends: pl.DataFrame
    frames: pl.DataFrame

    @classmethod
    def read(cls, run: RunFolder, population: str, view: Reference) -> "Ingredients":
        """Read them from a run.

        Parameters
        ----------
        run
            With at least one measured sequence.
        population
            Which observations the experiment is about.
        view
            Which view figures are about.

        Raises
        ------
        StoreError, SchemaError
            If a table is damaged.
        """
        entries = run.manifest().sequences
        every = sorted(entries)
        shown = [key for key in every if all(getattr(entries[key], name) == getattr(view, name) for name in VIEW)]
        slowest = pl.col("speed") == view.speed

        def read(name: str, keys: list[str], reduce: Callable[[pl.DataFrame], pl.DataFrame]) -> pl.DataFrame:
            tables = (run.sequence_table(name, key) for key in keys)
            return reduce_each(tables, SEQUENCE_TABLES[name], name, reduce)

        seen = (pl.col("n") > 0) & pl.col("population").is_in(sorted({"visible", population}))
        frames = read("frames", every, lambda table: table)
        few = frames.group_by(POOLED).agg(n=pl.col("scene").n_unique()).filter(pl.col("n") < MIN_SCENES).drop("n")
        return cls(
            moments=read("moments", every, lambda table: table.filter(seen)),
            aspects=read("aspects", shown, lambda table: table.filter(slowest)),
            changes=read("increments", shown, lambda table: table.filter(slowest)),
            aspect_blocks=read(
                "aspect_blocks", [] if few.is_empty() else shown, lambda table: _of(few, table.filter(slowest))
            ),
            blocks=read("blocks", [] if few.is_empty() else every, lambda table: _of(few, table)),
            ends=read("ends", every, lambda table: _ends(table, few)),
            frames=frames,
        )


def _of(conditions: pl.DataFrame, table: pl.DataFrame) -> pl.DataFrame:
    return table.join(conditions, on=POOLED, how="semi", maintain_order="left")


def _ends(ends: pl.DataFrame, few: pl.DataFrame) -> pl.DataFrame:
    """Counts by block where scenes are few, otherwise of all blocks together."""
    key = [*ORIGIN, "block", "lifetime"]
    marked = ends.join(few.with_columns(is_few=pl.lit(value=True)), on=POOLED, how="left")
    named = marked.with_columns(block=pl.when("is_few").then("block").otherwise(pl.lit(0, dtype=pl.UInt8)))
    return named.group_by(key).agg(pl.col("n_ended", "n_censored").sum()).sort(key)
