"""The reader of KITTI raw data with the depth of KITTI's depth completion: see docs/kitti.md."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, require_bounds
from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.printable import counted
from tracknoise.sequences.frame_files import ImageFiles, depth_files, depth_notes
from tracknoise.sequences.images import first_readable, image_size
from tracknoise.sequences.kitti.accuracy import read_oxts_accuracy
from tracknoise.sequences.kitti.calibration import read_camera, read_camera_from_velodyne
from tracknoise.sequences.kitti.depth import KittiDepth, source_note, z_depth_from
from tracknoise.sequences.kitti.layout import IMAGES, Drive, find_drives, find_frames, recording_of
from tracknoise.sequences.kitti.stillness import StillRule, still_stretch
from tracknoise.sequences.kitti.timestamps import pose_time_notes, read_timestamps
from tracknoise.sequences.kitti.trajectory import read_trajectory
from tracknoise.sequences.kitti.velodyne import SCAN_SUFFIX
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.scenes import scene_folder
from tracknoise.tables.identity import SequenceId

_OVERRIDE = "a drive without still stretches, or keep_still = true"


@dataclass(frozen=True, slots=True)
class Kitti:
    """Reader of KITTI raw data, synchronised and rectified, colour camera 2.

    Parameters
    ----------
    root
        The data set's folder, that of a date, or a single drive.
    depth_root
        Folder of the depth-completion release, which holds ``train`` and ``val``; by default its maps are looked for
        in the drives' own folders.
    radius_px
        Largest distance from a feature to the nearest pixel with depth, px.
    keep_still
        Whether to keep drives with still stretches.
    still_frames, still_m
        A still stretch has at least `still_frames` consecutive frames, each less than `still_m` metres from the one
        before: see `tracknoise.sequences.kitti.stillness`.

    Raises
    ------
    ValueError
        If an option has an impossible value.
    """

    name: ClassVar[str] = "kitti"
    description: ClassVar[str] = "KITTI raw drives with depth-completion maps or Velodyne scans"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    depth_root: Path | None = None
    radius_px: NotNegative = 1.0
    keep_still: bool = False
    still_frames: Annotated[int, Ge(1)] = 10
    still_m: NotNegative = 0.02

    def __post_init__(self) -> None:
        require_bounds(self)

    def sequences(self) -> list[SequenceId]:
        """All drives without a still stretch, sorted. A drive whose poses cannot be read is listed; `open` says why.

        Raises
        ------
        DataError
            If there is none.
        """
        drives = self._drives()
        moving = [name for name, drive in drives.items() if self._reason_to_exclude(drive) is None]
        if not moving:
            found = f"{counted(len(drives), 'drive')}, none without a still stretch"
            raise DataError(self.root, found, _OVERRIDE)
        return [SequenceId(self.name, scene) for scene in moving]

    def excluded_scenes(self) -> dict[str, str]:
        """The still stretch of each excluded drive, one sentence each, by name of the drive.

        Raises
        ------
        DataError
            If there is no drive.
        """
        reasons = {name: self._reason_to_exclude(drive) for name, drive in self._drives().items()}
        return {name: reason for name, reason in reasons.items() if reason is not None}

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one drive, except for its images and depths.

        Raises
        ------
        DataError
            If a file is missing or damaged, or the drive is excluded because of a still stretch.
        UnknownNameError
            If there is no such drive or lighting.
        """
        drives = self._drives()
        scene_folder({name: drive.folder for name, drive in drives.items()}, sequence)
        drive = drives[sequence.scene]
        frames = find_frames(drive)
        camera = read_camera(drive.day)
        _require_size(first_readable(frames.images), camera)
        poses, notes = read_trajectory(drive, frames.numbers)
        if reason := self._still_stretch(poses, frames.numbers):
            raise DataError(drive.folder, reason, _OVERRIDE)
        timestamps_s, time_notes = read_timestamps(drive.timestamps, frames.numbers)
        time_notes += pose_time_notes(drive.timestamps, drive.oxts_timestamps, frames.numbers)
        accuracy = read_oxts_accuracy(drive, frames.numbers, timestamps_s)
        scans = any(path is not None and path.suffix == SCAN_SUFFIX for path in frames.depths)
        read_depth = KittiDepth(self.radius_px, read_camera_from_velodyne(drive.day) if scans else None)
        return RecordedSequence(
            id=sequence,
            source=str(drive.folder / IMAGES / "data"),
            camera=camera,
            world_from_camera=poses,
            images=ImageFiles(frames.images, camera),
            depths=depth_files(frames.depths, camera, read_depth),
            notes=(*notes, *accuracy.notes, source_note(frames.depths), *depth_notes(frames.depths), *time_notes),
            timestamps_s=timestamps_s,
            pose_accuracy=accuracy.pose,
            truth_accuracy=accuracy.truth,
            group=recording_of(sequence.scene),
            z_depth_from=z_depth_from(frames.depths),
        )

    def _drives(self) -> dict[str, Drive]:
        return find_drives(self.root, self.depth_root)

    def _reason_to_exclude(self, drive: Drive) -> str | None:
        """Why a drive is excluded; None if it is not, or if it cannot be read, which `open` reports."""
        if self.keep_still:
            return None
        try:
            numbers = find_frames(drive).numbers
            poses, _ = read_trajectory(drive, numbers)
        except DataError:
            return None
        return self._still_stretch(poses, numbers)

    def _still_stretch(self, poses: NDArray[np.float64], numbers: range) -> str | None:
        """A sentence on the longest still stretch, unless they are kept."""
        stretch = None if self.keep_still else still_stretch(poses, StillRule(self.still_frames, self.still_m))
        if stretch is None:
            return None
        first, last = numbers[stretch[0]], numbers[stretch[-1]]
        return f"stands still in frames {first} to {last}, each less than {self.still_m:g} m from the one before"


def _require_size(image: Path, camera: Camera) -> None:
    width, height = image_size(image)
    if (width, height) != (camera.width, camera.height):
        raise DataError(image, f"size {width}x{height}", f"the {camera.width}x{camera.height} of the calibration")
