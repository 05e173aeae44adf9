"""The reader of recordings in the format of the TUM RGB-D benchmark: see docs/formats/tum.md."""

from dataclasses import KW_ONLY, dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, Positive, require_bounds, require_finite
from tracknoise.exceptions import DataError
from tracknoise.geometry.association import nearest
from tracknoise.geometry.interpolation import PosePath
from tracknoise.sequences.frame_files import ImageFiles, depth_files, depth_notes
from tracknoise.sequences.images import read_depth_png16
from tracknoise.sequences.poses import read_rows
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.scenes import find_scenes, scene_folder
from tracknoise.sequences.timed.order import require_seconds
from tracknoise.sequences.timed.trajectory import Trajectory, path_through, poses_at, trajectory
from tracknoise.sequences.tum.calibration import PosesOf, find_calibration, known_recording
from tracknoise.sequences.tum.lists import COLOUR, PAIRS, SEPARATOR, FileList, read_lists
from tracknoise.tables.identity import SequenceId

_GROUND_TRUTH = "groundtruth.txt"
_LARGEST_FRAME_NUMBER = 1e6
_COLUMNS = "timestamp tx ty tz qx qy qz qw"


@dataclass(frozen=True, slots=True)
class Tum:
    """Reader of the TUM RGB-D benchmark, ICL-NUIM, Bonn RGB-D, ETH3D SLAM and all that is written like them.

    Parameters
    ----------
    root
        Folder of one recording, or of several at any depth.
    camera_file
        Intrinsics; by default a camera file in the recording's folder, else the published camera that its name fits.
    poses_of
        What the poses are poses of: the camera, or a body on which the camera file states the camera's place.
    depth_unit_m
        Depth of the integer 1, metres; by default what the camera file states, else 1/5000.
    max_gap_s
        Largest time between an image and its depth map, seconds.
    max_pose_gap_s
        Longest time between two poses that are interpolated, seconds. Images in longer gaps have no pose.
    time_shift_s
        Added to the times of the images to get the clock of the poses, seconds.

    Raises
    ------
    ValueError
        If an option has an impossible value.
    """

    name: ClassVar[str] = "tum"
    description: ClassVar[str] = "TUM RGB-D and its format: ICL-NUIM, Bonn, ETH3D SLAM; depth/5000, poses by time"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    camera_file: Path | None = None
    poses_of: PosesOf = PosesOf.camera
    depth_unit_m: Positive | None = None
    max_gap_s: NotNegative = 0.02
    max_pose_gap_s: NotNegative = 0.1
    time_shift_s: float = 0.0

    def __post_init__(self) -> None:
        require_bounds(self)
        require_finite("time_shift_s", self.time_shift_s)

    def sequences(self) -> list[SequenceId]:
        """All recordings, sorted: each folder with a list of images.

        Raises
        ------
        DataError
            If there is none.
        """
        return [SequenceId(self.name, scene) for scene in self._scenes()]

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one recording, except for its images and depths.

        Raises
        ------
        DataError
            If a list, the poses or the camera is missing or damaged, or no image has a pose.
        UnknownNameError
            If there is no such scene or lighting.
        """
        folder = scene_folder(self._scenes(), sequence)
        images, depths = read_lists(folder)
        known = known_recording(self.root, folder)
        calibration = find_calibration(
            folder, images.files, known, camera_file=self.camera_file, poses_of=self.poses_of
        )
        recorded = _read_trajectory(folder)
        poses, pose_notes = poses_at(recorded, images.times_s + self.time_shift_s, max_gap_s=self.max_pose_gap_s)
        paths, association_notes = _depths_of(images, depths, max_gap_s=self.max_gap_s)
        world_from_camera = calibration.world_from_camera(poses)
        timestamps_s, time_notes = _timestamps(images)
        start_s = images.times_s[0] + self.time_shift_s
        path = PosePath(recorded.times_s - start_s, calibration.world_from_camera(recorded.poses))
        read_depth = partial(read_depth_png16, metres_per_unit=self.depth_unit_m or calibration.depth_unit_m)
        return RecordedSequence(
            id=sequence,
            source=str(folder),
            camera=calibration.camera,
            world_from_camera=world_from_camera,
            images=ImageFiles(images.files, calibration.camera),
            depths=depth_files(paths, calibration.camera, read_depth),
            notes=(*calibration.notes, *pose_notes, *images.notes, *time_notes, *association_notes),
            timestamps_s=timestamps_s,
            group=None if known is None else known.place,
            shutter=calibration.shutter,
            path=None
            if timestamps_s is None
            else path_through(timestamps_s, world_from_camera, path, max_gap_s=self.max_pose_gap_s),
        )

    def _scenes(self) -> dict[str, Path]:
        expected = f"folders with {COLOUR} or {PAIRS[0]}"
        return find_scenes(self.root, lambda _, files: not {COLOUR, *PAIRS}.isdisjoint(files), expected=expected)


def _read_trajectory(folder: Path) -> Trajectory:
    path = folder / _GROUND_TRUTH
    if not path.exists():
        path = next(iter(sorted(folder.glob("*.gt.freiburg"))), path)
    rows, places = read_rows(path, _COLUMNS, separator=SEPARATOR)
    require_seconds(rows[:, 0], places)
    return trajectory(path, rows[:, 0], rows[:, 1:], places)


def _timestamps(images: FileList) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
    """Times since the first image; None where small whole numbers show that they are numbers of frames."""
    times_s = images.times_s
    if len(times_s) > 1 and times_s[-1] < _LARGEST_FRAME_NUMBER and np.array_equal(times_s, np.rint(times_s)):
        return None, ("the timestamps are whole numbers: they are taken as numbers of frames, so times are unknown",)
    return times_s - times_s[0], ()


def _depths_of(
    images: FileList, depths: FileList, *, max_gap_s: float
) -> tuple[tuple[Path | None, ...], tuple[str, ...]]:
    """The depth map of each image, and sentences on how far apart in time they are."""
    index = nearest(images.times_s, depths.times_s, max_gap_s=max_gap_s)
    paths = tuple(depths.files[depth] if depth >= 0 else None for depth in index)
    if not depths.files:
        return paths, ()
    used = np.flatnonzero(index >= 0)
    if not len(used):
        found = f"depth maps: {len(depths.files)}, but none within {max_gap_s:g} s of an image"
        raise DataError(depths.files[0].parent, found, "depth maps at the times of images, or a larger max_gap_s")
    apart_ms = 1e3 * np.abs(depths.times_s[index[used]] - images.times_s[used])
    apart = (
        f"the depth of an image is the nearest in time: {np.median(apart_ms):.1f} ms from it in the median, "
        f"{apart_ms.max():.1f} ms at most"
    )
    return paths, (*depths.notes, apart, *depth_notes(paths))
