"""Simulated sequences in the layout of KITTI raw data: the car, its lidar, and the files.

Simulated scans have the 64 rings of a Velodyne HDL-64E. Sensors are mounted much as on the real car. No transform is
the identity, so that a missing or inverted one is noticed.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera, CameraModel
from tracknoise.geometry.pose import from_rotation, invert, transform
from tracknoise.sequences.images import encode_png
from tracknoise.sequences.kitti import UNITS_PER_METRE
from tracknoise.sequences.kitti_files import (
    CAM_TO_CAM,
    IMU_TO_VELO,
    VELO_TO_CAM,
    Drive,
    records_of_poses,
    write_record,
    write_scan,
)
from tracknoise.sequences.sequence import Sequence
from tracknoise.sequences.writing import new_folder, pinhole_of

FARTHEST_M = 80.0
"""Beyond this nothing is measured."""

_ELEVATIONS_DEG = np.concatenate([np.linspace(2.0, -8.33, 32), np.linspace(-8.83, -24.33, 32)])
_STEP_DEG = 0.1728  # at ten turns a second
_SWAY_DEG = 0.25


def lidar_sweep(
    camera: CameraModel, camera_from_velodyne: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Positions in the image through which the lasers shine in one turn, or the half of it that looks ahead.

    The lasers are taken to start where the camera is: so they measure nothing that the camera does not see. Shapes:
    camera_from_velodyne (4, 4); returns (n, 2) px. Inside the image.
    """
    tilt = np.deg2rad(rng.uniform(-_SWAY_DEG, _SWAY_DEG))
    azimuth = np.deg2rad(np.arange(-90.0, 90.0, _STEP_DEG) + rng.uniform(0.0, _STEP_DEG))
    elevation = np.deg2rad(_ELEVATIONS_DEG)[:, None] + tilt * np.cos(azimuth)
    level = np.cos(elevation)
    rays = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1).reshape(-1, 3)
    uv = camera.project(rays @ camera_from_velodyne[:3, :3].T)
    inside: NDArray[np.float64] = uv[camera.contains(uv)]
    return inside


Pose = NDArray[np.float64]


def _mounted(rotation: Rotation, translation_m: tuple[float, float, float]) -> Pose:
    return from_rotation(rotation.as_matrix(), translation_m)


_AXES = Rotation.from_matrix([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])  # forward, left, up to a camera's
_VELODYNE_FROM_IMU = _mounted(Rotation.from_rotvec([-0.4, 0.1, 0.8], degrees=True), (-0.81, 0.32, -0.8))
_CAMERA0_FROM_VELODYNE = _mounted(Rotation.from_rotvec([-0.9, 0.3, -0.4], degrees=True) * _AXES, (-0.01, -0.07, -0.27))
_RECTIFIED0_FROM_CAMERA0 = _mounted(Rotation.from_rotvec([0.25, -0.45, -0.55], degrees=True), (0.0, 0.0, 0.0))
_CAMERA_FROM_RECTIFIED0 = _mounted(Rotation.identity(), (0.06, -0.0004, 0.0027))

CAMERA_FROM_VELODYNE: Pose = _CAMERA_FROM_RECTIFIED0 @ _RECTIFIED0_FROM_CAMERA0 @ _CAMERA0_FROM_VELODYNE
"""(4, 4) float64: from the Velodyne's frame to the rectified camera 2."""

CAMERA_FROM_IMU: Pose = CAMERA_FROM_VELODYNE @ _VELODYNE_FROM_IMU
"""(4, 4) float64: from the inertial navigation system's frame to the rectified camera 2."""


def write_calibration(day: Path, camera: Camera) -> None:
    """Write the calibration files of a day on which the rectified camera 2 is the given one."""
    time = "calib_time: 26-Sep-2011 12:00:00"
    (day / IMU_TO_VELO).write_text(_lines(time, _rigid(_VELODYNE_FROM_IMU)), encoding="utf-8")
    (day / VELO_TO_CAM).write_text(_lines(time, _rigid(_CAMERA0_FROM_VELODYNE)), encoding="utf-8")
    cameras = _camera("00", camera, np.eye(4)) | _camera("02", camera, _CAMERA_FROM_RECTIFIED0)
    (day / CAM_TO_CAM).write_text(_lines(time, {"corner_dist": np.array([0.1])} | cameras), encoding="utf-8")


def _camera(name: str, camera: Camera, rectified_from_rectified0: Pose) -> dict[str, NDArray[np.float64]]:
    """Keys of one camera, whose image is turned by R_rect as that of cam0 is."""
    rectify = _RECTIFIED0_FROM_CAMERA0[:3, :3]
    size = np.array([camera.width, camera.height], np.float64)
    return {
        f"S_{name}": size,
        f"K_{name}": camera.matrix,
        f"D_{name}": np.zeros(5),
        f"R_{name}": np.eye(3),
        f"T_{name}": rectify.T @ rectified_from_rectified0[:3, 3],
        f"S_rect_{name}": size,
        f"R_rect_{name}": rectify,
        f"P_rect_{name}": camera.matrix @ rectified_from_rectified0[:3],
    }


