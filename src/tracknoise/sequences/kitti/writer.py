"""Simulated sequences in the layout of KITTI raw data with depth completion, for the reader `kitti`."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.images import encode_png
from tracknoise.sequences.kitti.depth import UNITS_PER_METRE
from tracknoise.sequences.kitti.layout import Drive
from tracknoise.sequences.kitti.lidar import FARTHEST_M, lidar_sweep
from tracknoise.sequences.kitti.oxts import records_of_poses, write_record
from tracknoise.sequences.kitti.rig import CAMERA_FROM_IMU, CAMERA_FROM_VELODYNE, write_calibration
from tracknoise.sequences.kitti.velodyne import write_scan
from tracknoise.sequences.new_folder import new_folder
from tracknoise.sequences.pinhole import pinhole_of
from tracknoise.sequences.sequence import Sequence

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
