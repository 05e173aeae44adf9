"""The reader of reconstructions of COLMAP: see docs/formats.md.

A reconstruction has cameras and registered images, in text files or in little-endian binary ones. Dense depth maps are
``width&height&channels&`` in text, then float32 depths row by row.
"""

import math
import os
import re
import struct
from collections.abc import Collection, Iterator
from dataclasses import KW_ONLY, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign_files import (
    MIB,
    damage_reported,
    is_folder,
    is_regular_file,
    natural_order,
    read_bytes,
    read_text,
)
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import invert
from tracknoise.options import DataPath
from tracknoise.sequences.camera_files import CameraFile, checked_camera
from tracknoise.sequences.poses import no_poses, pose_notes, quaternion_poses
from tracknoise.sequences.recorded import (
    ImageFiles,
    RecordedSequence,
    chosen_folder,
    depth_files,
    depth_notes,
    folders_of,
    image_names,
)
from tracknoise.sequences.scenes import SceneReader, find_scenes, with_option
from tracknoise.tables.identity import SequenceId
from tracknoise.text import counted

CORNER_PX = 0.5
"""COLMAP puts (0, 0) at the corner of the first pixel, and tracknoise at its centre."""

PARAMETERS = {
    "SIMPLE_PINHOLE": 3,
    "PINHOLE": 4,
    "SIMPLE_RADIAL": 4,
    "RADIAL": 5,
    "OPENCV": 8,
    "OPENCV_FISHEYE": 8,
    "FULL_OPENCV": 12,
    "FOV": 5,
    "SIMPLE_RADIAL_FISHEYE": 4,
    "RADIAL_FISHEYE": 5,
    "THIN_PRISM_FISHEYE": 12,
    "RAD_TAN_THIN_PRISM_FISHEYE": 16,
    "SIMPLE_DIVISION": 4,
    "DIVISION": 5,
    "SIMPLE_FISHEYE": 3,
    "FISHEYE": 4,
    "EUCM": 6,
    "EQUIRECTANGULAR": 2,
}
"""How many parameters each camera model has, in the order of their numbers in binary files, from 0."""

_ONE_FOCAL_LENGTH = (
    "SIMPLE_PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "SIMPLE_FISHEYE",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
)
_LENSES = {
    "SIMPLE_PINHOLE": ("pinhole", 0),
    "PINHOLE": ("pinhole", 0),
    "SIMPLE_RADIAL": ("radtan", 4),
    "RADIAL": ("radtan", 4),
    "OPENCV": ("radtan", 4),
    "FULL_OPENCV": ("radtan", 8),
    "OPENCV_FISHEYE": ("equidistant", 4),
    "SIMPLE_RADIAL_FISHEYE": ("equidistant", 4),
    "RADIAL_FISHEYE": ("equidistant", 4),
    "SIMPLE_FISHEYE": ("equidistant", 4),
    "FISHEYE": ("equidistant", 4),
    "FOV": ("fov", 1),
    "EUCM": ("eucm", 2),
}
"""The lens model of tracknoise, and how many coefficients it has; those that COLMAP's model does not have are 0."""


@dataclass(frozen=True, slots=True)
class ColmapCamera:
    """A camera as it is written."""

    place: str  # file, and where in it, for errors
    model: str  # name of the model, one of `PARAMETERS`
    # width, height: size of the image, px
    width: int
    height: int
    parameters: tuple[float, ...]  # as the model has them


@dataclass(frozen=True, slots=True)
class ColmapImage:
    """A registered image as it is written."""

    place: str  # file, and where in it, for errors
    name: str  # path of the file below the folder of images
    camera_id: int
    pose: tuple[float, ...]  # quaternion qw, qx, qy, qz and translation of ``camera_from_world``


@dataclass(frozen=True, slots=True)
class Reconstruction:
    """A reconstruction."""

    cameras: dict[int, ColmapCamera]  # by their numbers
    images: dict[str, ColmapImage]  # registered images by their names


def reconstruction(path: Path, cameras: dict[int, ColmapCamera], images: list[ColmapImage]) -> Reconstruction:
    """A reconstruction whose images all have a camera, and names of their own that lead to no other folder."""
    if not images:
        raise DataError(path, "no registered images", "at least one")
    by_name: dict[str, ColmapImage] = {}
    for image in images:
        if image.camera_id not in cameras:
            raise DataError(image.place, f"camera {image.camera_id}", f"one of {', '.join(map(str, sorted(cameras)))}")
        if image.name in by_name:
            raise DataError(image.place, f"a second image {image.name}", "one of each name")
        if Path(image.name).is_absolute() or ".." in Path(image.name).parts or "\0" in image.name:
            raise DataError(image.place, f"the name {image.name!r}", "the path of a file below the folder of images")
        by_name[image.name] = image
    return Reconstruction(cameras, by_name)


