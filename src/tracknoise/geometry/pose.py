"""Rigid transforms as 4x4 matrices, poses between those that were recorded, and the nearest of other times.

Transforms are named ``target_from_source``.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation


def from_rotation(rotation: NDArray[np.float64], translation_m: ArrayLike) -> NDArray[np.float64]:
    """(..., 4, 4) float64: poses from rotation matrices (..., 3, 3) and translations (..., 3), metres."""
    poses = np.zeros((*rotation.shape[:-2], 4, 4))
    poses[..., :3, :3] = rotation
    poses[..., :3, 3] = translation_m
    poses[..., 3, 3] = 1.0
    return poses


def from_quaternion(translation_m: NDArray[np.float64], xyzw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Poses from translations and unit quaternions.

    Parameters
    ----------
    translation_m
        (n, 3) float64, metres.
    xyzw
        (n, 4) float64, quaternions with the scalar last; normalised here.

    Returns
    -------
    (n, 4, 4) float64

    Raises
    ------
    ValueError
        If a quaternion has norm zero.
    """
    if not len(xyzw):
        return np.empty((0, 4, 4))
    return from_rotation(Rotation.from_quat(xyzw).as_matrix(), translation_m)


def position_rows(poses: NDArray[np.float64], *, canonical: bool = True) -> NDArray[np.float64]:
    """Poses as positions and unit quaternions: the inverse of `from_quaternion`.

    Parameters
    ----------
    poses
        (n, 4, 4) float64, rigid, or all NaN where there is no pose.
    canonical
        Whether the scalar of each quaternion is made positive; otherwise its sign is arbitrary.

    Returns
    -------
    (n, 7) float64
        x, y, z in metres, then qx, qy, qz, qw; NaN where there is no pose.
    """
    rows = np.full((len(poses), 7), np.nan)
    posed = np.isfinite(poses).all(axis=(1, 2))
    if posed.any():
        quaternions = Rotation.from_matrix(poses[posed, :3, :3]).as_quat(canonical=canonical)
        rows[posed] = np.hstack([poses[posed, :3, 3], quaternions])
    return rows


