"""The reader of the KITTI odometry benchmark: see docs/formats/kitti-odometry.md."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, require_bounds
from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.geometry.pose import invert
from tracknoise.printable import counted
from tracknoise.sequences.frame_files import ImageFiles, depth_files, depth_notes
from tracknoise.sequences.images import first_readable, image_size
from tracknoise.sequences.kitti.depth import KittiDepth, z_depth_from
from tracknoise.sequences.kitti.odometry_calibration import (
    read_camera_from_velodyne,
    read_projection,
    read_reference_poses,
    read_times,
)
from tracknoise.sequences.kitti.odometry_layout import (
    CALIBRATION,
    CAMERAS,
    IMAGE_NAME,
    TIMES,
    Course,
    find_courses,
    find_frames,
)
from tracknoise.sequences.kitti.values import camera_from_reference
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.scenes import numbered_files, scene_folder
from tracknoise.sequences.sequence import SecondCamera
from tracknoise.tables.identity import SequenceId


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

    Raises
    ------
    ValueError
        If an option has an impossible value.
    """

    name: ClassVar[str] = "kitti-odometry"
    description: ClassVar[str] = "KITTI odometry: rectified cameras, poses; depth from Velodyne scans where they are"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    camera: Annotated[int, Ge(0), Le(CAMERAS[-1])] | None = None
    radius_px: NotNegative = 1.0

    def __post_init__(self) -> None:
        require_bounds(self)

    def sequences(self) -> list[SequenceId]:
        """All sequences with poses, sorted.

        Raises
        ------
        DataError
            If there is none.
        """
        courses = find_courses(self.root)
        posed = [name for name, course in courses.items() if course.poses.exists()]
        if not posed:
            found = f"{counted(len(courses), 'sequence')} without poses"
            raise DataError(self.root, found, f"files such as {courses[min(courses)].poses}")
        return [SequenceId(self.name, scene) for scene in posed]

    def excluded_scenes(self) -> dict[str, str]:
        """The sequences without poses, such as those that the benchmark tests on.

        Raises
        ------
        DataError
            If there is no sequence.
        """
        courses = find_courses(self.root)
        return {name: f"no poses in {course.poses}" for name, course in courses.items() if not course.poses.exists()}

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one sequence, except for its images and depths.

        Raises
        ------
        DataError
            If a file is missing or damaged, or there are fewer poses or times than images.
        UnknownNameError
            If there is no such sequence or lighting.
        """
        courses = find_courses(self.root)
        scene_folder({name: course.folder for name, course in courses.items()}, sequence)
        course = courses[sequence.scene]
        number = course.first_camera if self.camera is None else self.camera
        frames = find_frames(course, number)
        P = read_projection(course.folder / CALIBRATION, number)
        camera = _camera(P, frames.images)
        reference, pose_notes = read_reference_poses(course.poses, frames.numbers)
        timestamps_s, time_notes = read_times(course.folder / TIMES, frames.numbers)
        depth_of_scans = self._depth(course, number, frames.scans)
        return RecordedSequence(
            id=sequence,
            source=str(course.folder),
            camera=camera,
            world_from_camera=reference @ invert(camera_from_reference(P)),
            images=ImageFiles(frames.images, camera),
            depths=None if depth_of_scans is None else depth_files(frames.scans, camera, depth_of_scans),
            notes=(
                f"images are those of camera {number}",
                *pose_notes,
                *time_notes,
                *(depth_notes(frames.scans) if depth_of_scans else ()),
            ),
            timestamps_s=timestamps_s,
            second=_second(course, number, P, frames.numbers),
            z_depth_from=z_depth_from(frames.scans),
        )

    def _depth(self, course: Course, camera: int, scans: tuple[Path | None, ...]) -> KittiDepth | None:
        """What reads the depth of a frame from its scan; None where there are no scans."""
        if not any(scans):
            return None
        camera_from_velodyne: NDArray[np.float64] = read_camera_from_velodyne(course.folder / CALIBRATION, camera)
        return KittiDepth(self.radius_px, camera_from_velodyne)


def _camera(P: NDArray[np.float64], images: tuple[Path, ...]) -> Camera:
    (fx, _, cx), (_, fy, cy), _ = P[:, :3].tolist()
    return Camera(*image_size(first_readable(images)), fx, fy, cx, cy)


def _second(course: Course, first: int, P: NDArray[np.float64], numbers: range) -> SecondCamera | None:
    """The other camera of a pair, 0 and 1 or 2 and 3, if it has an image of each frame."""
    other = first ^ 1
    images = numbered_files(course.images(other), IMAGE_NAME) if course.images(other).exists() else {}
    if not images.keys() >= {*numbers}:
        return None
    other_P, paths = read_projection(course.folder / CALIBRATION, other), tuple(images[number] for number in numbers)
    camera = _camera(other_P, paths)
    first_from_second = camera_from_reference(P) @ invert(camera_from_reference(other_P))
    return SecondCamera(camera, first_from_second, ImageFiles(paths, camera))