def camera_of(camera: ColmapCamera) -> CameraModel:
    """The camera with (0, 0) at the centre of the first pixel."""
    if camera.model not in _LENSES:
        raise DataError(camera.place, f"camera model {camera.model}", f"one of {', '.join(_LENSES)}")
    f, fy, *rest = camera.parameters
    if camera.model in _ONE_FOCAL_LENGTH:
        fy, rest = f, [fy, *rest]
    cx, cy, *coefficients = rest
    lens, count = _LENSES[camera.model]
    padded = (*coefficients, *[0.0] * (count - len(coefficients)))
    intrinsics = (f, fy, cx - CORNER_PX, cy - CORNER_PX)
    return checked_camera(camera.place, lens, (camera.width, camera.height), intrinsics, padded)


def poses_of(images: list[ColmapImage]) -> NDArray[np.float64]:
    """(n, 4, 4) float64: world_from_camera of images."""
    rows = np.array([image.pose for image in images], np.float64).reshape(-1, 7)
    return invert(quaternion_poses(rows[:, 4:], rows[:, [1, 2, 3, 0]], [image.place for image in images]))


_MOST_BYTES = 4096 * MIB
_TEXT_CAMERA = "CAMERA_ID MODEL WIDTH HEIGHT PARAMS"
_TEXT_IMAGE = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
_POINT = "X Y POINT3D_ID"
_LONGEST_NUMBER = 40
_LONGEST_SHOWN = 80


def read_text_cameras(path: Path) -> dict[int, ColmapCamera]:
    """Cameras by their numbers."""
    cameras = {}
    for place, line in _lines(path, _TEXT_CAMERA):
        if not line:
            continue
        fields = line.split()
        if len(fields) < 4 or fields[1] not in PARAMETERS:
            raise DataError(
                place, repr(line[:_LONGEST_SHOWN]), f"{_TEXT_CAMERA} with MODEL one of {', '.join(PARAMETERS)}"
            )
        number, width, height = (_whole(place, field) for field in (fields[0], *fields[2:4]))
        parameters = tuple(_number(place, field) for field in fields[4:])
        if len(parameters) != PARAMETERS[fields[1]]:
            found = f"{counted(len(parameters), 'parameter')} of the model {fields[1]}"
            raise DataError(place, found, f"{PARAMETERS[fields[1]]}")
        cameras[number] = ColmapCamera(place, fields[1], width, height, parameters)
    return cameras


def read_text_images(path: Path) -> list[ColmapImage]:
    """Registered images. Each has two lines, of which the second lists its points and may be empty."""
    images: list[ColmapImage] = []
    lines = _lines(path, _TEXT_IMAGE)
    for place, line in lines:
        if not line:
            continue
        fields = line.split(maxsplit=9)
        if len(fields) != 10:
            raise DataError(place, counted(len(fields), "field"), f"10 ({_TEXT_IMAGE})")
        pose = tuple(_number(place, field) for field in fields[1:8])
        images.append(ColmapImage(place, fields[9], _whole(place, fields[8]), pose))
        _require_points(*next(lines, (place, "")))
    return images


def _require_points(place: str, line: str) -> None:
    """Check that a line lists points. Where files lack these lines, every second image would be taken for one."""
    fields = line.split()
    last = fields[-1].removeprefix("-") if fields else "0"
    if len(fields) % len(_POINT.split()) or not last.isdecimal():
        raise DataError(place, repr(line[:_LONGEST_SHOWN]), f"points ({_POINT}), or an empty line, after each image")


def _lines(path: Path, expected: str) -> Iterator[tuple[str, str]]:
    """Place and text of each line that is not a comment, without surrounding spaces."""
    for number, line in enumerate(read_text(path, f"lines of {expected}", most=_MOST_BYTES).split("\n"), start=1):
        if not line.lstrip().startswith("#"):
            yield f"{path}:{number}", line.strip()


def _number(place: str, field: str) -> float:
    try:
        number = float(field)
    except ValueError:
        number = math.nan
    if not math.isfinite(number) or "_" in field:
        raise DataError(place, repr(field[:_LONGEST_NUMBER]), "a finite number")
    return number