def _rigid(pose: Pose) -> dict[str, NDArray[np.float64]]:
    return {"R": pose[:3, :3], "T": pose[:3, 3]}


def _lines(head: str, values: dict[str, NDArray[np.float64]]) -> str:
    lines = (f"{key}: " + " ".join(f"{number:.16e}" for number in value.ravel()) for key, value in values.items())
    return "\n".join([head, *lines, ""])


_DATE = "2011_09_26"
_START = (49.0, 8.43, 115.0)
_AROUND = 5
"""A depth map combines the scans of this many frames before and after it; the first and last frames have no map."""


def write_kitti(
    sequences: Iterable[Sequence],
    out: Path,
    *,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write simulated sequences, a drive each, to a folder that `Kitti` reads; all of it appears at once.

    Images, poses and calibration are those of the sequence, to 1e-8 m. A scan holds the exact points that its lasers
    meet; a depth map holds, where a laser shone in one of the frames around it, the exact depth at the pixel's centre,
    rounded to 1/256 m. Neither reaches beyond 80 m.

    Parameters
    ----------
    sequences
        With an exact surface, and one camera without distortion; all world frames have z up. They become drives 1, 2
        and so on.
    out
        Folder to write, new or empty.
    seed
        Of where the lasers shine.
    progress
        Called after each frame with the count of frames done and of all.

    Raises
    ------
    DataError
        If a sequence has no surface, a distorted camera or another camera than the first, or the folder is neither new
        nor empty, or cannot be written.
    ValueError
        If there is no sequence.
    """
    waiting = deque(sequences)
    if not waiting:
        raise ValueError("no sequence to write")
    camera, total, done = pinhole_of(waiting[0]), sum(map(len, waiting)), 0
    for sequence in waiting:
        _require_writable(sequence, camera)
    with new_folder(out) as unfinished:
        day = unfinished / _DATE
        for number in range(1, len(waiting) + 1):
            drive = Drive(day / f"{_DATE}_drive_{number:04d}_sync")
            for _ in _write_drive(drive, waiting.popleft(), (seed, number)):  # so that its world can be forgotten
                done += 1
                if progress is not None:
                    progress(done, total)
        write_calibration(day, camera)


def _require_writable(sequence: Sequence, camera: Camera) -> None:
    if sequence.surface is None:
        raise DataError(sequence.source, "no exact surface", "a simulated sequence, whose surface lasers can meet")
    if pinhole_of(sequence) != camera or camera.distortion:
        raise DataError(sequence.source, "another camera", "one camera without distortion for all sequences")


def _write_drive(drive: Drive, sequence: Sequence, seed: tuple[int, int]) -> Iterator[None]:
    """Write one drive, frame by frame."""
    for path in (drive.image(0), drive.oxts(0), drive.scan(0), drive.depth(0)):
        path.parent.mkdir(parents=True)
    records = records_of_poses(sequence.world_from_camera @ CAMERA_FROM_IMU, start=_START)
    swept = lru_cache(maxsize=2 * _AROUND + 2)(partial(_swept, sequence.camera, seed))
    for index in range(len(sequence)):
        drive.image(index).write_bytes(encode_png(sequence.image(index)))
        write_record(drive.oxts(index), records[index])
        points, hit = _measured(sequence, index, swept(index))
        write_scan(drive.scan(index), transform(invert(CAMERA_FROM_VELODYNE), points[hit]))
        if _AROUND <= index < len(sequence) - _AROUND:
            around = range(index - _AROUND, index + _AROUND + 1, 2)  # the original drops about half, as unconfirmed
            units = _depth_map(sequence, index, np.concatenate([swept(frame) for frame in around]))
            drive.depth(index).write_bytes(encode_png(units))
        yield


def _depth_map(sequence: Sequence, index: int, uv: NDArray[np.float64]) -> NDArray[np.uint16]:
    """(height, width) uint16: depth at the centres of the pixels that positions lie in; 0 where there is none."""
    columns, rows = np.unique(np.floor(uv + 0.5).astype(np.intp), axis=0).T
    points, hit = _measured(sequence, index, np.stack([columns, rows], axis=-1).astype(np.float64))
    units = np.zeros((sequence.camera.height, sequence.camera.width), np.uint16)
    units[rows, columns] = np.where(hit, np.rint(points[:, 2] * UNITS_PER_METRE), 0).astype(np.uint16)
    return units


def _swept(camera: CameraModel, seed: tuple[int, int], index: int) -> NDArray[np.float64]:
    """(n, 2) float64, px: where the lasers shine in one frame."""
    return lidar_sweep(camera, CAMERA_FROM_VELODYNE, np.random.default_rng([*seed, index]))


def _measured(sequence: Sequence, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Surface points on the rays through pixels, (n, 3) float64, metres, camera frame, and which are within range."""
    surface = sequence.surface
    assert surface is not None, "checked before anything is written"
    points_world, hit = surface.cast(index, uv)
    points = transform(invert(sequence.world_from_camera[index]), points_world)
    return points, hit & (np.linalg.norm(points, axis=1) <= FARTHEST_M)
