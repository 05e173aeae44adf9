"""Recorded poses with times of their own, and the poses of images between them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.interpolation import interpolate_poses
from tracknoise.sequences.poses import quaternion_poses
from tracknoise.sequences.timed.order import in_order, order_notes


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
    """Make a trajectory from the rows of a file. Rows whose whole pose is NaN hold no pose.

    Parameters
    ----------
    path
        The file.
    times_s
        (n,) float64, seconds, in any order.
    pose_rows
        (n, 7) float64: position, metres, and quaternion, scalar last.
    places
        n times ``file:line``.

    Raises
    ------
    DataError
        Naming the first row that is no pose; or if there is none.
    """
    known = np.flatnonzero(~np.isnan(pose_rows).all(axis=1))
    if not len(known):
        raise DataError(path, "no poses", "rows of a time and a pose")
    times_s, pose_rows, places = times_s[known], pose_rows[known], [places[index] for index in known]
    poses = quaternion_poses(pose_rows[:, :3], pose_rows[:, 3:], places)
    order = in_order(times_s)
    return Trajectory(path, times_s[order], poses[order], order_notes(path, times_s))


def poses_at(
    recorded: Trajectory, at_s: NDArray[np.float64], *, max_gap_s: float
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Poses at the times of images.

    Parameters
    ----------
    recorded
        In the same clock.
    at_s
        (m,) float64, seconds.
    max_gap_s
        See `tracknoise.geometry.interpolation.interpolate_poses`.

    Returns
    -------
    poses : (m, 4, 4) float64
        NaN where there is no pose.
    notes : tuple of str
        Those of the trajectory, and a sentence if some images have no pose.

    Raises
    ------
    DataError
        If no image has a pose.
    """
    poses = interpolate_poses(recorded.times_s, recorded.poses, at_s, max_gap_s=max_gap_s)
    missing = int(np.isnan(poses[:, 0, 0]).sum())
    if missing == len(at_s):
        raise DataError(recorded.path, _no_overlap(recorded.times_s, at_s, max_gap_s), "poses at the times of images")
    gap = f"{missing} of {len(at_s)} frames have no pose: none was recorded around them within {max_gap_s:g} s"
    return poses, (*recorded.notes, *((gap,) if missing else ()))


def _no_overlap(times_s: NDArray[np.float64], at_s: NDArray[np.float64], max_gap_s: float) -> str:
    first_s, last_s = times_s[0] - at_s[0], times_s[-1] - at_s[0]
    length_s = at_s[-1] - at_s[0]
    return (
        f"poses from {first_s:.3f} s to {last_s:.3f} s after the first image, where images end after {length_s:.3f} s "
        f"(poses at most {max_gap_s:g} s apart are interpolated)"
    )
