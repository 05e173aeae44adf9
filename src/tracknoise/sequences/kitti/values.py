"""Values of KITTI's calibration files: one ``key: numbers`` per line. Only the keys that are needed are read."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_text
from tracknoise.printable import counted
from tracknoise.sequences.poses import checked_poses, require_near

POSE_COLUMNS = "r11 r12 r13 tx r21 r22 r23 ty r31 r32 r33 tz"
Values = dict[str, NDArray[np.float64]]


def read_values(path: Path, counts: dict[str, int]) -> Values:
    """Read the values of some keys of a file.

    Parameters
    ----------
    path
        The file.
    counts
        How many numbers each key must have.

    Raises
    ------
    DataError
        If the file or a key is missing, or a value is not that many finite numbers.
    """
    lines = read_text(path, f"a calibration with {', '.join(counts)}").splitlines()
    values: Values = {}
    for number, line in enumerate(lines, start=1):
        key, _, rest = line.partition(":")
        if key.strip() in counts:
            values[key.strip()] = _numbers(f"{path}:{number}", key.strip(), rest.split(), counts[key.strip()])
    for key, count in counts.items():
        if key not in values:
            raise DataError(path, f"no {key}", f"a line of {key} and {counted(count, 'number')}")
    return values


def projection(path: Path, values: Values, key: str) -> NDArray[np.float64]:
    """A projection matrix, (3, 4) float64, after checking that it is that of a camera without skew.

    Raises
    ------
    DataError
        If it is not.
    """
    P = values[key].reshape(3, 4)
    plain = P[0, 1] == P[1, 0] == P[2, 0] == P[2, 1] == 0.0 and P[2, 2] == 1.0
    if not (plain and P[0, 0] > 0.0 and P[1, 1] > 0.0):
        raise DataError(path, f"another {key}", "fx 0 cx . 0 fy cy . 0 0 1 . with positive fx, fy")
    with np.errstate(all="ignore"):  # of numbers that no camera has
        shift_m = camera_from_reference(P)[None, :3, 3]
    require_near(shift_m, [path])
    return P


def camera_from_reference(P: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4, 4) float64: from the rectified camera 0 to the camera of P = K (I | t), which only t separates from it."""
    shift = np.eye(4)
    shift[:3, 3] = np.linalg.solve(P[:, :3], P[:, 3])
    return shift


def rigid(path: Path, rotation: NDArray[np.float64], translation_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """A transform, (4, 4) float64, whose rotation, rounded in the file, is made exact.

    Raises
    ------
    DataError
        If it is no rigid transform.
    """
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.reshape(3, 3), translation_m
    poses, _ = checked_poses(pose[None], [path])
    exact: NDArray[np.float64] = poses[0]
    return exact


def poses_of_rows(rows: NDArray[np.float64], places: Sequence[str]) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Check poses of 12 numbers, the first three rows of a matrix.

    Parameters
    ----------
    rows
        (n, 12) float64.
    places
        n times ``file:line``.

    Returns
    -------
    poses : (n, 4, 4) float64
    notes : tuple of str
        As `tracknoise.sequences.poses.checked_poses`.

    Raises
    ------
    DataError
        Naming the first row that is no rigid transform.
    """
    poses = np.broadcast_to(np.eye(4), (len(rows), 4, 4)).copy()
    poses[:, :3] = rows.reshape(-1, 3, 4)
    return checked_poses(poses, places)


def _numbers(place: str, key: str, fields: list[str], count: int) -> NDArray[np.float64]:
    if len(fields) != count:
        raise DataError(place, f"{key} of {counted(len(fields), 'number')}", f"{count}")
    try:
        numbers = np.array([float(field) for field in fields])
    except ValueError as error:
        raise DataError(place, f"{key} with fields that are not numbers", counted(count, "number")) from error
    if not np.isfinite(numbers).all():
        raise DataError(place, f"NaN or infinity in {key}", "finite numbers")
    return numbers
