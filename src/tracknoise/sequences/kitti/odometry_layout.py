"""Where the files of the KITTI odometry benchmark lie, and of what is written like it.

A sequence is a folder ``sequences/NN`` with ``calib.txt``, ``times.txt`` and ``image_0`` to ``image_3``. Its poses are
in ``poses/NN.txt`` beside ``sequences``, or in its own ``poses.txt``.
"""

import os
from dataclasses import dataclass
from pathlib import Path

from tracknoise.exceptions import DataError
from tracknoise.sequences.scenes import find_scenes, numbered_files, require_unbroken

CALIBRATION, TIMES = "calib.txt", "times.txt"
_POSES, _VELODYNE = "poses", "velodyne"


@dataclass(frozen=True, slots=True)
class Course:
    """The files of one sequence.

    Parameters
    ----------
    folder
        Its own folder.
    """

    folder: Path

    @property
    def poses(self) -> Path:
        """The file of poses, which may be missing."""
        # resolve() would follow a link to a sequence that lies apart from its poses
        folder = Path(os.path.abspath(self.folder))  # noqa: PTH100
        beside = folder.parent.parent / _POSES / f"{folder.name}.txt"
        own = self.folder / f"{_POSES}.txt"
        return own if own.exists() and not beside.exists() else beside

    def images(self, camera: int) -> Path:
        """The folder of a camera's images."""
        return self.folder / f"image_{camera}"


@dataclass(frozen=True, slots=True)
class CourseFrames:
    """The frames of one sequence.

    Attributes
    ----------
    numbers
        Of the frames, without a gap.
    images
        An image for each.
    scans
        For each its Velodyne scan, or None.
    """

    numbers: range
    images: tuple[Path, ...]
    scans: tuple[Path | None, ...]


def find_courses(root: Path) -> dict[str, Course]:
    """Find the sequences in or below a folder, by the names of their folders, sorted.

    Raises
    ------
    DataError
        If there is none, or two have one name.
    """
    expected = f"sequences: folders with {CALIBRATION} and image_0 to image_3"
    folders = find_scenes(
        root,
        lambda below, files: CALIBRATION in files and any(f"image_{camera}" in below for camera in range(4)),
        expected=expected,
    )
    courses: dict[str, Course] = {}
    for scene, folder in folders.items():
        name = scene.rpartition("/")[2]
        if name in courses:
            raise DataError(folder, f"the sequence {name} again, which is also in {courses[name].folder}", "it once")
        courses[name] = Course(folder)
    return dict(sorted(courses.items()))


def find_frames(course: Course, camera: int) -> CourseFrames:
    """Find the frames of a sequence.

    Raises
    ------
    DataError
        Naming the first image that is missing where there are others around it, or the camera's folder.
    """
    folder, scans = course.images(camera), course.folder / _VELODYNE
    images = numbered_files(folder, r"(\d+)\.(?:png|jpe?g)")
    numbers = require_unbroken(images, (), lambda number: folder / f"{number:06d}.png")
    scan_of = numbered_files(scans, r"(\d+)\.bin") if scans.exists() else {}
    return CourseFrames(numbers, tuple(images.values()), tuple(map(scan_of.get, numbers)))
