"""The reader of 7-Scenes (Shotton et al., CVPR 2013): see docs/formats.md.

Layout of a scene: ``frame-NNNNNN.color.png`` (or .jpg), ``frame-NNNNNN.depth.png`` (16 bit, millimetres) and
``frame-NNNNNN.pose.txt`` (4x4, world_from_camera; NaN or infinity where the pose is unknown);
``camera-intrinsics.txt`` (3x3) there or in a folder above.

Poses from structure from motion were published later (Brachmann et al., ICCV 2021). Each row has the name of an image,
camera_from_world as a quaternion (scalar first) and a translation in metres, and the focal length of the colour camera
in px. There is one file per place and half of the data set, such as ``chess_train.txt``; images are named
``seq-01/frame-000000.color.png``.
"""

import re
from dataclasses import KW_ONLY, dataclass, replace
from enum import StrEnum
from functools import partial
from glob import escape
from itertools import compress
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import require
from tracknoise.exceptions import DataError
from tracknoise.foreign_files import is_folder, read_text
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap, reproject_depth
from tracknoise.geometry.pose import invert, nearest_rigid
from tracknoise.sequences.images import first_readable, image_size, read_depth_png16
from tracknoise.sequences.poses import checked_poses, no_poses, numbers, quaternion_poses, read_matrix, require_poses
from tracknoise.sequences.recorded import DepthFiles, ImageFiles, RecordedSequence, depth_files, depth_notes
from tracknoise.sequences.scenes import (
    SceneReader,
    find_scenes,
    numbered_files,
    parent_of,
    require_unbroken,
    scene_folder,
)
from tracknoise.sequences.sequence import Body
from tracknoise.tables.identity import SequenceId

INTRINSICS = "camera-intrinsics.txt"
COLOUR_FOCAL_PX = 525.0
"""Focal length of the colour camera, px; structure from motion finds 525.1 to 527.7 px, by scene."""

_SIZE = (640, 480)
_DEPTH = Camera(*_SIZE, 585.0, 585.0, 320.0, 240.0)
_SAME_FOCAL = 0.01
"""Largest relative difference from the published focal length at which a file gives the depth camera's."""

_COLOUR_FROM_DEPTH = (
    (0.999965180, 0.0026765126, -0.0079041012, -0.0255589432),
    (-0.0027409311, 0.9999630280, -0.0081504521, 0.000101096),
    (0.0078819942, 0.0081718329, 0.9999355456, 0.0020318322),
    (0.0, 0.0, 0.0, 1.0),
)
"""Calibration of a Kinect of the same type (LIRIS, Lyon), with which the data set is registered elsewhere too."""


class Calibration(StrEnum):
    """How colour, depth and poses belong together."""

    registered = "registered"
    raw = "raw"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Cameras:
    """The cameras of a recording."""

    colour: Camera  # of the images
    depth: Camera  # of the depth maps
    # (4, 4) float64, metres: from the frame of the depth camera, whose poses are recorded, to that of the colour
    # camera; None where both are one camera
    colour_from_depth: NDArray[np.float64] | None
    notes: tuple[str, ...]  # what was assumed, one sentence each


def find_cameras(
    folders: list[Path],
    image: Path,
    size: tuple[int, int],
    *,
    calibration: Calibration,
    colour_focal_px: float,
) -> Cameras:
    """The cameras of a recording, from the nearest file of intrinsics or else as published.

    A file with the depth camera's focal length describes the depth camera. Any other file describes one camera of
    colour and depth, and nothing is registered.
    """
    file = next((folder / INTRINSICS for folder in folders if (folder / INTRINSICS).exists()), None)
    if file is None and size != _SIZE:
        raise DataError(image, f"size {size[0]}x{size[1]} and no {INTRINSICS}", "640x480 or that file")
    given = _DEPTH if file is None else _read_camera(file, size)
    if calibration is Calibration.registered and size == _SIZE and _is_depth_camera(given):
        return _registered(given, colour_focal_px)
    return Cameras(colour=given, depth=given, colour_from_depth=None, notes=_one_camera(folders[0], file, calibration))


def _registered(depth: Camera, focal_px: float) -> Cameras:
    width, height = _SIZE
    colour = Camera(width, height, focal_px, focal_px, (width - 1) / 2, (height - 1) / 2)
    rigid, _ = nearest_rigid(np.array([_COLOUR_FROM_DEPTH]))
    note = (
        f"depth and poses are registered to the colour camera (focal length {focal_px:g} px, principal point in the "
        f"middle of the image) by a published calibration of the depth camera ({depth.fx:g} px) to the colour camera "
        "of a Kinect of the same type"
    )
    return Cameras(colour=colour, depth=depth, colour_from_depth=rigid[0], notes=(note,))


