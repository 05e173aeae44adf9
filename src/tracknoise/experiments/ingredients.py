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
    aspects
        Of the reference view, where scenes are enough to be resampled.
    blocks
        Where they are not.
    ends
        By block there, otherwise of all blocks together, as block 0.
    frames
        All.
    """

    moments: pl.DataFrame
    aspects: pl.DataFrame
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
        frames = pl.concat(run.sequence_tables("frames"))
        few = frames.group_by(POOLED).agg(n=pl.col("scene").n_unique()).filter(pl.col("n") < MIN_SCENES).drop("n")
        seen = (pl.col("n") > 0) & pl.col("population").is_in(sorted({"visible", population}))
        shown = {name: getattr(view, name) for name in VIEW}

        def read(name: str, reduce: Callable[[pl.DataFrame], pl.DataFrame]) -> pl.DataFrame:
            return reduce_each(run.sequence_tables(name), SEQUENCE_TABLES[name], name, reduce)

        return cls(
            moments=read("moments", lambda table: table.filter(seen)),
            aspects=read("aspects", lambda table: table.filter(**shown).join(few, on=POOLED, how="anti")),
            blocks=read("blocks", lambda table: table.join(few, on=POOLED, how="semi", maintain_order="left")),
            ends=read("ends", lambda table: _ends(table, few)),
            frames=frames,
        )


def _ends(ends: pl.DataFrame, few: pl.DataFrame) -> pl.DataFrame:
    by_block = ends.join(few, on=POOLED, how="semi")
    together = ends.join(few, on=POOLED, how="anti").with_columns(block=pl.lit(0, dtype=pl.UInt8))
    key = [*ORIGIN, "block", "lifetime"]
    return pl.concat([by_block, together]).group_by(key).agg(pl.col("n_ended", "n_censored").sum()).sort(key)
