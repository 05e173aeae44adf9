"""Positions and attitudes of KITTI's inertial navigation system (OXTS), as poses and back.

Latitude and longitude go to metres by the Mercator projection, x = s R lon, y = s R log tan(pi/4 + lat/2), with
R = 6378137 m and s = cos(lat) of a drive's first frame; z is the altitude: east, north, up. The rotation is
Rz(yaw) Ry(pitch) Rx(roll), from the vehicle's axes (forward, left, up) to those.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.printable import counted
from tracknoise.sequences.poses import read_rows, require_near

EARTH_RADIUS_M = 6378137.0
COLUMNS = (
    "lat lon alt roll pitch yaw vn ve vf vl vu ax ay az af al au wx wy wz wf wl wu "
    "pos_accuracy vel_accuracy navstat numsats posmode velmode orimode"
)
"""Fields of a record: degrees, metres and radians first. Of the rest, the two accuracies are used."""
_USED = 6
_ACCURACIES = [COLUMNS.split().index(name) for name in ("pos_accuracy", "vel_accuracy")]
_REST = "0 " * 17 + "0 0 4 10 5 5 6"  # motion, which is not simulated; no accuracies; states of good reception


def read_records(paths: Iterable[Path]) -> NDArray[np.float64]:
    """Read the positions and attitudes of a drive's frames, a file each.

    Returns
    -------
    (n, 6) float64
        Latitude and longitude, degrees; altitude, metres; roll, pitch and yaw, radians.

    Raises
    ------
    DataError
        If a file is missing, has not one row of 30 numbers, or its angles cannot be.
    """
    records = [_checked(path, _read(path)[:_USED]) for path in paths]
    return np.array(records).reshape(-1, _USED)


def read_accuracies(paths: Iterable[Path]) -> NDArray[np.float64]:
    """Read the standard deviations that the records of a drive's frames state, a file each.

    Returns
    -------
    (n, 2) float64
        Of the position, metres, and of the velocity, metres per second; 0 where none is stated.

    Raises
    ------
    DataError
        If a file is missing, or has not one row of 30 numbers.
    """
    return np.array([_read(path)[_ACCURACIES] for path in paths]).reshape(-1, len(_ACCURACIES))


def poses_of_records(records: NDArray[np.float64]) -> NDArray[np.float64]:
    """Poses of the inertial navigation system: world_from_imu.

    Parameters
    ----------
    records
        (n, 6) float64, see `read_records`.

    Returns
    -------
    (n, 4, 4) float64
        World frame: east, north, up, metres, with its origin at the first position.
    """
    scale_m = EARTH_RADIUS_M * np.cos(np.deg2rad(records[:1, 0]))
    lat, lon = np.deg2rad(records[:, :2]).T
    place = np.stack([scale_m * lon, scale_m * np.log(np.tan(np.pi / 4 + lat / 2)), records[:, 2]], axis=-1)
    poses = np.broadcast_to(np.eye(4), (len(records), 4, 4)).copy()
    poses[:, :3, :3] = Rotation.from_euler("ZYX", records[:, :2:-1]).as_matrix()
    poses[:, :3, 3] = place - place[:1]
    return poses


def records_of_poses(world_from_imu: NDArray[np.float64], *, start: tuple[float, float, float]) -> NDArray[np.float64]:
    """The inverse of `poses_of_records`.

    Parameters
    ----------
    world_from_imu
        (n, 4, 4) float64; world frame: east, north, up, metres.
    start
        Latitude, longitude (degrees) and altitude (metres) of the first pose.

    Returns
    -------
    (n, 6) float64
        See `read_records`.
    """
    lat, lon = np.deg2rad(start[:2])
    scale_m = EARTH_RADIUS_M * np.cos(lat)
    place = world_from_imu[:, :3, 3] - world_from_imu[:1, :3, 3]
    lats = 2.0 * np.arctan(np.exp(np.log(np.tan(np.pi / 4 + lat / 2)) + place[:, 1] / scale_m)) - np.pi / 2
    angles = Rotation.from_matrix(world_from_imu[:, :3, :3]).as_euler("ZYX")
    degrees = np.rad2deg(np.stack([lats, lon + place[:, 0] / scale_m], axis=-1))
    return np.concatenate([degrees, start[2] + place[:, 2:], angles[:, ::-1]], axis=1)


def write_record(path: Path, record: NDArray[np.float64]) -> None:
    """Write one record, (6,) float64, with all digits that a float64 has."""
    path.write_text(" ".join([*map(repr, record.tolist()), _REST]) + "\n", encoding="utf-8")


def _read(path: Path) -> NDArray[np.float64]:
    """(30,) float64: one record."""
    rows, _ = read_rows(path, COLUMNS)
    if len(rows) != 1:
        raise DataError(path, counted(len(rows), "row"), "one")
    record: NDArray[np.float64] = rows[0]
    return record


def _checked(path: Path, record: NDArray[np.float64]) -> NDArray[np.float64]:
    if not np.isfinite(record).all():
        raise DataError(path, "NaN or infinity", "finite numbers")
    if abs(record[0]) >= 90.0 or abs(record[1]) > 360.0:
        raise DataError(path, f"latitude {record[0]:g} and longitude {record[1]:g}", "degrees on the globe")
    if np.abs(record[3:]).max() > 2.0 * np.pi:
        roll, pitch, yaw = record[3:]
        raise DataError(path, f"roll {roll:g}, pitch {pitch:g} and yaw {yaw:g}", "radians")
    require_near(record[None, 2:3], [path])
    return record