def invert(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of rigid transforms.

    Parameters
    ----------
    poses
        (..., 4, 4) float64, rigid.

    Returns
    -------
    (..., 4, 4) float64
    """
    inverse = np.zeros_like(poses)
    rotation = np.swapaxes(poses[..., :3, :3], -1, -2)
    inverse[..., :3, :3] = rotation
    inverse[..., :3, 3] = -np.einsum("...ij,...j->...i", rotation, poses[..., :3, 3])
    inverse[..., 3, 3] = 1.0
    return inverse


def transform(pose: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move points by rigid transforms: ``p_target = target_from_source @ p_source``.

    Parameters
    ----------
    pose
        (4, 4) for all points, or (n, 4, 4) for one each, float64.
    points
        (n, 3) float64, metres.

    Returns
    -------
    (n, 3) float64
    """
    if pose.ndim == 2:
        moved: NDArray[np.float64] = points @ pose[:3, :3].T + pose[:3, 3]
        return moved
    moved_each: NDArray[np.float64] = np.einsum("nij,nj->ni", pose[:, :3, :3], points) + pose[:, :3, 3]
    return moved_each


def first_visits(poses: NDArray[np.float64]) -> NDArray[np.intp]:
    """Frame in which the camera was first exactly where it is in each frame, as in a recording that repeats itself.

    Parameters
    ----------
    poses
        (n, ...) float64: one of each frame; NaN where there is none.

    Returns
    -------
    (n,) intp
        The frame itself where its pose is new or unknown, or the camera has not left it since it was new.
    """
    frames, rows = np.arange(len(poses)), poses.reshape(len(poses), int(np.prod(poses.shape[1:])))
    posed = np.isfinite(rows).all(axis=1)
    rows = np.nan_to_num(rows) + 0.0  # -0 is 0
    starts = np.flatnonzero(np.append(True, (rows[1:] != rows[:-1]).any(axis=1))[: len(rows)])
    stay = np.searchsorted(starts, frames, side="right") - 1
    first, code = np.unique(rows[starts], axis=0, return_index=True, return_inverse=True)[1:]
    earlier = first[code.ravel()]
    return np.asarray(np.where(posed & (earlier[stay] < stay), starts[earlier[stay]], frames), dtype=np.intp)


def nearest_rigid(poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Replace each rotation block by the nearest rotation (orthogonal Procrustes, Frobenius norm).

    Parameters
    ----------
    poses
        (n, 4, 4) float64, finite.

    Returns
    -------
    poses : (n, 4, 4) float64
        With exact rotations.
    correction : (n,) float64
        Largest absolute change of an entry of each rotation block, no unit.
    """
    u, _, vt = np.linalg.svd(poses[:, :3, :3])
    u[:, :, -1] *= np.sign(np.linalg.det(u @ vt))[:, None]
    rigid = poses.copy()
    rigid[:, :3, :3] = u @ vt
    rigid[:, 3] = (0.0, 0.0, 0.0, 1.0)
    return rigid, np.abs(rigid - poses)[:, :3, :3].max(axis=(1, 2), initial=0.0)


def interpolate_poses(
    times_s: NDArray[np.float64], poses: NDArray[np.float64], at_s: NDArray[np.float64], *, max_gap_s: float
) -> NDArray[np.float64]:
    """Interpolate between the two poses around each time: linear in position, spherically linear in rotation.

    Parameters
    ----------
    times_s
        (n,) float64, seconds, increasing.
    poses
        (n, 4, 4) float64, rigid; all NaN where there is no pose. These are left out, as if their times were not given.
    at_s
        (m,) float64, seconds, in any order.
    max_gap_s
        Longest time between two poses that are interpolated, seconds. A time that equals that of a pose has this pose.

    Returns
    -------
    (m, 4, 4) float64
        NaN for times before the first pose, after the last, or in a longer gap.

    Raises
    ------
    ValueError
        If `times_s` do not increase.
    """
    if not np.all(np.diff(times_s) > 0.0):
        raise ValueError("the times of poses must increase")
    interpolated = np.full((len(at_s), 4, 4), np.nan)
    posed = np.isfinite(poses).all(axis=(1, 2))
    times_s, poses = times_s[posed], poses[posed]
    if not len(times_s):
        return interpolated
    before = np.searchsorted(times_s, at_s, side="right") - 1
    after = np.minimum(before + 1, len(times_s) - 1)
    gap_s = times_s[after] - times_s[before]
    elapsed_s = at_s - times_s[before]
    inside = (at_s >= times_s[0]) & (at_s <= times_s[-1])
    valid = inside & ((gap_s <= max_gap_s) | (elapsed_s == 0.0))
    fraction = np.where(gap_s > 0.0, elapsed_s, 0.0) / np.where(gap_s > 0.0, gap_s, 1.0)
    interpolated[valid] = _between(poses, before[valid], after[valid], fraction[valid])
    return interpolated


@dataclass(frozen=True, slots=True, eq=False)
class PosePath:
    """Poses at any time: interpolated between frames, and extrapolated beyond the first and the last.

    Parameters
    ----------
    times
        (n,) float64, increasing, n at least 2: the time of each frame, in seconds or in frames.
    poses
        (n, 4, 4) float64, rigid; all NaN for a frame without a pose.
    """

    times: NDArray[np.float64]
    poses: NDArray[np.float64]

    def at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Poses on the line between the two frames around each time, see `interpolate_poses`.

        Before the first frame and after the last, the velocity of the nearest interval goes on.

        Parameters
        ----------
        times
            (m,) float64, in any order.

        Returns
        -------
        (m, 4, 4) float64
            NaN where one of the two frames has no pose; a time that equals that of a frame has the pose of the frame.
        """
        before = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        fraction = (times - self.times[before]) / (self.times[before + 1] - self.times[before])
        interpolated = np.full((len(times), 4, 4), np.nan)
        posed = np.asarray(np.isfinite(self.poses).all(axis=(1, 2)))
        valid = posed[before] & posed[before + 1]
        interpolated[valid] = _between(self.poses, before[valid], before[valid] + 1, fraction[valid])
        for exact, frames in ((fraction == 0.0, before), (fraction == 1.0, before + 1)):
            interpolated[exact] = self.poses[frames[exact]]
        return interpolated


def _between(
    poses: NDArray[np.float64],
    before: NDArray[np.intp],
    after: NDArray[np.intp],
    fraction: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Poses at a fraction of the way from one to another, along the shortest rotation, found once for each pair."""
    if not len(before):
        return np.empty((0, 4, 4))
    _, pair, place = np.unique(before, return_index=True, return_inverse=True)
    start = Rotation.from_matrix(poses[before[pair], :3, :3])
    end = Rotation.from_matrix(poses[after[pair], :3, :3])
    step = (start.inv() * end).as_rotvec()[place]
    between = poses[before]
    between[:, :3, :3] = (start[place] * Rotation.from_rotvec(fraction[:, None] * step)).as_matrix()
    between[:, :3, 3] += fraction[:, None] * (poses[after, :3, 3] - poses[before, :3, 3])
    return between


def nearest(times_s: NDArray[np.float64], others_s: NDArray[np.float64], *, max_gap_s: float) -> NDArray[np.intp]:
    """Find the nearest of other times for each time, of two at the same distance the earlier.

    Parameters
    ----------
    times_s
        (n,) float64, seconds.
    others_s
        (k,) float64, seconds, increasing.
    max_gap_s
        Largest distance, seconds.

    Returns
    -------
    (n,) intp
        Index of the other of each time; -1 where none is within that distance. One other may be that of several times.
    """
    if not len(others_s):
        return np.full(len(times_s), -1, np.intp)
    last = len(others_s) - 1
    after = np.minimum(np.searchsorted(others_s, times_s), last)
    before = np.maximum(after - 1, 0)
    index = np.where(np.abs(others_s[after] - times_s) < np.abs(times_s - others_s[before]), after, before)
    return np.where(np.abs(others_s[index] - times_s) <= max_gap_s, index, -1)