def _one_camera(folder: Path, file: Path | None, calibration: Calibration) -> tuple[str, ...]:
    """What is assumed where colour and depth are one camera."""
    if file is None:
        assumed = f"{folder}: no {INTRINSICS}, so the depth camera's fx = fy = 585, cx = 320, cy = 240 are assumed"
        return assumed, "colour and depth are assumed to share one camera"
    unknown = f"{file} does not give the depth camera's 585 px: "
    reason = "" if calibration is Calibration.raw else unknown
    return (f"{reason}colour and depth are assumed to share one camera",)


def _is_depth_camera(camera: Camera) -> bool:
    """Whether both focal lengths are those published for the depth camera."""
    return bool(np.allclose((camera.fx, camera.fy), _DEPTH.fx, rtol=_SAME_FOCAL, atol=0.0))


def _read_camera(path: Path, size: tuple[int, int]) -> Camera:
    matrix = read_matrix(path, size=3)
    fx, fy, cx, cy = matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
    pinhole = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    if not (np.isfinite(matrix).all() and np.array_equal(matrix, pinhole) and fx > 0 and fy > 0):
        raise DataError(path, "no pinhole camera", "rows fx 0 cx, 0 fy cy and 0 0 1, with fx and fy above 0")
    return Camera(*size, fx, fy, cx, cy)


_read_depth = partial(read_depth_png16, metres_per_unit=0.001)


@dataclass(frozen=True, slots=True, eq=False)
class RegisteredDepths:
    """Reads the depth map of a frame, and moves it into the image of the colour camera."""

    files: DepthFiles  # depth maps of the depth camera
    # depth, colour: both cameras
    depth: Camera
    colour: Camera
    colour_from_depth: NDArray[np.float64]  # (4, 4) float64, metres

    def __len__(self) -> int:
        return len(self.files)

    def __call__(self, index: int) -> DepthMap | None:
        """Depth of one frame in float32, or None where it has none: see `reproject_depth`."""
        depth = self.files(index)
        if depth is None:
            return None
        seen = reproject_depth(depth, self.depth, self.colour, self.colour_from_depth)
        return replace(seen, depth_m=seen.depth_m.astype(np.float32))  # half the memory of maps that are kept


def find_depths(paths: tuple[Path | None, ...], cameras: Cameras) -> DepthFiles | RegisteredDepths | None:
    """What reads the depths of a recording, as its images see them; None where no frame has any."""
    files = depth_files(paths, cameras.depth, _read_depth)
    if files is None or cameras.colour_from_depth is None:
        return files
    return RegisteredDepths(files, cameras.depth, cameras.colour, cameras.colour_from_depth)


_COLUMNS = "qw qx qy qz tx ty tz f"


def read_sfm_poses(path: Path, images: tuple[Path, ...]) -> tuple[NDArray[np.float64], float]:
    """Find the poses (n, 4, 4) of the colour camera, NaN for images without, and its median focal length, px."""
    rows: dict[str, tuple[str, NDArray[np.float64]]] = {}
    for file in _files(path, images[0].parent):
        _add_rows(rows, file)
    row_of_image = [rows.get(_name(image)) for image in images]
    posed = [index for index, row in enumerate(row_of_image) if row is not None]
    if len(posed) < min(2, len(images)):
        raise DataError(path, f"{len(posed)} of the images of {images[0].parent}", "rows for at least 2")
    places, values = zip(*(row for row in row_of_image if row is not None), strict=True)
    return _poses(np.stack(values), places, posed, len(images))


def _poses(
    values: NDArray[np.float64], places: tuple[str, ...], posed: list[int], count: int
) -> tuple[NDArray[np.float64], float]:
    focal_px = values[:, 7]
    for index in np.flatnonzero(~(np.isfinite(focal_px) & (focal_px > 0.0)))[:1]:
        raise DataError(places[index], f"a focal length of {focal_px[index]:g}", "a number above 0")
    poses = no_poses(count)
    poses[posed] = invert(quaternion_poses(values[:, 4:7], values[:, [1, 2, 3, 0]], places))
    return poses, float(np.median(focal_px))


def _files(path: Path, recording: Path) -> list[Path]:
    if not is_folder(path):
        return [path]
    place = recording.resolve().parent.name
    files = sorted(path.glob(f"{escape(place)}_*.txt"))
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
        name = _name(Path(image))
        if name in rows:
            raise DataError(place, f"{name} again", "one row per image")
        rows[name] = place, np.array(numbers(fields, _COLUMNS, place))


def _name(image: Path) -> str:
    """Sequence and frame of an image: seq-01/frame-000000."""
    return f"{image.parent.name}/{image.name.split('.')[0]}"


_POSE, _COLOUR = re.compile(r"frame-(\d+)\.pose\.txt"), re.compile(r"frame-(\d+)\.color\.(?:png|jpg)")
_FRAMES_PER_S = 30.0
_TIMES = f"the recording has no times: {_FRAMES_PER_S:g} frames per second are assumed, the nominal rate of the Kinect"


