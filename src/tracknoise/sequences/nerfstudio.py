"""The reader of data sets of nerfstudio: see docs/formats.md."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import KW_ONLY, dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import Positive, require_bounds
from tracknoise.exceptions import DataError
from tracknoise.foreign_files import is_regular_file, natural_order, read_json_object
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.camera_files import CameraFile, checked_camera
from tracknoise.sequences.entries import Entries
from tracknoise.sequences.images import (
    first_readable,
    image_size,
    numpy_size,
    read_enlarged_depth_npy,
    read_enlarged_depth_png16,
)
from tracknoise.sequences.poses import checked_poses
from tracknoise.sequences.recorded import (
    ImageFiles,
    RecordedSequence,
    chosen_folder,
    depth_files,
    depth_notes,
    folders_of,
)
from tracknoise.sequences.scenes import SceneReader, find_scenes, parent_of
from tracknoise.sequences.sequence import OPENGL_AXES
from tracknoise.tables.identity import SequenceId

CORNER_PX = 0.5
"""nerfstudio puts (0, 0) at the corner of the first pixel, and tracknoise at its centre."""

_LENSES = {
    "pinhole": "pinhole",
    "simple_pinhole": "pinhole",
    "perspective": "radtan",
    "simple_radial": "radtan",
    "radial": "radtan",
    "opencv": "radtan",
    "opencv_fisheye": "equidistant",
}
_FISHEYE_FLAG = "is_fisheye"


_KEYS = ("w", "h", "fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "k4", "p1", "p2")
_OTHER_KEYS = ("camera_model", "camera_angle_x", "camera_angle_y", _FISHEYE_FLAG)


def intrinsics_in(values: Mapping[str, Any]) -> dict[str, Any]:
    """What an object says about its camera, by key; null says nothing."""
    return {key: values[key] for key in (*_KEYS, *_OTHER_KEYS) if values.get(key) is not None}


def camera_of(entries: Entries, size: tuple[int, int]) -> CameraModel:
    """The camera of a frame."""
    width, height = _stated_size(entries, size)
    fl_x, fl_y = _focal_lengths(entries, width, height)
    cx = entries.number("cx") if entries.name("cx") else width / 2
    cy = entries.number("cy") if entries.name("cy") else height / 2
    lens = _lens(entries)
    intrinsics = (fl_x, fl_y, cx - CORNER_PX, cy - CORNER_PX)
    return checked_camera(entries.place, lens, (width, height), intrinsics, _coefficients(entries, lens))


def _stated_size(entries: Entries, size: tuple[int, int]) -> tuple[int, int]:
    width, height = (
        int(_whole(entries, name)) if entries.name(name) else of_image
        for name, of_image in zip("wh", size, strict=True)
    )
    return width, height


def _whole(entries: Entries, name: str) -> float:
    """A whole number above 0, which may be written as 640.0."""
    number = entries.number(name, positive=True)
    if not number.is_integer():
        raise entries.error(name, "a whole number")
    return number


def _focal_lengths(entries: Entries, width: int, height: int) -> tuple[float, float]:
    """fl_x and fl_y, or those of the angles of view; fl_y is fl_x where nothing is said of it."""
    fl_x = _focal_length(entries, "fl_x", "camera_angle_x", width)
    fl_y = _focal_length(entries, "fl_y", "camera_angle_y", height)
    if fl_x is None and fl_y is None:
        raise DataError(entries.place, "no fl_x and no camera_angle_x", "one of them")
    return fl_x or fl_y or math.nan, fl_y or fl_x or math.nan


def _focal_length(entries: Entries, name: str, angle_name: str, side: int) -> float | None:
    if entries.name(name):
        return entries.number(name, positive=True)
    if not entries.name(angle_name):
        return None
    angle = entries.number(angle_name, positive=True)
    if angle >= math.pi:
        raise entries.error(angle_name, "an angle below pi, in radians")
    return side / (2.0 * math.tan(angle / 2.0))


def _lens(entries: Entries) -> str:
    if entries.values.get(_FISHEYE_FLAG) is True:
        return "equidistant"
    if not entries.name("camera_model"):
        return "radtan"
    lens = _LENSES.get(entries.text("camera_model"))
    if lens is None:
        raise entries.error("camera_model", f"one of {', '.join(_LENSES).upper()}")
    return lens


def _coefficients(entries: Entries, lens: str) -> tuple[float, ...]:
    """Coefficients as the lens model has them; none of a lens without distortion."""
    k1, k2, k3, k4, p1, p2 = (
        entries.number(name) if entries.name(name) else 0.0 for name in ("k1", "k2", "k3", "k4", "p1", "p2")
    )
    if lens == "equidistant":
        return k1, k2, k3, k4
    if lens == "pinhole" or not any((k1, k2, k3, k4, p1, p2)):
        return ()
    if k4:
        raise entries.error("k4", "0, since OpenCV's model has no such coefficient")
    return (k1, k2, p1, p2, k3) if k3 else (k1, k2, p1, p2)


_FILES = ("transforms.json", "transforms_train.json")
_CV_FROM_GL = np.diag([1.0, -1.0, -1.0, 1.0])
"""nerfstudio's cameras look along -z with y up, as those of OpenGL do."""
_UNIT_KEYS = ("depth_unit_scale_factor", "integer_depth_scale")
_MILLIMETRE = 0.001
_SUFFIXES = ("", ".png", ".jpg", ".jpeg")
_SCALE = "applied_scale"
_APPLIED = ("applied_transform", _SCALE)
_EXPECTED = "fl_x, fl_y, cx, cy and frames in JSON"


