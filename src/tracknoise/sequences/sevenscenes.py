"""7-Scenes (Shotton et al., CVPR 2013): hand-held Kinect, rooms, poses by KinectFusion.

Layout of a scene: ``frame-NNNNNN.color.png`` (or .jpg), ``frame-NNNNNN.depth.png`` (16 bit, millimetres) and
``frame-NNNNNN.pose.txt`` (4x4, world_from_camera; NaN or infinity where the pose is unknown);
``camera-intrinsics.txt`` (3x3) there or in a folder above.
"""

import re
from dataclasses import dataclass
from functools import partial
from itertools import compress
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.camera import Camera
from tracknoise.sequences.frame_files import ImageFiles, depth_files, depth_notes
from tracknoise.sequences.images import first_readable, image_size, read_depth_png16
from tracknoise.sequences.poses import checked_poses, read_matrix, require_poses
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.scenes import find_scenes, numbered_files, parent_of, require_unbroken, scene_folder
from tracknoise.tables.identity import SequenceId

_POSE = re.compile(r"frame-(\d+)\.pose\.txt")
_INTRINSICS = "camera-intrinsics.txt"
_KINECT_SIZE = (640, 480)
_KINECT = (585.0, 585.0, 320.0, 240.0)
_ONE_CAMERA = "colour and depth are assumed to share one camera: the data set does not give their calibration"
_read_depth = partial(read_depth_png16, metres_per_unit=0.001)


@dataclass(frozen=True, slots=True)
class SevenScenes:
    """Reader of 7-Scenes.

    Parameters
    ----------
    root
        The data set's folder, or one below, down to that of a single sequence.
    """

    name: ClassVar[str] = "sevenscenes"
    description: ClassVar[str] = "7-Scenes: hand-held Kinect in rooms, depth in mm, KinectFusion poses"
    needs_root: ClassVar[bool] = True

    root: Path

    def sequences(self) -> list[SequenceId]:
        """All sequences, sorted: each folder of ``frame-NNNNNN.pose.txt`` files.

        Raises
        ------
        DataError
            If there is none.
        """
        return [SequenceId(self.name, scene) for scene in self._scenes()]

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one sequence, except for its images and depths.

        Raises
        ------
        DataError
            If an image or pose file is missing or damaged, fewer than two frames have a pose, or the intrinsics cannot
            be used.
        UnknownNameError
            If there is no such scene or lighting.
        """
        folder = scene_folder(self._scenes(), sequence)
        images, poses, depths = _frame_files(folder)
        camera, camera_notes = self._camera(folder, first_readable(images))
        world_from_camera, pose_notes = _read_poses(poses)
        return RecordedSequence(
            id=sequence,
            source=str(folder),
            camera=camera,
            world_from_camera=world_from_camera,
            images=ImageFiles(images, camera),
            depths=depth_files(depths, camera, _read_depth),
            notes=(*camera_notes, *pose_notes, *depth_notes(depths), _ONE_CAMERA),
            group=parent_of(sequence.scene),
        )

    def _scenes(self) -> dict[str, Path]:
        expected = "folders of frame-NNNNNN.pose.txt files"
        return find_scenes(self.root, lambda _, files: any(map(_POSE.fullmatch, files)), expected=expected)

    def _camera(self, folder: Path, image: Path) -> tuple[Camera, tuple[str, ...]]:
        """Intrinsics from the nearest file, from the scene's folder up to the root, or else the Kinect's."""
        width, height = image_size(image)
        levels = [level for level in (folder, *folder.parents) if self.root in (level, *level.parents)]
        file = next((level / _INTRINSICS for level in levels if (level / _INTRINSICS).exists()), None)
        if file is None and (width, height) != _KINECT_SIZE:
            raise DataError(image, f"size {width}x{height} and no {_INTRINSICS}", "640x480 or that file")
        fx, fy, cx, cy = _KINECT if file is None else _read_intrinsics(file)
        assumed = f"{folder}: no {_INTRINSICS}, so the Kinect's fx = fy = 585, cx = 320, cy = 240 are assumed"
        return Camera(width, height, fx, fy, cx, cy), () if file else (assumed,)


def _frame_files(folder: Path) -> tuple[tuple[Path, ...], tuple[Path, ...], tuple[Path | None, ...]]:
    """Image, pose and (where there is one) depth of each frame."""
    images = numbered_files(folder, r"frame-(\d+)\.color\.(?:png|jpg)")
    depths = numbered_files(folder, r"frame-(\d+)\.depth\.png")
    poses = numbered_files(folder, _POSE.pattern)
    frames = require_unbroken(images, depths, lambda number: folder / f"frame-{number:06d}.color.png")
    for number in frames:
        if number not in poses:
            require_poses(folder / f"frame-{number:06d}.pose.txt", poses=len(poses), images=len(frames))
    in_order = [(images[number], poses[number], depths.get(number)) for number in frames]
    image_paths, pose_paths, depth_paths = zip(*in_order, strict=True)
    return image_paths, pose_paths, depth_paths


def _read_poses(paths: tuple[Path, ...]) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """(n, 4, 4) float64, and what was corrected; all NaN where a file has numbers that are not finite."""
    poses = np.stack([read_matrix(path, size=4) for path in paths])
    known = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
    poses[~known] = np.nan
    poses[known], notes = checked_poses(poses[known], list(compress(paths, known)))
    return poses, notes


def _read_intrinsics(path: Path) -> tuple[float, float, float, float]:
    """The focal lengths and principal point fx, fy, cx, cy."""
    matrix = read_matrix(path, size=3)
    fx, fy, cx, cy = matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
    pinhole = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    if not (np.isfinite(matrix).all() and np.array_equal(matrix, pinhole) and fx > 0 and fy > 0):
        raise DataError(path, "no pinhole camera", "rows fx 0 cx, 0 fy cy and 0 0 1, with fx and fy above 0")
    return fx, fy, cx, cy