class Poses(StrEnum):
    """Whose poses are used."""

    kinectfusion = "kinectfusion"
    sfm = "sfm"


@dataclass(frozen=True, slots=True)
class SevenScenes(SceneReader):
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

    def recordings(self) -> list[SequenceId]:
        """All sequences, those without poses too, sorted: see `ImageReader.recordings`."""
        return [SequenceId(self.name, scene) for scene in self._folders(_COLOUR, "frame-NNNNNN.color.png")]

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one sequence, except for its images and depths."""
        folder = self._folder(sequence)
        images, depths, numbers = _frame_files(folder)
        geometry = self._geometry(folder, images, () if self.sfm_file is not None else _pose_files(folder, numbers))
        return self._opened(sequence, folder, images, depths, numbers, *geometry)

    def open_images(self, sequence: SequenceId) -> RecordedSequence:
        """The same without poses: see `ImageReader.open_images`."""
        folder = scene_folder(self._folders(_COLOUR, "frame-NNNNNN.color.png"), sequence)
        images, depths, numbers = _frame_files(folder)
        cameras = self._cameras(folder, images, COLOUR_FOCAL_PX)
        return self._opened(sequence, folder, images, depths, numbers, cameras, None, cameras.notes)

    def _opened(
        self,
        sequence: SequenceId,
        folder: Path,
        images: tuple[Path, ...],
        depths: tuple[Path | None, ...],
        numbers: range,
        cameras: Cameras,
        world_from_camera: NDArray[np.float64] | None,
        notes: tuple[str, ...],
    ) -> RecordedSequence:
        turned = cameras.colour_from_depth
        return RecordedSequence(
            id=sequence,
            source=str(folder),
            camera=cameras.colour,
            world_from_camera=no_poses(len(images)) if world_from_camera is None else world_from_camera,
            poses_elsewhere=world_from_camera is None,
            body=None if turned is None else Body(invert(turned)),
            images=ImageFiles(images, cameras.colour),
            depths=find_depths(depths, cameras),
            notes=(*notes, *depth_notes(depths), _TIMES),
            timestamps_s=(np.array(numbers) - numbers[0]) / _FRAMES_PER_S,
            time_unit_stated=True,
            group=parent_of(sequence.scene),
        )

    def _scenes(self) -> dict[str, Path]:
        return self._folders(_POSE, "frame-NNNNNN.pose.txt")

    def _folders(self, pattern: re.Pattern[str], name: str) -> dict[str, Path]:
        """Folders with a file of a pattern."""
        expected = f"folders of {name} files"
        return find_scenes(self.root, lambda _, files: any(map(pattern.fullmatch, files)), expected=expected)

    def _geometry(
        self, folder: Path, images: tuple[Path, ...], poses: tuple[Path, ...]
    ) -> tuple[Cameras, NDArray[np.float64], tuple[str, ...]]:
        """Cameras, poses (n, 4, 4) of the camera of the images, and what was assumed or corrected."""
        if self.sfm_file is None:
            cameras = self._cameras(folder, images, COLOUR_FOCAL_PX)
            recorded, notes = _read_poses(poses)
            return cameras, _of_colour(recorded, cameras), (*cameras.notes, *notes)
        poses_of_images, focal_px = read_sfm_poses(self.sfm_file, images)
        cameras = self._cameras(folder, images, focal_px)
        note = f"poses and focal length ({focal_px:g} px) are from structure from motion: {self.sfm_file}"
        return cameras, poses_of_images, (*cameras.notes, note)

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


def _frame_files(folder: Path) -> tuple[tuple[Path, ...], tuple[Path | None, ...], range]:
    """Image and (where there is one) depth of each frame, and the numbers of the frames."""
    images = numbered_files(folder, _COLOUR.pattern)
    depths = numbered_files(folder, r"frame-(\d+)\.depth\.png")
    frames = require_unbroken(images, depths, lambda number: folder / f"frame-{number:06d}.color.png")
    return tuple(images[number] for number in frames), tuple(map(depths.get, frames)), frames


def _pose_files(folder: Path, frames: range) -> tuple[Path, ...]:
    """File of the pose of each frame."""
    poses = numbered_files(folder, _POSE.pattern)
    for number in frames:
        if number not in poses:
            require_poses(folder / f"frame-{number:06d}.pose.txt", poses=len(poses), images=len(frames))
    return tuple(poses[number] for number in frames)


def _read_poses(paths: tuple[Path, ...]) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """(n, 4, 4) float64, and what was corrected; all NaN where a file has numbers that are not finite."""
    poses = np.stack([read_matrix(path, size=4) for path in paths])
    posed = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
    poses[~posed] = np.nan
    poses[posed], notes = checked_poses(poses[posed], list(compress(paths, posed)))
    return poses, notes
