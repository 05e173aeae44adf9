"""Recordings whose images, depths and poses have times of their own: their order, and poses between those recorded."""

from collections.abc import Sequence as Items
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, NothingToMeasureError
from tracknoise.geometry.pose import PosePath, interpolate_poses
from tracknoise.sequences.poses import quaternion_poses, require_some_poses
from tracknoise.text import counted_of


class PosesOf(StrEnum):
    """What the poses of a recording are poses of."""

    camera = "camera"
    body = "body"


def in_order(times: NDArray[np.float64] | NDArray[np.int64]) -> NDArray[np.intp]:
    """(k,) intp: indices of rows in order of time; of rows that have the same time, the first."""
    indices: NDArray[np.intp] = np.unique(times, return_index=True)[1]
    return indices


def order_notes(path: Path, times: NDArray[np.float64] | NDArray[np.int64]) -> tuple[str, ...]:
    """Sentences on rows that `in_order` moves or leaves out."""
    repeated = len(times) - len(np.unique(times))
    notes = []
    if np.any(np.diff(times) < 0):
        notes.append(f"{path}: the rows are not in order of time, so they were sorted")
    if repeated:
        repeat = counted_of(repeated, len(times), "row", "repeats", "repeat")
        are = "is" if repeated == 1 else "are"
        notes.append(f"{path}: {repeat} the time of an earlier row and {are} ignored")
    return tuple(notes)


_MOST_REPEATED = 0.5


def require_distinct(path: Path, times: NDArray[np.float64] | NDArray[np.int64], contents: Items[object]) -> None:
    """Refuse a file of which half of the rows repeat the time of an earlier row, with another content.

    Their times have lost digits. Rows that are written twice do no harm.

    Parameters
    ----------
    path
        The file.
    times
        (n,) times of its rows.
    contents
        n contents that can be compared, such as names of files.
    """
    first: dict[float, object] = {}
    n_changed = sum(
        first.setdefault(time, content) != content for time, content in zip(times.tolist(), contents, strict=True)
    )
    if n_changed >= max(_MOST_REPEATED * len(times), 2):
        repeat = counted_of(n_changed, len(times), "row", "repeats", "repeat")
        raise DataError(path, f"{repeat} the time of an earlier row", "times with all their digits, one for each row")


_BEYOND_S = 1.0
"""How far beyond the ends of a trajectory a path says that there is no pose. Any time would do."""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses in order of time.

    Parameters
    ----------
    path
        The file that they are from.
    times_s
        (n,) float64, seconds, increasing.
    poses
        (n, 4, 4) float64, rigid.
    notes
        What was corrected, one sentence each.
    """

    path: Path
    times_s: NDArray[np.float64]
    poses: NDArray[np.float64]
    notes: tuple[str, ...] = ()


def trajectory(
    path: Path, times_s: NDArray[np.float64], pose_rows: NDArray[np.float64], places: list[str]
) -> Trajectory:
    """Make a trajectory from the rows of a file. Rows whose pose is all NaN, or whose quaternion is 0, hold no pose.

    Shapes: times_s (n,), pose_rows (n, 7).
    """
    posed = np.flatnonzero(~(np.isnan(pose_rows).all(axis=1) | (pose_rows[:, 3:] == 0.0).all(axis=1)))
    if not len(posed):
        raise DataError(path, "no poses", "rows of a time and a pose")
    lost = len(pose_rows) - len(posed)
    hold = counted_of(lost, len(pose_rows), "row", "holds", "hold")
    lost_notes = (f"{path}: {hold} no pose (NaN or a quaternion of 0)",) * (lost > 0)
    times_s, pose_rows, places = times_s[posed], pose_rows[posed], [places[index] for index in posed]
    require_distinct(path, times_s, list(map(tuple, pose_rows.tolist())))
    poses = quaternion_poses(pose_rows[:, :3], pose_rows[:, 3:], places)
    order = in_order(times_s)
    notes = *lost_notes, *order_notes(path, times_s), *_contradictions(path, times_s, pose_rows[:, :3])
    return Trajectory(path, times_s[order], poses[order], notes)


_ALIKE_M = 1e-3


def _contradictions(path: Path, times_s: NDArray[np.float64], positions: NDArray[np.float64]) -> tuple[str, ...]:
    """A sentence where rows of one time have positions, (n, 3), that differ by more than rounding."""
    _, first, of_row = np.unique(times_s, return_index=True, return_inverse=True)
    apart_m = float(np.linalg.norm(positions - positions[first[of_row]], axis=1).max())
    return (f"{path}: rows of one time have positions up to {apart_m:.3g} m apart",) * (apart_m > _ALIKE_M)


def poses_at(
    recorded: Trajectory, at_s: NDArray[np.float64], *, max_gap_s: float
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Poses at the times of images.

    Shapes: at_s (m,); returns poses (m, 4, 4). `poses`: NaN where there is no pose. `notes`: those of the trajectory,
    and a sentence if some images have no pose.
    """
    poses = interpolate_poses(recorded.times_s, recorded.poses, at_s, max_gap_s=max_gap_s)
    missing = int(np.isnan(poses[:, 0, 0]).sum())
    if missing == len(at_s):
        found = "; ".join((_no_overlap(recorded.times_s, at_s, max_gap_s), *recorded.notes))
        raise DataError(recorded.path, found, "poses at the times of images")
    try:
        require_some_poses(poses, recorded.path)
    except NothingToMeasureError as error:
        found = "; ".join((error.found, _no_overlap(recorded.times_s, at_s, max_gap_s), *recorded.notes))
        raise NothingToMeasureError(error.place, found, error.expected) from error
    have, them = counted_of(missing, len(at_s), "frame", "has", "have"), "it" if missing == 1 else "them"
    gap = f"{have} no pose: none was recorded around {them} within {max_gap_s:g} s"
    return poses, (*recorded.notes, *((gap,) if missing else ()))


def path_through(
    times_s: NDArray[np.float64], poses: NDArray[np.float64], recorded: PosePath, *, max_gap_s: float
) -> PosePath:
    """Camera poses at any time: those of the frames, and between them those that were recorded.

    Shapes: times_s (n,), poses (n, 4, 4).
    """
    gaps = np.flatnonzero(np.diff(recorded.times) > max_gap_s)
    between_s = (recorded.times[gaps] + recorded.times[gaps + 1]) / 2
    nowhere_s = np.concatenate((recorded.times[:1] - _BEYOND_S, between_s, recorded.times[-1:] + _BEYOND_S))
    nowhere = np.full((len(nowhere_s), 4, 4), np.nan)
    all_s, first = np.unique(np.concatenate((times_s, recorded.times, nowhere_s)), return_index=True)
    return PosePath(all_s, np.concatenate((poses, recorded.poses, nowhere))[first])


def _no_overlap(times_s: NDArray[np.float64], at_s: NDArray[np.float64], max_gap_s: float) -> str:
    first_s, last_s = times_s[0] - at_s[0], times_s[-1] - at_s[0]
    length_s = at_s[-1] - at_s[0]
    return (
        f"poses from {first_s:.3f} s to {last_s:.3f} s after the first image, where images end after {length_s:.3f} s "
        f"(poses at most {max_gap_s:g} s apart are interpolated)"
    )