def _whole(place: str, field: str) -> int:
    if not (field.isascii() and field.isdigit() and len(field) < _LONGEST_NUMBER // 2):
        raise DataError(place, repr(field[:_LONGEST_NUMBER]), "a whole number")
    return int(field)


_COUNT = struct.Struct("<Q")
_BINARY_CAMERA = struct.Struct("<IiQQ")
"""Number, number of the model, width, height."""
_BINARY_IMAGE = struct.Struct("<I7dI")
"""Number, quaternion with the scalar first, translation, number of the camera."""
_POINT_BYTES = struct.calcsize("<ddq")
_LARGEST_SIDE = 1 << 20


@dataclass(slots=True)
class _Cursor:
    """A position in the content of a file."""

    content: bytes
    at: int = 0

    def take(self, layout: struct.Struct) -> tuple[Any, ...]:
        values = layout.unpack_from(self.content, self.at)
        self.at += layout.size
        return values

    def text(self) -> str:
        """What comes before the next zero byte."""
        end = self.content.index(b"\0", self.at)
        value = self.content[self.at : end].decode()
        self.at = end + 1
        return value

    def skip(self, count: int) -> None:
        if count > len(self.content) - self.at:
            raise ValueError(
                f"{counted(count, 'byte')} at {self.at}, where the file ends after {len(self.content) - self.at}"
            )
        self.at += count


def read_binary_cameras(path: Path) -> dict[int, ColmapCamera]:
    """Cameras by their numbers."""
    cursor = _Cursor(read_bytes(path, "cameras of COLMAP", most=_MOST_BYTES))
    with damage_reported(path, "a damaged or truncated file", "cameras of COLMAP", with_reason=True):
        (count,) = cursor.take(_COUNT)
        return dict(_camera(path, cursor) for _ in range(count))


def read_binary_images(path: Path) -> list[ColmapImage]:
    """Registered images."""
    cursor = _Cursor(read_bytes(path, "images of COLMAP", most=_MOST_BYTES))
    with damage_reported(path, "a damaged or truncated file", "images of COLMAP", with_reason=True):
        (count,) = cursor.take(_COUNT)
        return [_image(path, cursor) for _ in range(count)]


def _camera(path: Path, cursor: _Cursor) -> tuple[int, ColmapCamera]:
    number, kind, width, height = cursor.take(_BINARY_CAMERA)
    place = f"{path} camera {number}"
    if not 0 <= kind < len(PARAMETERS):
        raise DataError(place, f"camera model {kind}", f"a number from 0 to {len(PARAMETERS) - 1}")
    if max(width, height) > _LARGEST_SIDE:
        raise DataError(place, f"an image size of {width}x{height}", f"at most {_LARGEST_SIDE} each")
    model = list(PARAMETERS)[kind]
    parameters = cursor.take(struct.Struct(f"<{PARAMETERS[model]}d"))
    return number, ColmapCamera(place, model, width, height, parameters)


def _image(path: Path, cursor: _Cursor) -> ColmapImage:
    number, *pose, camera_id = cursor.take(_BINARY_IMAGE)
    image = ColmapImage(f"{path} image {number}", cursor.text(), camera_id, tuple(pose))
    cursor.skip(cursor.take(_COUNT)[0] * _POINT_BYTES)
    return image


_HEADER = re.compile(rb"(\d{1,9})&(\d{1,9})&(\d{1,9})&")
_EXPECTED = "a depth map of COLMAP"


def read_depth_map(path: Path, camera: CameraModel) -> DepthMap:
    """Read a depth map. Depths are in the unit of the reconstruction; those that are not positive are invalid."""
    content = read_bytes(path, _EXPECTED)
    header = _HEADER.match(content)
    if header is None:
        raise DataError(path, "no header", f"{_EXPECTED}: width&height&channels&")
    width, height, channels = map(int, header.groups())
    if (width, height, channels) != (camera.width, camera.height, 1):
        expected = f"the camera's {camera.width}x{camera.height} and one channel"
        raise DataError(path, f"size {width}x{height} and {counted(channels, 'channel')}", expected)
    if len(content) - header.end() != 4 * width * height:
        raise DataError(path, f"{counted(len(content) - header.end(), 'byte')} of depths", f"{4 * width * height}")
    depth = np.frombuffer(content, "<f4", offset=header.end()).reshape(height, width).astype(np.float32)
    return DepthMap(depth, np.isfinite(depth) & (depth > 0.0))


_IMAGES, _DEPTHS = "images", Path("stereo") / "depth_maps"
_DISTORTED, _ORIGINALS = "distorted", "input"
"""How programs for Gaussian splatting name what undistorted images and cameras were made from."""
_LEVELS = 4
"""How far above a reconstruction the folder of its images may be."""
SCALE_NOTE = "COLMAP does not know the scale: its unit of length stands where metres are meant"


class DepthMaps(StrEnum):
    """Which dense depth maps of COLMAP are read."""

    geometric = "geometric"
    photometric = "photometric"
    none = "none"


@dataclass(frozen=True, slots=True)
class Colmap(SceneReader):
    """Reader of reconstructions of COLMAP.

    Parameters
    ----------
    root
        Folder of a reconstruction (cameras and images, as .bin or .txt), or a folder with several at any depth.
    image_folder
        Folder of the images, from `root`; by default ``images`` beside or above the reconstruction. If those are
        undistorted and belong to another reconstruction, ``input`` beside them.
    folder
        Which folder below it, where the reconstruction has images of several.
    depth_maps
        Which dense depth maps are read, where there are any.
    """

    name: ClassVar[str] = "colmap"
    description: ClassVar[str] = "COLMAP reconstructions: cameras and images (text or binary), dense depth if there is"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    image_folder: DataPath | None = None
    folder: str | None = None
    depth_maps: DepthMaps = DepthMaps.geometric

    def sequences(self) -> list[SequenceId]:
        """All sequences whose images are there, sorted."""
        excluded = self.excluded_scenes()
        listed = [SequenceId(self.name, scene) for scene in self._scenes() if scene not in excluded]
        return listed or [SequenceId(self.name, scene) for scene in excluded]  # which `open` refuses

    def excluded_scenes(self) -> dict[str, str]:
        """Reconstructions beside images that are those of another one, such as undistorted ones."""
        if self.image_folder is not None:
            return {}
        by_scene = {scene: _found_images(folder) for scene, folder in self._scenes().items()}
        return {scene: images.why for scene, images in by_scene.items() if images is not None and images.folder is None}

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one reconstruction, except for its images and depths."""
        folder = self._folder(sequence)
        model = _read(folder)
        images, nearest = self._images(folder), _found_images(folder)
        names = self._names(images, model)
        cameras = _cameras(folder, names, model)
        poses = _poses(names, model)
        depths = self._depths(folder, names, nearest)
        return RecordedSequence(
            id=sequence,
            source=str(images),
            camera=cameras[0],
            world_from_camera=poses,
            images=ImageFiles(tuple(images / name for name in names), cameras[0]),
            depths=depth_files(depths, cameras[0], read_depth_map),
            notes=(
                *CameraFile(cameras[0]).notes,
                *(depth_notes(depths) if any(depths) else ()),
                *pose_notes(poses),
                "images are in the order of their names",
                SCALE_NOTE,
            ),
            cameras=cameras if len(set(cameras)) > 1 else None,
            group=Path(os.path.relpath(images if nearest is None else nearest.beside, self.root)).as_posix(),
        )

    def _scenes(self) -> dict[str, Path]:
        return find_scenes(
            self.root,
            lambda _, files: _is_model(files),
            expected="folders with cameras.bin and images.bin, or cameras.txt and images.txt",
        )

    def _images(self, folder: Path) -> Path:
        """The folder of images."""
        if self.image_folder is not None:
            return self.root / self.image_folder
        images = _found_images(folder)
        if images is None or images.folder is None:
            why, named = "no folder of images" if images is None else images.why, with_option("image_folder", "FOLDER")
            beside = f"{_IMAGES} beside it or above" if images is None else f"{_ORIGINALS} beside {images.beside}"
            raise DataError(folder, why, f"{beside}, or {named}")
        return images.folder

    def _names(self, images: Path, model: Reconstruction) -> list[str]:
        """Images in natural order: those of the model, and those beside them, which are not registered."""
        chosen = chosen_folder(model.images, self.folder, images)
        registered = [name for name in model.images if folders_of([name]) == [chosen]]
        return natural_order({*registered, *image_names(images, chosen)})

    def _depths(self, folder: Path, names: list[str], images: "_Images | None") -> tuple[Path | None, ...]:
        """Dense depth map of each image; None for one without. Those beside images of another one are not its own."""
        levels = [level / _DEPTHS for level in _levels(folder)]
        if images is not None and images.of_other is not None:
            levels = [level for level in levels if images.beside.parent not in (level, *level.parents)]
        depth_folder = next((level for level in levels if is_folder(level)), None)
        if self.depth_maps is DepthMaps.none or depth_folder is None:
            return (None,) * len(names)
        paths = (depth_folder / f"{name}.{self.depth_maps}.bin" for name in names)
        return tuple(path if is_regular_file(path) else None for path in paths)


@dataclass(frozen=True, slots=True)
class _Images:
    """The images of a reconstruction."""

    beside: Path  # the nearest folder of that name
    of_other: Path | None  # the other reconstruction that it belongs to; None where it is its own

    @property
    def folder(self) -> Path | None:
        """Its own images; None where they are not there."""
        originals = self.beside.parent / _ORIGINALS
        return self.beside if self.of_other is None else originals if is_folder(originals) else None

    @property
    def why(self) -> str:
        """Why the nearest images are not its own."""
        return f"{self.beside} holds the images of {self.of_other}, whose cameras are others"


def _levels(folder: Path) -> list[Path]:
    """A folder and those above it in which its files are looked for."""
    return [folder, *folder.absolute().parents[:_LEVELS]]


def _found_images(folder: Path) -> _Images | None:
    """The nearest folder of images, and whose it is; None where there is none."""
    beside = next((level / _IMAGES for level in _levels(folder) if is_folder(level / _IMAGES)), None)
    if beside is None:
        return None
    depth = len(folder.absolute().relative_to(beside.absolute().parent).parts)
    nearer = (below for below in _models_below(beside.parent, depth - 1) if _has_other_images(folder, below))
    return _Images(beside, next(nearer, None))


def _models_below(folder: Path, levels: int) -> Iterator[Path]:
    """Folders of reconstructions down to some levels below a folder, those of upper levels first."""
    below = [folder]
    for _ in range(levels + 1):
        yield from (inner for inner in below if _is_model({path.name for path in inner.iterdir()}))
        below = sorted(path for inner in below for path in inner.iterdir() if path.name != _IMAGES and is_folder(path))


def _is_model(files: Collection[str]) -> bool:
    return any({f"cameras{kind}", f"images{kind}"} <= {*files} for kind in (".bin", ".txt"))


def _has_other_images(folder: Path, nearer: Path) -> bool:
    """Whether the images of a nearer reconstruction are not those of another one; not where one is damaged.

    Undistorted images are those of cameras without distortion, or of another size.
    """
    if _DISTORTED in folder.absolute().parts and _DISTORTED not in nearer.absolute().parts:
        return True
    try:
        of_folder, of_nearer = _read_cameras(folder), _read_cameras(nearer)
    except DataError:
        return False
    sizes = [{(camera.width, camera.height) for camera in cameras} for cameras in (of_folder, of_nearer)]
    return any(map(_has_distortion, of_folder)) != any(map(_has_distortion, of_nearer)) or sizes[0].isdisjoint(sizes[1])


def _has_distortion(camera: ColmapCamera) -> bool:
    n_pinhole = PARAMETERS["SIMPLE_PINHOLE" if camera.model in _ONE_FOCAL_LENGTH else "PINHOLE"]
    return any(camera.parameters[n_pinhole:])


def _read_cameras(folder: Path) -> list[ColmapCamera]:
    is_binary = _is_binary(folder)
    cameras = read_binary_cameras(folder / "cameras.bin") if is_binary else read_text_cameras(folder / "cameras.txt")
    return list(cameras.values())


def _is_binary(folder: Path) -> bool:
    return all(is_regular_file(folder / name) for name in ("cameras.bin", "images.bin"))


def _read(folder: Path) -> Reconstruction:
    """The reconstruction from binary files, or from text files where there are none."""
    if _is_binary(folder):
        images = folder / "images.bin"
        return reconstruction(images, read_binary_cameras(folder / "cameras.bin"), read_binary_images(images))
    images = folder / "images.txt"
    return reconstruction(images, read_text_cameras(folder / "cameras.txt"), read_text_images(images))


def _cameras(folder: Path, names: list[str], model: Reconstruction) -> tuple[CameraModel, ...]:
    """Camera of each image; one that is not registered has that of the image before it."""
    used = {model.images[name].camera_id: name for name in reversed(names) if name in model.images}
    made = {number: camera_of(model.cameras[number]) for number in used}
    sizes = {(made[number].width, made[number].height): name for number, name in sorted(used.items())}
    if len(sizes) > 1:
        listed = ", ".join(f"{width}x{height} ({name})" for (width, height), name in sizes.items())
        raise DataError(folder, f"images of several sizes: {listed}", "one size; choose a folder of images with folder")
    cameras, current = [], next(model.images[name].camera_id for name in names if name in model.images)
    for name in names:
        current = model.images[name].camera_id if name in model.images else current
        cameras.append(made[current])
    return tuple(cameras)


def _poses(names: list[str], model: Reconstruction) -> NDArray[np.float64]:
    """(n, 4, 4) float64: world_from_camera, NaN for images that are not registered."""
    registered = [index for index, name in enumerate(names) if name in model.images]
    poses = no_poses(len(names))
    poses[registered] = poses_of([model.images[names[index]] for index in registered])
    return poses
