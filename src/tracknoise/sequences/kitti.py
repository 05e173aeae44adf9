"""The reader of KITTI raw data (Geiger et al., IJRR 2013) with KITTI's completed depth: see docs/formats.md.

A record of the OXTS files has the standard deviations of position (north and east, metres) and of velocity (north and
east, metres per second). The error of the position is nearly the same in successive frames. Their relative error is
that of the velocity times the time between them.

In still stretches the camera does not move, so that tracks grow older without moving. At the reader's limit of 2 cm per
frame, a point 15 m away and 300 px from the centre moves by 0.4 px per frame: less than the error of a tracker. A car
at walking pace moves five times as far. The measured position of a car that stands jitters by millimetres. A car does
not turn on the spot, so its position alone is enough.
"""

from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, require_bounds
from tracknoise.exceptions import DataError
from tracknoise.geometry.accuracy import PoseAccuracy, TruthAccuracy
from tracknoise.geometry.cameras import Camera, CameraModel
from tracknoise.geometry.depth import DepthMap, cloud_depth
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.images import first_readable, image_size, read_depth_png16
from tracknoise.sequences.kitti_files import (
    IMAGES,
    OXTS,
    POSE_COLUMNS,
    POSES,
    SCAN_SUFFIX,
    Drive,
    find_drives,
    find_frames,
    pose_time_notes,
    poses_of_records,
    poses_of_rows,
    read_accuracies,
    read_camera,
    read_camera_from_imu,
    read_camera_from_velodyne,
    read_records,
    read_scan,
    read_second_camera,
    read_timestamps,
    recording_of,
)
from tracknoise.sequences.poses import read_rows, require_poses, surplus_notes
from tracknoise.sequences.recorded import ImageFiles, RecordedSequence, depth_files, depth_notes
from tracknoise.sequences.scenes import scene_folder
from tracknoise.tables.identity import SequenceId
from tracknoise.text import counted

Trajectory = tuple[NDArray[np.float64], tuple[str, ...]]


def read_trajectory(drive: Drive, numbers: range) -> Trajectory:
    """Read the poses of a drive's frames: world_from_camera = world_from_imu camera_from_imu^-1.

    Returns poses (n, 4, 4). From a file of poses, it is that file's.
    """
    if drive.has_oxts:
        world_from_imu = poses_of_records(read_records(map(drive.oxts, numbers)))
        poses: NDArray[np.float64] = world_from_imu @ invert(read_camera_from_imu(drive.day))
        return poses, ()
    if not drive.poses.exists():
        raise DataError(drive.folder, f"neither {OXTS} nor {POSES}", "one of them, for the poses of the camera")
    return _read_poses(drive, len(numbers))


def _read_poses(drive: Drive, images: int) -> Trajectory:
    rows, places = read_rows(drive.poses, POSE_COLUMNS)
    require_poses(drive.poses, poses=len(rows), images=images)
    surplus = surplus_notes(drive.poses, poses=len(rows), images=images)
    poses, notes = poses_of_rows(rows[:images], places)
    return poses, (f"there is no {OXTS}: poses come from {POSES}", *surplus, *notes)


_NOMINAL_INTERVAL_S = 0.1
_SOURCE = "vel_accuracy in the OXTS files"


@dataclass(frozen=True, slots=True)
class OxtsAccuracy:
    """Stated accuracy of the poses of a drive; None where nothing is stated."""

    pose: PoseAccuracy | None = None  # Of single poses: the median over frames. OXTS files state no accuracy of angles.
    truth: TruthAccuracy | None = None  # of relative poses: growth of the error of the position from frame to frame
    notes: tuple[str, ...] = ()  # the figures, in one sentence


def read_oxts_accuracy(drive: Drive, numbers: range, timestamps_s: NDArray[np.float64] | None) -> OxtsAccuracy:
    """Read the accuracies that the OXTS files of a drive state. Shapes: timestamps_s (n,)."""
    if not drive.has_oxts:
        return OxtsAccuracy()
    stated = read_accuracies(map(drive.oxts, numbers))
    usable = stated[(np.isfinite(stated) & (stated > 0.0)).all(axis=1)]
    if not len(usable):
        return OxtsAccuracy()
    position_m, velocity_m_per_s = np.median(usable, axis=0).tolist()
    steps_s = np.array([_NOMINAL_INTERVAL_S]) if timestamps_s is None or len(stated) < 2 else np.diff(timestamps_s)
    truth = TruthAccuracy(translation_m_per_frame=velocity_m_per_s * float(np.median(steps_s)), source=_SOURCE)
    note = (
        f"OXTS states standard deviations of {position_m:.3g} m in position and {velocity_m_per_s:.3g} m/s in "
        f"velocity (medians of {len(usable)} of {len(stated)} frames), and none of angles"
    )
    return OxtsAccuracy(PoseAccuracy(position_m, None), truth, (note,))


