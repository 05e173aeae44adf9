"""Where the files of KITTI raw data lie.

A drive is a folder ``<date>/<date>_drive_NNNN_sync`` with ``image_02/data``, ``oxts/data`` and
``velodyne_points/data``; the calibration of a day lies beside its drives. Depth-completion maps lie in
``proj_depth/groundtruth/image_02`` of the drive's folder, here or below another root's ``train`` and ``val``.
"""

import os
import re
from dataclasses import dataclass
from pathlib import Path

from tracknoise.exceptions import DataError
from tracknoise.printable import counted
from tracknoise.sequences.scenes import find_scenes, numbered_files, require_unbroken
from tracknoise.sequences.sequence import require_directory

IMAGES, OXTS, VELODYNE = "image_02", "oxts", "velodyne_points"
DEPTH, POSES = "proj_depth", "poses_image_02.txt"
CAM_TO_CAM, VELO_TO_CAM, IMU_TO_VELO = "calib_cam_to_cam.txt", "calib_velo_to_cam.txt", "calib_imu_to_velo.txt"
_PARTS = frozenset((IMAGES, OXTS, VELODYNE, DEPTH, POSES))
_SPLITS = ("train", "val")
_RECORDING = re.compile(r"\d{4}_\d{2}_\d{2}_drive_\d{4}")


@dataclass(frozen=True, slots=True)
class Drive:
    """One drive's files.

    Parameters
    ----------
    folder
        The drive's own folder.
    depth_root
        The folder below which its depth-completion maps lie, if there are any; by default its own.
    """

    folder: Path
    depth_root: Path | None = None

    @property
    def day(self) -> Path:
        """The folder of its date, where the calibration lies."""
        # resolve() would follow a link to a drive that lies apart from its calibration
        return Path(os.path.abspath(self.folder)).parent  # noqa: PTH100

    @property
    def poses(self) -> Path:
        """The file of poses, used instead of OXTS."""
        return self.folder / POSES

    @property
    def has_oxts(self) -> bool:
        """Whether there is a record of the inertial navigation system."""
        return (self.folder / OXTS).exists()

    @property
    def depth_folder(self) -> Path:
        """Where its depth-completion maps lie, if there are any."""
        return (self.depth_root or self.folder) / DEPTH / "groundtruth" / IMAGES

    @property
    def oxts_timestamps(self) -> Path:
        """Times of the records of the inertial navigation system."""
        return self.folder / OXTS / "timestamps.txt"

    @property
    def timestamps(self) -> Path:
        """The file with the time of each image."""
        return self.folder / IMAGES / "timestamps.txt"

    def image(self, number: int) -> Path:
        """Where the image of a frame should be."""
        return self.folder / IMAGES / "data" / f"{number:010d}.png"

    def oxts(self, number: int) -> Path:
        """Where the position and attitude of a frame should be."""
        return self.folder / OXTS / "data" / f"{number:010d}.txt"

    def scan(self, number: int) -> Path:
        """Where the Velodyne scan of a frame should be."""
        return self.folder / VELODYNE / "data" / f"{number:010d}.bin"

    def depth(self, number: int) -> Path:
        """Where the depth-completion map of a frame should be."""
        return self.depth_folder / f"{number:010d}.png"


@dataclass(frozen=True, slots=True)
class DriveFrames:
    """The frames of one drive.

    Attributes
    ----------
    numbers
        Of the frames, without a gap.
    images
        An image for each.
    depths
        For each its depth-completion map, else its Velodyne scan, else None.
    """

    numbers: range
    images: tuple[Path, ...]
    depths: tuple[Path | None, ...]


def find_drives(root: Path, depth_root: Path | None) -> dict[str, Drive]:
    """Find the drives in or below a folder, by name, sorted.

    Parameters
    ----------
    root
        The data set's folder, that of a date, or a single drive.
    depth_root
        Folder of the depth-completion release, or None where the maps lie in the drives' own folders.

    Raises
    ------
    DataError
        If there is no drive, two have one name, or `depth_root` has no maps for any of them.
    """
    expected = f"drives: folders with {IMAGES}/ and {OXTS}/ or {POSES}"
    folders = find_scenes(root, lambda below, files: len(_PARTS.intersection((*below, *files))) >= 2, expected=expected)
    drives: dict[str, Drive] = {}
    for scene, folder in folders.items():
        name = scene.rpartition("/")[2]
        if name in drives:
            raise DataError(folder, f"the drive {name} again, which is also in {drives[name].folder}", "it once")
        drives[name] = Drive(folder, None if depth_root is None else _split_of(depth_root, name))
    if depth_root is not None and not any(drive.depth_folder.exists() for drive in drives.values()):
        example = Drive(Path(), Path(_SPLITS[0], min(drives))).depth_folder
        found = f"no maps of the {counted(len(drives), 'drive')} in {root}"
        raise DataError(require_directory(depth_root), found, f"folders such as {example.as_posix()}")
    return dict(sorted(drives.items()))


def recording_of(name: str) -> str | None:
    """Date and number of the recording that a drive is, or is a piece of, from its name; None if it has neither."""
    found = _RECORDING.match(name)
    return found.group() if found else None


def find_frames(drive: Drive) -> DriveFrames:
    """Find the frames of a drive.

    Raises
    ------
    DataError
        Naming the first image that is missing where there are others, poses or depths of its number.
    """
    images = numbered_files(drive.folder / IMAGES / "data", r"(\d+)\.(?:png|jpe?g)")
    maps = _numbered(drive.depth_folder, r"(\d+)\.png")
    scans = _numbered(drive.folder / VELODYNE / "data", r"(\d+)\.bin")
    records = _numbered(drive.oxts(0).parent, r"(\d+)\.txt")
    numbers = require_unbroken(images, {*maps, *scans, *records}, drive.image)
    depths = tuple(maps.get(number, scans.get(number)) for number in numbers)
    return DriveFrames(numbers, tuple(images.values()), depths)


def _split_of(depth_root: Path, name: str) -> Path:
    """The folder of a drive in the depth-completion release, which divides them."""
    return next(
        (depth_root / split / name for split in _SPLITS if (depth_root / split / name).exists()), depth_root / name
    )


def _numbered(folder: Path, pattern: str) -> dict[int, Path]:
    return numbered_files(folder, pattern) if folder.exists() else {}
