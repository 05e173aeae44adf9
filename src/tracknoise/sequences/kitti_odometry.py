"""The reader of the KITTI odometry benchmark, and of what is written like it: see docs/formats.md.

A sequence is a folder ``sequences/NN`` with ``calib.txt``, ``times.txt`` and ``image_0`` to ``image_3``. Its poses are
in ``poses/NN.txt`` beside ``sequences``, or in its own ``poses.txt``. All cameras are rectified: P_k = K (I | t_k), so
X_k = X_0 + t_k. Poses are those of camera 0.
"""

import os
import re
from dataclasses import KW_ONLY, dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, require_bounds
from tracknoise.exceptions import DataError
from tracknoise.foreign_files import read_text
from tracknoise.geometry.pose import invert
from tracknoise.sequences.kitti import KittiDepth, z_depth_from
from tracknoise.sequences.kitti_files import (
    POSE_COLUMNS,
    DriveFrames,
    camera_from_reference,
    camera_of,
    poses_of_rows,
    projection,
    read_values,
    rigid,
    second_camera,
)
from tracknoise.sequences.likely_times import seconds_of
from tracknoise.sequences.poses import no_poses, read_rows, require_poses, surplus_notes
from tracknoise.sequences.recorded import ImageFiles, RecordedSequence, depth_files, depth_notes
from tracknoise.sequences.scenes import (
    any_numbered_files,
    find_scenes,
    numbered_files,
    require_unbroken,
    scene_folder,
    with_option,
)
from tracknoise.sequences.sequence import Body, SecondCamera
from tracknoise.tables.identity import SequenceId
from tracknoise.text import counted
from tracknoise.time_units import TimeUnit

CALIBRATION, TIMES = "calib.txt", "times.txt"
CAMERAS = range(4)
IMAGE_NAME = r"(\d+)\.(?:png|jpe?g)"
_POSES, _VELODYNE = "poses", "velodyne"


@dataclass(frozen=True, slots=True)
class Course:
    """The files of one sequence."""

    folder: Path  # its own folder

    @property
    def poses(self) -> Path:
        """The file of poses, which may be missing."""
        # resolve() would follow a link to a sequence that lies apart from its poses
        folder = Path(os.path.abspath(self.folder))  # noqa: PTH100
        beside = folder.parent.parent / _POSES / f"{folder.name}.txt"
        inside = self.folder / f"{_POSES}.txt"
        return inside if inside.exists() and not beside.exists() else beside

    @property
    def first_camera(self) -> int:
        """The first camera whose images are there."""
        return next(camera for camera in CAMERAS if self.images(camera).exists())

    def images(self, camera: int) -> Path:
        """The folder of a camera's images."""
        return self.folder / f"image_{camera}"


def find_courses(root: Path) -> dict[str, Course]:
    """Find the sequences in or below a folder, by the names of their folders, sorted."""
    expected = f"sequences: folders with {CALIBRATION} and image_0 to image_3"
    folders = find_scenes(
        root,
        lambda below, files: CALIBRATION in files and any(f"image_{camera}" in below for camera in CAMERAS),
        expected=expected,
    )
    courses: dict[str, Course] = {}
    for scene, folder in folders.items():
        name = scene.rpartition("/")[2]
        if name in courses:
            raise DataError(folder, f"the sequence {name} again, which is also in {courses[name].folder}", "it once")
        courses[name] = Course(folder)
    return dict(sorted(courses.items()))


def find_frames(course: Course, camera: int) -> DriveFrames:
    """Find the frames of a sequence."""
    folder, scans = course.images(camera), course.folder / _VELODYNE
    images = numbered_files(folder, IMAGE_NAME)
    numbers = require_unbroken(images, (), lambda number: folder / f"{number:06d}.png")
    scan_of = any_numbered_files(scans, r"(\d+)\.bin")
    return DriveFrames(numbers, tuple(images.values()), tuple(map(scan_of.get, numbers)))


_VELODYNE_KEY = "Tr"


def read_projection(path: Path, camera: int) -> NDArray[np.float64]:
    """Read the projection matrix of a camera, (3, 4) float64."""
    key = f"P{camera}"
    if not re.search(r"^\s*\w+\s*:", read_text(path, f"a calibration with {key}"), re.MULTILINE):
        layouts = "for reader folder, name the images images/, and the others poses.txt and camera.json"
        expected = f"a line of {key} and 12 numbers, for reader kitti-odometry; {layouts}"
        raise DataError(path, "no keys", expected)
    return projection(path, read_values(path, {key: 12}), key)


def read_camera_from_velodyne(path: Path, camera: int) -> NDArray[np.float64]:
    """Read the transform from the Velodyne's frame to that of a camera, (4, 4) float64."""
    rows = read_values(path, {_VELODYNE_KEY: 12})[_VELODYNE_KEY].reshape(3, 4)
    reference_from_velodyne = rigid(path, rows[:, :3], rows[:, 3])
    chain: NDArray[np.float64] = camera_from_reference(read_projection(path, camera)) @ reference_from_velodyne
    return chain


