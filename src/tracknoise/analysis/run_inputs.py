"""What analyses of a run are made of: tables of its sequences, read when they are asked for, and tables of the run."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import polars as pl

from tracknoise.analysis.condition_units import Sampling
from tracknoise.analysis.factors import OptionFactor
from tracknoise.inference.units import SceneGroups, scheme
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Condition, TablesByCondition, by_condition, number_names, without_blocks
from tracknoise.statistics.yardstick import ReferenceCondition
from tracknoise.tables.enumerations import Population, Trimming
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.run_table import RunTable
from tracknoise.tables.schema import ENDS, ORIGIN, VIEW
from tracknoise.tables.store import SEQUENCE_TABLES, RunFolder
from tracknoise.tables.truth_audit import AuditTables

KindTables = Mapping[str, Mapping[str, TablesByCondition]]
"""`MOMENTS` and `SCALES` by the kind of reference tracks, by name and by condition."""
Reduce = Callable[[pl.DataFrame], pl.DataFrame]
_OF = "population"


@dataclass(frozen=True)
class RunInputs:
    """A run, what was asked of it, and the tables of the run that were made so far.

    Tables of sequences that several analyses need are in memory together and grow with the number of sequences. Each is
    therefore reduced as it is read, and kept by condition, so that no analysis needs a copy of all of it.

    A scene counts where it has what is pooled. One whose images show no features has frames only, and a tracker may be
    missing in some scenes of a view.

    Attributes
    ----------
    run
        Its folder.
    reference
        The view and the speed that are shown, and where errors are zero.
    sampling
        How scenes are resampled.
    population, trimming
        The observations and the errors that the experiment is about.
    min_features
        Curves are cut where fewer features remain.
    margin
        Relative effect above which a factor counts.
    seeds
        Random seeds that each scene was measured with.
    trackers
        Names, in the order of the experiment.
    options
        Options by which trackers of one kind differ.
    kinds
        Kinds of reference tracks.
    audit, assess
        Audit the truth of the run, and give the verdict on it, from these inputs.
    made
        Tables of the run.
    """

    run: RunFolder
    reference: ReferenceCondition
    sampling: Sampling
    population: Population
    trimming: Trimming
    min_features: int
    margin: float
    seeds: int
    trackers: Sequence[str]
    options: Sequence[OptionFactor]
    kinds: Sequence[str]
    audit: Callable[[], AuditTables]
    assess: Callable[["RunInputs"], pl.DataFrame]
    made: dict[RunTable, pl.DataFrame] = field(default_factory=dict)

    def __getitem__(self, table: RunTable) -> pl.DataFrame:
        return self.made[table]

    @property
    def named(self) -> dict[str, pl.DataFrame]:
        """Tables of the run by their names."""
        return {table.name: rows for table, rows in self.made.items()}

    @property
    def key_frames(self) -> Mapping[str, int]:
        """Frames in which errors are zero, by direction."""
        return self.reference.key_frames

    @cached_property
    def keys(self) -> list[str]:
        """Keys of the measured sequences."""
        return sorted(self.run.manifest().sequences)

    @cached_property
    def _shown(self) -> list[str]:
        """Keys of the sequences of the reference view."""
        entries = self.run.manifest().sequences
        return [key for key in self.keys if _is_seen(entries[key].sequence, self.reference)]

    @cached_property
    def moments(self) -> TablesByCondition:
        """Of the visible observations, and of those that the experiment is about."""
        return self._read("moments", self.keys, lambda table: table.filter(has_errors(self.population)))

    @cached_property
    def scales(self) -> TablesByCondition:
        """Of the same."""
        return self._read("scales", self.keys, lambda table: table.filter(has_errors(self.population)))

    @cached_property
    def frames(self) -> TablesByCondition:
        """Counts of all frames."""
        return self._read("frames", self.keys)

    @cached_property
    def _ends_by_block(self) -> TablesByCondition:
        return self._read("ends", self.keys)

    @cached_property
    def ends(self) -> TablesByCondition:
        """Ends of tracks: by block where scenes are few, otherwise of all blocks together, as block 0."""
        by_block = set(self.few.rows())
        return {
            key: part if key in by_block else without_blocks(part, [*ORIGIN, "lifetime"], ENDS)
            for key, part in self._ends_by_block.items()
        }

    @cached_property
    def few(self) -> pl.DataFrame:
        """Conditions whose scenes are too few to be resampled (`conditions_of_few_scenes`)."""
        return conditions_of_few_scenes(self.moments, self._ends_by_block, self.frames, self.sampling.groups)

    @cached_property
    def blocks(self) -> TablesByCondition:
        """Moments by block, where scenes are few."""
        return self._read("blocks", self.keys if self.few.height else [], self._of_few)

    @cached_property
    def scale_blocks(self) -> TablesByCondition:
        """Scales by block, where scenes are few."""
        return self._read("scale_blocks", self.keys if self.few.height else [], self._of_few)

    @cached_property
    def aspect_blocks(self) -> TablesByCondition:
        """Aspects by block of the reference view at the lowest speed, where scenes are few."""
        keys = self._shown if self.few.height else []
        return self._read("aspect_blocks", keys, lambda table: self._of_few(table.filter(self._is_slowest)))

    @cached_property
    def changes(self) -> TablesByCondition:
        """Changes of errors in the reference view at the lowest speed."""
        return self._read("increments", self._shown, lambda table: table.filter(self._is_slowest))

    def aspects(self, *chosen: pl.Expr) -> Iterator[pl.DataFrame]:
        """Aspects of errors in the reference view at the lowest speed, one sequence at a time."""
        return (self.run.rows("aspects", key, self._is_slowest, *chosen) for key in self._shown)

    @cached_property
    def by_kind(self) -> KindTables:
        """Moments and scales by each kind of reference tracks alone."""
        return read_kind_tables(self.run, self.keys, {"moments": self.moments, "scales": self.scales}, self.kinds)

    @property
    def intervals(self) -> dict[str, Any]:
        """How intervals are made: kind, level and groups of scenes."""
        return {"kind": self.sampling.kind, "level": self.sampling.level, "groups": self.sampling.groups}

    @property
    def _is_slowest(self) -> pl.Expr:
        return pl.col("speed") == self.reference.speed

    def _of_few(self, table: pl.DataFrame) -> pl.DataFrame:
        return table.join(self.few, on=POOLED, how="semi", maintain_order="left")

    def _read(self, name: str, keys: Sequence[str], reduce: Reduce = lambda table: table) -> TablesByCondition:
        return by_condition(self.run.stacked_tables(name, keys), SEQUENCE_TABLES[name], name, reduce)


def has_errors(population: str) -> pl.Expr:
    """Rows of `MOMENTS` and `SCALES` with visible observations, or with those that an experiment is about."""
    return (pl.col("n") > 0) & pl.col(_OF).is_in(sorted({Population.visible, population}))


def conditions_of_few_scenes(
    moments: TablesByCondition, ends: TablesByCondition, frames: TablesByCondition, groups: SceneGroups
) -> pl.DataFrame:
    """Conditions of which the frames, the tracks or the errors are of too few scenes for these to be resampled.

    Blocks of tracks are resampled within each of their scenes, or groups of them.

    Returns: columns `POOLED`: a row for each, sorted. `ends, frames`: schema `ENDS` and `FRAME_COUNTS`.
    """
    few = {key for table in (frames, ends) for key, part in table.items() if _are_few(key, part["scene"], groups)}
    for key, part in moments.items():
        names, populations = part["scene"], part[_OF]
        if any(_are_few(key, names.filter(populations == each), groups) for each in populations.unique()):
            few.add(key)
    return pl.DataFrame(sorted(few), schema={name: ORIGIN[name] for name in POOLED}, orient="row")


def _are_few(condition: Condition, scenes: pl.Series, groups: SceneGroups) -> bool:
    return scheme(groups.of(condition[0], number_names(scenes)[0])) is None


def _is_seen(sequence: SequenceId, reference: ReferenceCondition) -> bool:
    return all(getattr(sequence, name) == getattr(reference, name) for name in VIEW)


def read_kind_tables(
    folder: RunFolder,
    keys: Sequence[str],
    every: Mapping[str, TablesByCondition],
    kinds: Sequence[str],
    reduce: Reduce = lambda table: table,
) -> KindTables:
    """Moments and scales of some sequences of a run by each kind of reference tracks alone; none without any.

    `every`: the same by poses of all reference tracks, which count where poses were not refined. `reduce`: as of
    `by_condition`.
    """
    entries = folder.manifest().sequences

    def of(kind: str, name: str) -> TablesByCondition:
        stored = f"kind_{name}"
        tables = folder.stacked_tables(stored, [key for key in keys if stored in entries[key].sha256])
        own = (table.filter(references=kind).drop("references") for table in tables)
        return by_condition(own, SEQUENCE_TABLES[name], name, reduce)

    by_kind = {kind: {name: of(kind, name) for name in every} for kind in kinds}
    return {
        kind: {name: _completed(table, every[name]) for name, table in tables.items()}
        for kind, tables in by_kind.items()
        if any(tables.values())
    }


def _completed(tables: TablesByCondition, every: TablesByCondition) -> TablesByCondition:
    """Tables of one kind with the rows of scenes that it does not have."""
    completed = dict(every)
    for key, table in tables.items():
        there = table["scene"].unique().to_list()
        completed[key] = pl.concat([table, every[key].filter(~pl.col("scene").is_in(there))])
    return completed