def still_stretch(world_from_camera: NDArray[np.float64], *, frames: int, step_m: float) -> range | None:
    """The longest still stretch, the first of several; None if none has so many frames, each so near the one before.

    Shapes: world_from_camera (n, 4, 4).
    """
    steps_m = np.linalg.norm(np.diff(world_from_camera[:, :3, 3], axis=0), axis=1)
    still = np.concatenate([[False], steps_m < step_m, [False]])
    starts, stops = np.flatnonzero(still[1:] & ~still[:-1]), np.flatnonzero(still[:-1] & ~still[1:])
    lengths = stops - starts
    if not lengths.size or lengths.max() < frames:
        return None
    longest = int(np.argmax(lengths))
    return range(int(starts[longest]) + 1, int(stops[longest]) + 1)


UNITS_PER_METRE = 256
"""What a depth-completion map holds for a depth of 1 m; it holds 0 where there is none."""

NEAREST_M = 0.5
"""Points with less depth are not part of the scene: the scanner measures from 0.9 m on."""


@dataclass(frozen=True, slots=True, eq=False)
class KittiDepth:
    """Reads depth files of either kind: a `tracknoise.sequences.recorded.DepthReader`."""

    radius_px: float  # see `tracknoise.geometry.depth.DepthMap`
    camera_from_velodyne: NDArray[np.float64] | None  # (4, 4) float64; None where no frame needs its scan

    def __call__(self, path: Path, camera: CameraModel) -> DepthMap:
        """Sparse depth of one frame."""
        if path.suffix != SCAN_SUFFIX:
            depth = read_depth_png16(path, camera, metres_per_unit=1.0 / UNITS_PER_METRE)
            return replace(depth, radius_px=self.radius_px)
        assert self.camera_from_velodyne is not None, "given wherever there is a scan"
        points = transform(self.camera_from_velodyne, read_scan(path))
        return cloud_depth(camera, points, nearest_m=NEAREST_M, radius_px=self.radius_px)


def z_depth_from(paths: tuple[Path | None, ...]) -> str | None:
    """What depths of a drive were computed from, along z; None where any is read from a map, or there are none."""
    present = [path for path in paths if path is not None]
    return "projected Velodyne scans" if present and all(path.suffix == SCAN_SUFFIX for path in present) else None


def source_note(paths: tuple[Path | None, ...]) -> str:
    """A sentence on what the depth of a drive comes from."""
    scans = sum(path is not None and path.suffix == SCAN_SUFFIX for path in paths)
    maps = len(paths) - scans - paths.count(None)
    return f"frames with depth from depth-completion maps: {maps}, from projected Velodyne scans: {scans}"


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
        before: see `tracknoise.sequences.kitti`.
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
        """All drives without a still stretch, sorted. A drive whose poses cannot be read is listed; `open` says why."""
        drives = self._drives()
        moving = [name for name, drive in drives.items() if self._reason_to_exclude(drive) is None]
        if not moving:
            found = f"{counted(len(drives), 'drive')}, none without a still stretch"
            raise DataError(self.root, found, _OVERRIDE)
        return [SequenceId(self.name, scene) for scene in moving]

    def excluded_scenes(self) -> dict[str, str]:
        """The still stretch of each excluded drive, one sentence each, by name of the drive."""
        reasons = {name: self._reason_to_exclude(drive) for name, drive in self._drives().items()}
        return {name: reason for name, reason in reasons.items() if reason is not None}

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one drive, except for its images and depths."""
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
            time_unit_stated=True,
            pose_accuracy=accuracy.pose,
            truth_accuracy=accuracy.truth,
            group=recording_of(sequence.scene),
            second=read_second_camera(drive, frames.numbers),
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
        if self.keep_still:
            return None
        stretch = still_stretch(poses, frames=self.still_frames, step_m=self.still_m)
        if stretch is None:
            return None
        first, last = numbers[stretch[0]], numbers[stretch[-1]]
        return f"stands still in frames {first} to {last}, each less than {self.still_m:g} m from the one before"


def _require_size(image: Path, camera: Camera) -> None:
    width, height = image_size(image)
    if (width, height) != (camera.width, camera.height):
        raise DataError(image, f"size {width}x{height}", f"the {camera.width}x{camera.height} of the calibration")
