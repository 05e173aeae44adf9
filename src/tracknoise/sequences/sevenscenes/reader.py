"""The reader of 7-Scenes: see docs/formats/sevenscenes.md.

Layout of a scene: ``frame-NNNNNN.color.png`` (or .jpg), ``frame-NNNNNN.depth.png`` (16 bit, millimetres) and
``frame-NNNNNN.pose.txt`` (4x4, world_from_camera; NaN or infinity where the pose is unknown);
``camera-intrinsics.txt`` (3x3) there or in a folder above.
"""

import re
from dataclasses import KW_ONLY, dataclass
from enum import StrEnum
from itertools import compress
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import require
from tracknoise.geometry.pose import invert
from tracknoise.sequences.frame_files import ImageFiles, depth_notes
from tracknoise.sequences.images import first_readable, image_size
from tracknoise.sequences.poses import checked_poses, read_matrix, require_poses
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.scenes import find_scenes, numbered_files, parent_of, require_unbroken, scene_folder
from tracknoise.sequences.sevenscenes.calibration import COLOUR_FOCAL_PX, Calibration, Cameras, find_cameras
from tracknoise.sequences.sevenscenes.depths import find_depths
from tracknoise.sequences.sevenscenes.sfm import read_sfm_poses
from tracknoise.tables.identity import SequenceId

_POSE = re.compile(r"frame-(\d+)\.pose\.txt")
_FRAMES_PER_S = 30.0
_TIMES = f"the recording has no times: {_FRAMES_PER_S:g} frames per second are assumed, the nominal rate of the Kinect"


class Poses(StrEnum):
    """Whose poses are used."""

    kinectfusion = "kinectfusion"
    sfm = "sfm"


@dataclass(frozen=True, slots=True)
class SevenScenes:
    """Reader of 7-Scenes.

    Parameters
    ----------
    root
        The data set's folder, or one below, down to that of a single sequence.
    calibration
        Whether depth and poses are `registered` to the colour camera, or used as recorded (`raw`), as if colour and
        depth were one camera.
    poses
        The recorded ones of `kinectfusion`, or those of structure from motion (`sfm`), from `sfm_file`.
    sfm_file
        Published poses from structure from motion: a file, or a folder of files such as `chess_train.txt`.

    Raises
    ------
    ValueError
        If options contradict each other.
    """

    name: ClassVar[str] = "sevenscenes"
    description: ClassVar[str] = "7-Scenes: hand-held Kinect in rooms, depth in mm, KinectFusion poses"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    calibration: Calibration = Calibration.registered
    poses: Poses = Poses.kinectfusion
    sfm_file: Path | None = None

    def __post_init__(self) -> None:
        sfm = self.poses is Poses.sfm
        require(sfm == (self.sfm_file is not None), "sfm_file", self.sfm_file, "a file with poses = 'sfm', else none")
        is_registered = self.calibration is Calibration.registered
        require(is_registered or not sfm, "calibration", str(self.calibration), "'registered' with poses = 'sfm'")

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
        images, poses, depths, numbers = _frame_files(folder)
        cameras, world_from_camera, notes = self._geometry(folder, images, poses)
        return RecordedSequence(
            id=sequence,
            source=str(folder),
            camera=cameras.colour,
            world_from_camera=world_from_camera,
            images=ImageFiles(images, cameras.colour),
            depths=find_depths(depths, cameras),
            notes=(*notes, *depth_notes(depths), _TIMES),
            timestamps_s=(np.array(numbers) - numbers[0]) / _FRAMES_PER_S,
            group=parent_of(sequence.scene),
        )

    def _scenes(self) -> dict[str, Path]:
        expected = "folders of frame-NNNNNN.pose.txt files"
        return find_scenes(self.root, lambda _, files: any(map(_POSE.fullmatch, files)), expected=expected)

    def _geometry(
        self, folder: Path, images: tuple[Path, ...], poses: tuple[Path, ...]
    ) -> tuple[Cameras, NDArray[np.float64], tuple[str, ...]]:
        """Cameras, poses (n, 4, 4) of the camera of the images, and what was assumed or corrected."""
        if self.sfm_file is None:
            cameras = self._cameras(folder, images, COLOUR_FOCAL_PX)
            recorded, notes = _read_poses(poses)
            return cameras, _of_colour(recorded, cameras), (*cameras.notes, *notes)
        found = read_sfm_poses(self.sfm_file, images)
        cameras = self._cameras(folder, images, found.focal_px)
        note = f"poses and focal length ({found.focal_px:g} px) are from structure from motion: {self.sfm_file}"
        return cameras, found.world_from_camera, (*cameras.notes, note)

    def _cameras(self, folder: Path, images: tuple[Path, ...], colour_focal_px: float) -> Cameras:
        """Intrinsics from the nearest file, from the scene's folder up to the root, or else the Kinect's."""
        image = first_readable(images)
        levels = [level for level in (folder, *folder.parents) if self.root in (level, *level.parents)]
        size = image_size(image)
        return find_cameras(levels, image, size, calibration=self.calibration, colour_focal_px=colour_focal_px)


def _of_colour(world_from_depth: NDArray[np.float64], cameras: Cameras) -> NDArray[np.float64]:
    """Poses of the colour camera, from those of the depth camera, (n, 4, 4)."""
    if cameras.colour_from_depth is None:
        return world_from_depth
    return np.asarray(world_from_depth @ invert(cameras.colour_from_depth))


def _frame_files(folder: Path) -> tuple[tuple[Path, ...], tuple[Path, ...], tuple[Path | None, ...], range]:
    """Image, pose and (where there is one) depth of each frame, and the numbers of the frames."""
    images = numbered_files(folder, r"frame-(\d+)\.color\.(?:png|jpg)")
    depths = numbered_files(folder, r"frame-(\d+)\.depth\.png")
    poses = numbered_files(folder, _POSE.pattern)
    frames = require_unbroken(images, depths, lambda number: folder / f"frame-{number:06d}.color.png")
    for number in frames:
        if number not in poses:
            require_poses(folder / f"frame-{number:06d}.pose.txt", poses=len(poses), images=len(frames))
    in_order = [(images[number], poses[number], depths.get(number)) for number in frames]
    image_paths, pose_paths, depth_paths = zip(*in_order, strict=True)
    return image_paths, pose_paths, depth_paths, frames


def _read_poses(paths: tuple[Path, ...]) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """(n, 4, 4) float64, and what was corrected; all NaN where a file has numbers that are not finite."""
    poses = np.stack([read_matrix(path, size=4) for path in paths])
    known = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
    poses[~known] = np.nan
    poses[known], notes = checked_poses(poses[known], list(compress(paths, known)))
    return poses, notes
