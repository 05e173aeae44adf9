"""Poses from structure from motion, as published for 7-Scenes (Brachmann et al., ICCV 2021).

Each row has the name of an image, camera_from_world as a quaternion (scalar first) and a translation in metres, and the
focal length of the colour camera in px. There is one file per place and half of the data set, such as
``chess_train.txt``; images are named ``seq-01/frame-000000.color.png``.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import is_folder, read_text
from tracknoise.geometry.pose import invert
from tracknoise.sequences.poses import numbers, quaternion_poses

_COLUMNS = "qw qx qy qz tx ty tz f"


@dataclass(frozen=True, slots=True, eq=False)
class SfmPoses:
    """Poses of one recording.

    Parameters
    ----------
    world_from_camera
        (n, 4, 4) float64, metres: of the colour camera; all NaN for images that are not in the files.
    focal_px
        Focal length of the colour camera, the median of its images, px.
    """

    world_from_camera: NDArray[np.float64]
    focal_px: float


def read_sfm_poses(path: Path, images: tuple[Path, ...]) -> SfmPoses:
    """Find the poses of the images of one recording.

    Parameters
    ----------
    path
        A file, or a folder of files whose names start with the name of the place: ``chess_*.txt``.
    images
        Of one recording, in the order of its frames.

    Raises
    ------
    DataError
        If there is no such file, a row is damaged, an image has two rows, or fewer than two images have a pose.
    """
    rows: dict[str, tuple[str, NDArray[np.float64]]] = {}
    for file in _files(path, images[0].parent):
        _add_rows(rows, file)
    found = [rows.get(_name(image)) for image in images]
    known = [index for index, row in enumerate(found) if row is not None]
    if len(known) < min(2, len(images)):
        raise DataError(path, f"{len(known)} of the images of {images[0].parent}", "rows for at least 2")
    places, values = zip(*(row for row in found if row is not None), strict=True)
    return _poses(np.stack(values), places, known, len(images))


def _poses(values: NDArray[np.float64], places: tuple[str, ...], known: list[int], count: int) -> SfmPoses:
    focal_px = values[:, 7]
    for index in np.flatnonzero(~(np.isfinite(focal_px) & (focal_px > 0.0)))[:1]:
        raise DataError(places[index], f"a focal length of {focal_px[index]:g}", "a number above 0")
    poses = np.full((count, 4, 4), np.nan)
    poses[known] = invert(quaternion_poses(values[:, 4:7], values[:, [1, 2, 3, 0]], places))
    return SfmPoses(poses, float(np.median(focal_px)))


def _files(path: Path, recording: Path) -> list[Path]:
    if not is_folder(path):
        return [path]
    place = recording.resolve().parent.name
    files = sorted(path.glob(f"{place}_*.txt"))
    if not files:
        raise DataError(path, f"no file {place}_*.txt", "files such as chess_train.txt, or the file itself")
    return files


def _add_rows(rows: dict[str, tuple[str, NDArray[np.float64]]], file: Path) -> None:
    """Add place and numbers of each row of a file, by the name of its image."""
    for number, line in enumerate(read_text(file, f"rows of image {_COLUMNS}").splitlines(), start=1):
        place = f"{file}:{number}"
        image, *fields = line.split() or [""]
        if not image or image.startswith("#"):
            continue
        _require_new(rows, _name(Path(image)), place)
        rows[_name(Path(image))] = place, np.array(numbers(fields, _COLUMNS, place))


def _require_new(rows: Mapping[str, object], name: str, place: str) -> None:
    if name in rows:
        raise DataError(place, f"{name} again", "one row per image")


def _name(image: Path) -> str:
    """Sequence and frame of an image: seq-01/frame-000000."""
    return f"{image.parent.name}/{image.name.split('.')[0]}"
