"""Errors of trackers by poses from one kind of reference tracks alone.

Poses that are refined by tracks may favour trackers that are like these. Reference tracks are of two unlike kinds. A
comparison of trackers is decided where poses by each kind alone say the same.
"""

from dataclasses import replace

import numpy as np
import polars as pl

from tracknoise.measurement.refined_poses import RefinedPoses
from tracknoise.sequences.sequence import Sequence
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.scales import scales
from tracknoise.tables.schema import TruthStatus
from tracknoise.tables.store import KIND_TABLES
from tracknoise.truth.truth import TruePositions
from tracknoise.truth.uncertainty import anchored_points, moved_by


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
    by_kind: dict[str, list[pl.DataFrame]] = {name: [] for name in KIND_TABLES}
    for kind, poses in sequence.by_kind.items():
        error_px = prepared.seen.error_px.copy()
        error_px[rows] -= np.nan_to_num(moved_by(sequence, points, poses))
        seen = replace(prepared.seen, error_px=error_px)
        made = {"moments": scene_moments(seen), "scales": scales(replace(prepared, seen=seen))}
        for name, table in made.items():
            own = table.filter(pl.col("n") > 0, population=population)
            by_kind[f"kind_{name}"].append(own.select(pl.lit(kind).alias("references"), pl.all()))
    return {name: pl.concat(tables) for name, tables in by_kind.items()}
