"""Errors of trackers by poses from one kind of reference tracks alone.

Poses that are refined by tracks may favour trackers that are like these. Reference tracks are of two unlike kinds. A
comparison of trackers is decided where poses by each kind alone say the same.
"""

from collections.abc import Callable, Mapping
from collections.abc import Sequence as Items
from dataclasses import replace

import numpy as np
import polars as pl

from tracknoise.measurement.reference_tracks import KINDS
from tracknoise.measurement.refined_poses import RefinedPoses
from tracknoise.sequences.sequence import Sequence
from tracknoise.statistics.grouping import TablesByCondition, by_condition
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.scales import scales
from tracknoise.tables.schema import TruthStatus
from tracknoise.tables.store import KIND_TABLES, SEQUENCE_TABLES, RunFolder
from tracknoise.truth.truth import TruePositions
from tracknoise.truth.uncertainty import anchored_points, moved_by

KindTables = Mapping[str, Mapping[str, TablesByCondition]]
"""`MOMENTS` and `SCALES` by the kind of reference tracks, by name and by condition."""


def kind_tables(sequence: Sequence, prepared: PreparedSequence, population: str) -> dict[str, pl.DataFrame]:
    """Tables of `KIND_TABLES` of a sequence and one population; none where poses were not refined."""
    if not isinstance(sequence, RefinedPoses) or not sequence.by_kind:
        return {}
    seen, depth_m = prepared.seen, prepared.tracks["depth_m"].to_numpy().astype(np.float64)
    uv = prepared.observations.select("u_px", "v_px").to_numpy() - seen.error_px
    status = np.full(len(uv), TruthStatus.valid, np.int8)
    frame = seen.frame.astype(np.intp)
    positions = TruePositions(uv, status, depth_m)
    rows, points = anchored_points(sequence, frame, prepared.track_row, positions, key_frame=None)
    found: dict[str, list[pl.DataFrame]] = {name: [] for name in KIND_TABLES}
    for kind, poses in sequence.by_kind.items():
        error_px = prepared.seen.error_px.copy()
        error_px[rows] -= np.nan_to_num(moved_by(sequence, points, poses))
        seen = replace(prepared.seen, error_px=error_px)
        made = {"moments": scene_moments(seen), "scales": scales(replace(prepared, seen=seen))}
        for name, table in made.items():
            own = table.filter(pl.col("n") > 0, population=population)
            found[f"kind_{name}"].append(own.select(pl.lit(kind).alias("references"), pl.all()))
    return {name: pl.concat(tables) for name, tables in found.items()}


def read_kind_tables(
    folder: RunFolder,
    keys: Items[str],
    every: Mapping[str, TablesByCondition],
    reduce: Callable[[pl.DataFrame], pl.DataFrame] = lambda table: table,
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

    found = {kind: {name: of(kind, name) for name in every} for kind in KINDS}
    return {
        kind: {name: _completed(table, every[name]) for name, table in tables.items()}
        for kind, tables in found.items()
        if any(tables.values())
    }


def _completed(tables: TablesByCondition, every: TablesByCondition) -> TablesByCondition:
    """Tables of one kind with the rows of scenes that it does not have."""
    found = dict(every)
    for key, table in tables.items():
        there = table["scene"].unique().to_list()
        found[key] = pl.concat([table, every[key].filter(~pl.col("scene").is_in(there))])
    return found