class DepthFiles(StrEnum):
    """Whether the depth files that are listed are read."""

    listed = "listed"
    none = "none"


@dataclass(frozen=True, slots=True)
class _Frame:
    entries: Entries
    name: str
    image: Path
    depth: Path | None


@dataclass(frozen=True, slots=True)
class Nerfstudio(SceneReader):
    """Reader of nerfstudio's ``transforms.json``, which Instant NGP and the original NeRF use too.

    Parameters
    ----------
    root
        Folder of ``transforms.json``, or a folder with several at any depth.
    file
        Name of the file; by default ``transforms.json``, or else ``transforms_train.json``.
    folder
        Which folder of images, where it lists images of several.
    depth_files
        Whether depth files are read.
    depth_unit_m
        Depth of the number 1 in depth files, metres; by default what the file says, or 0.001. ``applied_scale`` of the
        file multiplies it, as it did the positions.
    """

    name: ClassVar[str] = "nerfstudio"
    description: ClassVar[str] = "nerfstudio, Instant NGP and NeRF: transforms.json with images, depth if there is"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    file: str | None = None
    folder: str | None = None
    depth_files: DepthFiles = DepthFiles.listed
    depth_unit_m: Positive | None = None

    def __post_init__(self) -> None:
        require_bounds(self)

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one data set, except for its images and depths."""
        folder = self._folder(sequence)
        path = next(folder / name for name in self._files() if is_regular_file(folder / name))
        common = Entries(path, read_json_object(path, _EXPECTED))
        frames, missing = _existing(self._of_one_folder(common.place, _frames(common)))
        cameras = _cameras(common, frames)
        poses, pose_notes = _poses(frames)
        listed = self.depth_files is DepthFiles.listed
        depths = tuple(frame.depth if listed else None for frame in frames)
        read_depth = partial(_read_depth, metres_per_unit=self._unit_m(common))
        return RecordedSequence(
            id=sequence,
            source=str(path),
            camera=cameras[0],
            world_from_camera=poses,
            images=ImageFiles(tuple(frame.image for frame in frames), cameras[0]),
            depths=depth_files(depths, cameras[0], read_depth),
            notes=(
                *missing,
                *CameraFile(cameras[0]).notes,
                *pose_notes,
                *(depth_notes(depths) if any(depths) else ()),
                *_enlarged_notes(depths, cameras[0]),
                *self._notes(common, depths),
            ),
            caveats=missing,
            cameras=cameras if len(set(cameras)) > 1 else None,
            group=parent_of(sequence.scene),
            recorded_axes=OPENGL_AXES,
        )

    def _of_one_folder(self, place: str | Path, frames: list[_Frame]) -> list[_Frame]:
        """The frames whose images lie in the chosen folder, or in the only one: each camera has one."""
        chosen = chosen_folder((frame.name for frame in frames), self.folder, place)
        return [frame for frame in frames if folders_of([frame.name]) == [chosen]]

    def _files(self) -> tuple[str, ...]:
        return _FILES if self.file is None else (self.file,)

    def _scenes(self) -> dict[str, Path]:
        names = self._files()
        expected = f"folders with {' or '.join(names)}"
        return find_scenes(self.root, lambda _, files: not {*names}.isdisjoint(files), expected=expected)

    def _unit_m(self, common: Entries) -> float:
        """Depth of the number 1 in the unit of the poses."""
        name = common.name(*_UNIT_KEYS)
        stated = _MILLIMETRE if name is None else common.number(name, positive=True)
        return _applied_scale(common) * (stated if self.depth_unit_m is None else self.depth_unit_m)

    def _notes(self, common: Entries, depths: tuple[Path | None, ...]) -> Iterator[str]:
        yield "images are in the order of their names, and taken as consecutive frames of one camera path"
        if any(depths):
            scale = _applied_scale(common)
            scaled = f": they are multiplied by applied_scale, {scale:g}, as positions were" if scale != 1.0 else ""
            yield f"the unit of depth files is {self._unit_m(common):g} m{scaled}"
        applied = [name for name in _APPLIED if name in common.values]
        stays = f"; {' and '.join(applied)} stays applied" if applied else ""
        yield f"lengths are in the unit of the poses, which need not be metres{stays}"


def _applied_scale(common: Entries) -> float:
    """By how much positions were multiplied when the file was written; depth files were not."""
    stated = common.values.get(_SCALE) is not None
    return common.number(_SCALE, positive=True) if stated else 1.0


def _frames(common: Entries) -> list[_Frame]:
    """Frames in the order of their names."""
    listed = common.values.get("frames")
    if not isinstance(listed, list) or not listed:
        raise DataError(common.place, "no frames", "a list of frames")
    frames: dict[str, _Frame] = {}
    for index, values in enumerate(listed):
        frame = _frame(Path(common.place), index, values)
        if frame.name in frames:
            raise DataError(frame.entries.place, f"file_path {frame.name} again", "one frame for each image")
        frames[frame.name] = frame
    return [frames[name] for name in natural_order(frames)]


def _existing(listed: list[_Frame]) -> tuple[list[_Frame], tuple[str, ...]]:
    """Frames whose image exists, and a sentence about the others. All frames if no image exists."""
    frames = [frame for frame in listed if is_regular_file(frame.image)]
    if len(frames) in (0, len(listed)):
        return listed, ()
    n, first = len(listed) - len(frames), next(frame.name for frame in listed if not is_regular_file(frame.image))
    do = "does" if n == 1 else "do"
    left_out = f"{n} of {len(listed)} listed images {do} not exist ({first} first); these frames are left out"
    return frames, (f"{left_out}, and the frames around them are taken as consecutive",)


def _frame(path: Path, index: int, values: Any) -> _Frame:
    place = f"{path} frame {index}"
    if not isinstance(values, dict):
        raise DataError(place, "no object", "file_path and transform_matrix")
    entries = Entries(place, values)
    name = _path(entries, entries.required("file_path"))
    depth = entries.name("depth_file_path")
    depth = None if depth is None or values[depth] is None else depth
    image = next((file for end in _SUFFIXES if is_regular_file(file := path.parent / f"{name}{end}")), None)
    return _Frame(
        entries, name, image or path.parent / name, None if depth is None else path.parent / _path(entries, depth)
    )


def _path(entries: Entries, key: str) -> str:
    value = entries.values[key]
    if not isinstance(value, str) or not value or "\0" in value:
        raise entries.error(key, "the path of a file")
    return value.replace("\\", "/")


def _cameras(common: Entries, frames: list[_Frame]) -> tuple[CameraModel, ...]:
    """Camera of each frame, all of one size. What is said of a frame precedes what is said of all."""
    size = image_size(first_readable(frame.image for frame in frames))
    made: dict[str, CameraModel] = {}
    cameras = []
    for frame in frames:
        said = intrinsics_in(common.values) | intrinsics_in(frame.entries.values)
        key = json.dumps(said)
        if key not in made:
            made[key] = camera_of(Entries(frame.entries.place, said), size)
        cameras.append(made[key])
    sizes = {(camera.width, camera.height): frame.name for camera, frame in zip(cameras, frames, strict=True)}
    if len(sizes) > 1:
        listed = ", ".join(f"{width}x{height} ({name})" for (width, height), name in sizes.items())
        raise DataError(common.place, f"images of several sizes: {listed}", "one size")
    return tuple(cameras)


def _poses(frames: list[_Frame]) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """(n, 4, 4) float64: world_from_camera, where the camera looks along z with y down."""
    matrices = np.array([_matrix(frame.entries) for frame in frames])
    poses, notes = checked_poses(matrices, [str(frame.entries.place) for frame in frames])
    return poses @ _CV_FROM_GL, notes


def _matrix(entries: Entries) -> NDArray[np.float64]:
    """(4, 4) float64; the last row may be missing."""
    name = entries.required("transform_matrix")
    values = np.array(entries.numbers(name, 12, 16)).reshape(-1, 4)
    return np.concatenate([values[:3], values[3:] if len(values) == 4 else [[0.0, 0.0, 0.0, 1.0]]])


def _enlarged_notes(depths: tuple[Path | None, ...], camera: CameraModel) -> tuple[str, ...]:
    """A sentence where the first depth map that can be read is smaller than the images."""
    width, height = next(filter(None, map(_depth_file_size, depths)), (camera.width, camera.height))
    if width >= camera.width:
        return ()
    return (f"depth maps of {width}x{height} pixels are enlarged to the {camera.width}x{camera.height} of the images",)


def _depth_file_size(path: Path | None) -> tuple[int, int] | None:
    """(width, height) of a depth file; None where it cannot be read."""
    try:
        return None if path is None else numpy_size(path) if _is_numpy(path) else image_size(path)
    except DataError:
        return None


def _is_numpy(path: Path) -> bool:
    return path.suffix.lower() == ".npy"


def _read_depth(path: Path, camera: CameraModel, *, metres_per_unit: float) -> DepthMap:
    """A depth map from a 16-bit PNG or a NumPy file, both in the same unit, as nerfstudio has it.

    Maps of phones are smaller than the images, and enlarged.
    """
    read = read_enlarged_depth_npy if _is_numpy(path) else read_enlarged_depth_png16
    return read(path, camera, metres_per_unit=metres_per_unit)
