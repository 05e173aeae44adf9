"""The camera of a recording: from a file, or known for its name; and how it lies to what the poses are poses of."""

import os
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_text
from tracknoise.geometry.camera import DISTORTION_COUNTS, Camera
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.printable import counted
from tracknoise.sequences.camera_files import read_camera_file
from tracknoise.sequences.images import first_readable, image_size
from tracknoise.sequences.option_text import with_option
from tracknoise.sequences.poses import read_rows
from tracknoise.sequences.tum.known import Recording, find_recording

CAMERA_FILES = ("camera.yaml", "camera.yml", "camera.json", "calibration.yaml", "calibration.yml")
PLAIN_CALIBRATION = "calibration.txt"
_PINHOLE, _COEFFICIENTS = "fx fy cx cy", "k1 k2 p1 p2 k3 k4 k5 k6"
DEPTH_UNIT_M = 1 / 5000
"""Depth of the integer 1 in the benchmark, metres."""

_REGISTERED = "depth maps are assumed to be registered to the images pixel by pixel, as published"
_FLIP = np.diag((1.0, -1.0, 1.0, 1.0))


class PosesOf(StrEnum):
    """What the poses of a recording are poses of."""

    camera = "camera"
    body = "body"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Calibration:
    """The camera of a recording.

    Parameters
    ----------
    camera
        Intrinsics, with y down.
    notes
        Where they are from, and what was assumed.
    body_from_camera
        (4, 4) float64: from the camera to what the poses are poses of; None where that is the camera.
    upside_down
        Whether the y axes of the recorded poses point up, in the frames of camera and world.
    depth_unit_m
        Depth of the integer 1, metres.
    shutter
        Rolling shutter that a file of the camera states; None where there is none.
    """

    camera: CameraModel
    notes: tuple[str, ...]
    body_from_camera: NDArray[np.float64] | None = None
    upside_down: bool = False
    depth_unit_m: float = DEPTH_UNIT_M
    shutter: RollingShutter | None = None

    def world_from_camera(self, recorded: NDArray[np.float64]) -> NDArray[np.float64]:
        """Poses of the camera, (n, 4, 4) float64, from the recorded ones."""
        if self.body_from_camera is not None:
            recorded = recorded @ self.body_from_camera
        return _FLIP @ recorded @ _FLIP if self.upside_down else recorded


def known_recording(root: Path, folder: Path) -> Recording | None:
    """The recording that the name of a folder, or of one above it down from the root, fits; None if none does."""
    levels = [level for level in (folder, *folder.parents) if root in (level, *level.parents)]
    return find_recording([Path(os.path.abspath(level)).name for level in levels])  # noqa: PTH100


def find_calibration(
    folder: Path,
    images: tuple[Path, ...],
    known: Recording | None,
    *,
    camera_file: Path | None,
    poses_of: PosesOf,
) -> Calibration:
    """Find the camera: in the given file, in one of the recording's folder, or the published one.

    Parameters
    ----------
    folder
        Of the recording.
    images
        Its images; their size is read where the calibration does not state it.
    known
        What is published about the recording.
    camera_file
        Used before all others.
    poses_of
        With `PosesOf.body`, the file must state how the camera lies to the body.

    Raises
    ------
    DataError
        If there is none, or it cannot be used.
    """
    candidates = (camera_file, *(folder / name for name in CAMERA_FILES))
    file = next((path for path in candidates if path is not None and (path == camera_file or path.exists())), None)
    if file is not None:
        return _from_file(file, known, poses_of)
    if poses_of is PosesOf.body:
        raise DataError(folder, "poses of a body and no camera file", "a camera file that states where the camera is")
    if (folder / PLAIN_CALIBRATION).exists():
        return _from_plain_numbers(folder / PLAIN_CALIBRATION, images, known)
    if known is None:
        names = ", ".join((*CAMERA_FILES, PLAIN_CALIBRATION))
        expected = f"one of {names}, or {with_option('camera_file', 'FILE')}"
        raise DataError(folder, "no camera, and a name that is not that of a known recording", expected)
    return _published(folder, known)