def read_reference_poses(path: Path, numbers: range) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Read the poses of camera 0. Row i belongs to image i; there may be more rows than images.

    Returns poses (n, 4, 4). `poses`: world_from_camera of camera 0, of the numbered frames. `notes`: what was
    corrected, and how many rows have no image.
    """
    rows, places = read_rows(path, POSE_COLUMNS)
    require_poses(path, poses=len(rows), images=numbers.stop)
    poses, notes = poses_of_rows(rows[numbers.start : numbers.stop], places[numbers.start : numbers.stop])
    return poses, (*surplus_notes(path, poses=len(rows), images=numbers.stop), *notes)


def read_times(path: Path, numbers: range, unit: TimeUnit | None) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
    """Read the times of images. Row i belongs to image i. `unit`: None for seconds that are not stated.

    `timestamps_s`: seconds after the first of the numbered frames. None where the file is missing or its times do not
    increase.
    """
    if not path.exists():
        return None, (f"{path}: no such file, so times are unknown",)
    rows, places = read_rows(path, "time")
    if len(rows) < numbers.stop:
        raise DataError(path, counted(len(rows), "time"), f"at least {numbers.stop}, one for each image")
    times_s = rows[numbers.start : numbers.stop, 0]
    if not (np.isfinite(times_s).all() and np.all(np.diff(times_s) > 0.0)):
        return None, (f"{path}: the times do not increase, so they are not used",)
    numbered = places[numbers.start : numbers.stop]
    seconds = seconds_of(times_s, unit, path, numbered, partial(with_option, "time_unit"))
    return seconds - seconds[0], ()


@dataclass(frozen=True, slots=True)
class KittiOdometry:
    """Reader of the KITTI odometry benchmark, and of what is written like it.

    Parameters
    ----------
    root
        The data set's folder, or that of a single sequence.
    camera
        Number of the camera: 0 and 1 are grey, 2 and 3 are in colour. By default the first whose images are there.
    radius_px
        Largest distance from a feature to the nearest pixel with depth, px, where there are Velodyne scans.
    time_unit
        Unit of the times of images: s, ms, us or ns; by default seconds, at 1 to 1,000 Hz.
    """

    name: ClassVar[str] = "kitti-odometry"
    description: ClassVar[str] = "KITTI odometry: rectified cameras, poses; depth from Velodyne scans where they are"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    camera: Annotated[int, Ge(0), Le(CAMERAS[-1])] | None = None
    radius_px: NotNegative = 1.0
    time_unit: TimeUnit | None = None

    def __post_init__(self) -> None:
        require_bounds(self)

    def sequences(self) -> list[SequenceId]:
        """All sequences with poses, sorted."""
        courses = find_courses(self.root)
        posed = [name for name, course in courses.items() if course.poses.exists()]
        if not posed:
            found = f"{counted(len(courses), 'sequence')} without poses"
            raise DataError(self.root, found, f"files such as {courses[min(courses)].poses}")
        return [SequenceId(self.name, scene) for scene in posed]

    def excluded_scenes(self) -> dict[str, str]:
        """The sequences without poses, such as those that the benchmark tests on."""
        courses = find_courses(self.root)
        return {name: f"no poses in {course.poses}" for name, course in courses.items() if not course.poses.exists()}

    def recordings(self) -> list[SequenceId]:
        """All sequences, those without poses too, sorted: see `ImageReader.recordings`."""
        return [SequenceId(self.name, scene) for scene in find_courses(self.root)]

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one sequence, except for its images and depths."""
        return self._opened(sequence, with_poses=True)

    def open_images(self, sequence: SequenceId) -> RecordedSequence:
        """The same without poses: see `ImageReader.open_images`."""
        return self._opened(sequence, with_poses=False)

    def _opened(self, sequence: SequenceId, *, with_poses: bool) -> RecordedSequence:
        courses = find_courses(self.root)
        scene_folder({name: course.folder for name, course in courses.items()}, sequence)
        course = courses[sequence.scene]
        number = course.first_camera if self.camera is None else self.camera
        frames = find_frames(course, number)
        P = read_projection(course.folder / CALIBRATION, number)
        camera = camera_of(P, frames.images)
        reference, pose_notes = no_poses(len(frames.images)), tuple[str, ...]()
        if with_poses:
            reference, pose_notes = read_reference_poses(course.poses, frames.numbers)
        reference_from_camera = invert(camera_from_reference(P))
        timestamps_s, time_notes = read_times(course.folder / TIMES, frames.numbers, self.time_unit)
        depth_of_scans = self._depth(course, number, frames.depths)
        return RecordedSequence(
            id=sequence,
            source=str(course.folder),
            camera=camera,
            world_from_camera=reference @ reference_from_camera,
            body=Body(reference_from_camera),
            poses_elsewhere=not with_poses,
            images=ImageFiles(frames.images, camera),
            depths=None if depth_of_scans is None else depth_files(frames.depths, camera, depth_of_scans),
            notes=(
                f"images are those of camera {number}",
                *pose_notes,
                *time_notes,
                *(depth_notes(frames.depths) if depth_of_scans else ()),
            ),
            timestamps_s=timestamps_s,
            time_unit_stated=self.time_unit is not None,
            second=_second(course, number, P, frames.numbers),
            z_depth_from=z_depth_from(frames.depths),
        )

    def _depth(self, course: Course, camera: int, scans: tuple[Path | None, ...]) -> KittiDepth | None:
        """What reads the depth of a frame from its scan; None where there are no scans."""
        if not any(scans):
            return None
        camera_from_velodyne: NDArray[np.float64] = read_camera_from_velodyne(course.folder / CALIBRATION, camera)
        return KittiDepth(self.radius_px, camera_from_velodyne)


def _second(course: Course, first: int, P: NDArray[np.float64], numbers: range) -> SecondCamera | None:
    """The other camera of a pair, 0 and 1 or 2 and 3, if it has an image of each frame."""
    second = first ^ 1
    images = any_numbered_files(course.images(second), IMAGE_NAME)
    if not images.keys() >= {*numbers}:
        return None
    second_P, paths = read_projection(course.folder / CALIBRATION, second), tuple(images[number] for number in numbers)
    return second_camera(P, second_P, paths)
