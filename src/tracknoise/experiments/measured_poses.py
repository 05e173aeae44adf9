"""The poses and depths that led when a sequence was measured, for a sequence that is opened again."""

from collections.abc import Iterable

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.pose import from_quaternion
from tracknoise.measurement.adjusted_depths import depth_corrections
from tracknoise.measurement.refined_poses import RefinedPoses
from tracknoise.sequences.corrected import corrected
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.sequence import Sequence
from tracknoise.tables.manifest import PoseFit, SequenceEntry, joined_fit
from tracknoise.tables.store import RunFolder

Piece = tuple[RunFolder, SequenceEntry, int]
"""The folder and the entry of a measured sequence, or of a part of it, and the first of its frames."""


def with_measured_poses(sequence: Sequence, pieces: Iterable[Piece]) -> Sequence:
    """A sequence as opened, with the refined poses that led when its pieces were measured; itself where none did.

    Refined poses of a part go on from the stated pose of its first frame. No track goes on from part to part. Depths
    are corrected as those of the parts together.
    """
    poses, led = sequence.world_from_camera.copy(), list[PoseFit]()
    for folder, entry, first in pieces:
        if entry.pose_fit is None or not entry.pose_fit.leads:
            continue
        led.append(entry.pose_fit)
        recorded = recorded_poses(folder.sequence_table("poses", entry.key))
        posed = np.flatnonzero(has_pose(recorded))
        poses[first + posed] = recorded[posed]
    fit = joined_fit(led)
    if fit is None:
        return sequence
    with_depths = corrected(sequence, depth_corrections(fit.corrections))
    return RefinedPoses.of(with_depths, poses, joins_depths=fit.joins_depths)


def recorded_poses(table: pl.DataFrame) -> NDArray[np.float64]:
    """(frames, 4, 4) float64, world_from_camera, from the table `poses` of a sequence: NaN where a frame has none."""
    table = table.sort("frame")
    posed = table["qw"].is_not_null().to_numpy()
    rows = table.filter(pl.col("qw").is_not_null())
    poses = np.full((table.height, 4, 4), np.nan)
    xyzw = rows.select("qx", "qy", "qz", "qw").to_numpy()
    poses[posed] = from_quaternion(rows.select("x_m", "y_m", "z_m").to_numpy(), xyzw)
    return poses
