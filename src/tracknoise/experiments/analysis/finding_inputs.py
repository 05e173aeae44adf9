"""Inputs of the findings: the part of the tables of all sequences that they need."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import polars as pl

from tracknoise.experiments.analysis.few_scenes import conditions_of_few_scenes, has_errors
from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.statistics.conditions import TablesByCondition, by_condition
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.factors.factors import ReferenceCondition
from tracknoise.statistics.grouping import group_rows
from tracknoise.statistics.tracks.lifetimes import COUNTS
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import Manifest
from tracknoise.tables.schema import ENDS, ORIGIN, VIEW
from tracknoise.tables.store import SEQUENCE_TABLES, RunFolder

Reduce = Callable[[pl.DataFrame], pl.DataFrame]


@dataclass(frozen=True, slots=True)
class FindingInputs:
    """Tables of all sequences of a run.

    Tables that several findings need are in memory together and grow with the number of sequences. Each is therefore
    reduced as it is read, and kept by condition, so that no finding needs a copy of all of it.

    Attributes
    ----------
    few
        Conditions whose scenes are too few to be resampled (`conditions_of_few_scenes`).
    moments, scales
        Of the visible observations, and of those that the experiment is about.
    aspects, changes
        Of the reference view at the lowest speed, which figures show; aspects are read on demand, once.
    aspect_blocks
        Of these, where scenes are too few to be resampled.
    blocks, scale_blocks
        Where they are.
    ends
        By block there, otherwise of all blocks together, as block 0.
    frames
        All.
    groups
        Groups of scenes that are not independent of each other.
    """

    few: pl.DataFrame
    moments: TablesByCondition
    scales: TablesByCondition
    aspects: Iterator[pl.DataFrame]
    changes: TablesByCondition
    aspect_blocks: TablesByCondition
    blocks: TablesByCondition
    scale_blocks: TablesByCondition
    ends: TablesByCondition
    frames: TablesByCondition
    groups: SceneGroups

    @classmethod
    def read(
        cls,
        run: RunFolder,
        manifest: Manifest,
        population: str,
        reference: ReferenceCondition,
        groups: SceneGroups,
    ) -> "FindingInputs":
        """Read them from a run.

        Parameters
        ----------
        run
            Whose tables are read.
        manifest
            Its manifest, with at least one measured sequence.
        population
            Which observations the experiment is about.
        reference
            The condition that figures show.
        groups
            Groups of scenes that are not independent of each other.

        Raises
        ------
        StoreError, SchemaError
            If a table is damaged.
        """
        every = sorted(manifest.sequences)
        shown = [key for key in every if _is_seen(manifest.sequences[key].sequence, reference)]
        seen, slowest = has_errors(population), pl.col("speed") == reference.speed

        def read(name: str, keys: list[str], reduce: Reduce = lambda table: table) -> TablesByCondition:
            return by_condition(run.stacked_tables(name, keys), SEQUENCE_TABLES[name], name, reduce)

        moments = read("moments", every, lambda table: table.filter(seen))
        ends, frames = read("ends", every), read("frames", every)
        few = conditions_of_few_scenes(moments, ends, frames, groups)
        with_blocks = (every, shown) if few.height else ([], [])
        return cls(
            few=few,
            moments=moments,
            scales=read("scales", every, lambda table: table.filter(seen)),
            aspects=(run.sequence_table("aspects", key).filter(slowest) for key in shown),
            changes=read("increments", shown, lambda table: table.filter(slowest)),
            aspect_blocks=read("aspect_blocks", with_blocks[1], lambda table: _of(few, table.filter(slowest))),
            blocks=read("blocks", with_blocks[0], lambda table: _of(few, table)),
            scale_blocks=read("scale_blocks", with_blocks[0], lambda table: _of(few, table)),
            ends=_of_all_blocks(ends, few),
            frames=frames,
            groups=groups,
        )


def _is_seen(sequence: SequenceId, reference: ReferenceCondition) -> bool:
    return all(getattr(sequence, name) == getattr(reference, name) for name in VIEW)


def _of(conditions: pl.DataFrame, table: pl.DataFrame) -> pl.DataFrame:
    return table.join(conditions, on=POOLED, how="semi", maintain_order="left")


def _of_all_blocks(ends: TablesByCondition, few: pl.DataFrame) -> TablesByCondition:
    """Counts by block where scenes are few, otherwise of all blocks together."""
    by_block = set(few.rows())
    return {key: part if key in by_block else _added_up(part) for key, part in ends.items()}


def _added_up(ends: pl.DataFrame) -> pl.DataFrame:
    """Counts of all blocks together, as block 0; null where one of them is."""
    groups = group_rows(ends, [*ORIGIN, "lifetime"])
    table = groups.keys.hstack(groups.sums(ends, COUNTS).fill_nan(None))
    return table.select_seq(
        (pl.lit(0) if name == "block" else pl.col(name)).cast(kind).alias(name) for name, kind in ENDS.items()
    )
