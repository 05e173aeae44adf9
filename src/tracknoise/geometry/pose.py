"""Rigid transforms as 4x4 matrices, named ``target_from_source``."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation


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
    poses = np.broadcast_to(np.eye(4), (len(xyzw), 4, 4)).copy()
    if len(xyzw):
        poses[:, :3, :3] = Rotation.from_quat(xyzw).as_matrix()
        poses[:, :3, 3] = translation_m
    return poses


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
    known = np.isfinite(poses).all(axis=(1, 2))
    if known.any():
        quaternions = Rotation.from_matrix(poses[known, :3, :3]).as_quat(canonical=canonical)
        rows[known] = np.hstack([poses[known, :3, 3], quaternions])
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
    each: NDArray[np.float64] = np.einsum("nij,nj->ni", pose[:, :3, :3], points) + pose[:, :3, 3]
    return each


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