def _from_file(file: Path, known: Recording | None, poses_of: PosesOf) -> Calibration:
    """A known recording's poses are of what is published, and in its axes, whatever the file states."""
    read = read_camera_file(file)
    body_from_camera = None if known is None else known.body_from_camera
    upside_down = known is not None and known.upside_down and poses_of is PosesOf.camera
    notes = [f"the camera is that of {file}", *_upside_down_notes(known, upside_down)]
    if poses_of is PosesOf.body:
        if read.body_from_camera is None:
            raise DataError(file, "no position of the camera on the body", "T_BS or T_cam_imu, for poses of the body")
        body_from_camera = read.body_from_camera
        notes += ["the poses are those of the body, and moved to the camera", *_shift_notes(read.time_shift_s)]
    elif read.body_from_camera is not None:
        notes.append("the poses are taken as those of the camera, though its file states where it is on a body")
    return Calibration(
        camera=read.camera,
        notes=(*notes, *read.notes),
        body_from_camera=body_from_camera,
        upside_down=upside_down,
        depth_unit_m=read.depth_unit_m or DEPTH_UNIT_M,
        shutter=read.shutter,
    )


def _from_plain_numbers(path: Path, images: tuple[Path, ...], known: Recording | None) -> Calibration:
    rows, _ = read_rows(path, _plain_columns(path))
    if len(rows) != 1:
        raise DataError(path, counted(len(rows), "row"), "one of fx fy cx cy")
    fx, fy, cx, cy, *distortion = rows[0].tolist()
    if not (np.isfinite(rows).all() and fx > 0.0 and fy != 0.0):
        raise DataError(path, f"fx {fx:g}, fy {fy:g}, cx {cx:g}, cy {cy:g}", "focal lengths and a principal point, px")
    if distortion and fy < 0.0:
        distortion[2] = -distortion[2]  # p1 changes its sign with the y axis
    camera = Camera(*image_size(first_readable(images)), fx, abs(fy), cx, cy, tuple(distortion))
    lens = "with radial-tangential distortion" if distortion else "without distortion"
    by_name = fy > 0.0 and known is not None and known.upside_down
    notes = (*_flip_notes(fy < 0.0), *_upside_down_notes(known, by_name))
    return Calibration(
        camera=camera,
        notes=(f"the camera is that of {path}, {lens}", *notes),
        body_from_camera=None if known is None else known.body_from_camera,
        upside_down=fy < 0.0 or by_name,
    )


def _plain_columns(path: Path) -> str:
    """Names of the numbers in a row: those of as many distortion coefficients as the first row has, or none."""
    lines = read_text(path, f"a row of {_PINHOLE}").splitlines()
    fields = next((line.split() for line in lines if line.strip() and not line.lstrip().startswith("#")), [])
    count = len(fields) - len(_PINHOLE.split())
    coefficients = _COEFFICIENTS.split()[: count if count in DISTORTION_COUNTS else 0]
    return " ".join([_PINHOLE, *coefficients])


def _published(folder: Path, known: Recording) -> Calibration:
    source = f"{folder}: no camera file, so the published camera of {known.name} is used, by the name of the folder"
    moved = f"the poses were moved from the markers to the camera as published for {known.name}"
    return Calibration(
        camera=known.camera,
        notes=(
            source,
            _REGISTERED,
            *((moved,) if known.body_from_camera is not None else ()),
            *_flip_notes(known.upside_down),
        ),
        body_from_camera=known.body_from_camera,
        upside_down=known.upside_down,
    )


def _flip_notes(upside_down: bool) -> tuple[str, ...]:
    note = "fy is negative: the y axes of camera and world point up, and both were turned down together with the poses"
    return (note,) if upside_down else ()


def _upside_down_notes(known: Recording | None, upside_down: bool) -> tuple[str, ...]:
    """Of a recording whose poses are published with axes that no camera file can state."""
    if known is None or not upside_down:
        return ()
    return (f"the y axes of the poses of {known.name} point up, and were turned down",)


def _shift_notes(shift_s: float | None) -> tuple[str, ...]:
    """Of a time between camera and body that a camera file states; the option alone says what the poses' clock is."""
    if not shift_s:
        return ()
    return (f"the camera file states a time shift of {1e3 * shift_s:g} ms; only the option time_shift_s is applied",)
