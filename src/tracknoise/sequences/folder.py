"""A plain layout on disk, for your own data and for simulated sequences: see docs/data.md.

``images/NNNNNN.png``, ``depth/NNNNNN.npy``, ``poses.txt``, ``camera.json`` and, if known, ``timestamps.txt``.
Frames are numbered from 0.
"""

import json
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, asdict, dataclass, replace
from decimal import Decimal
from functools import partial
from itertools import compress, pairwise
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, Positive, require_bounds
from tracknoise.exceptions import DataError
from tracknoise.foreign_files import is_folder, is_there, natural_order
from tracknoise.geometry.cameras import LENSES, CameraModel, KnownCamera, model_of
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import nearest, position_rows
from tracknoise.sequences.camera_files import CameraFile, Lens, read_camera_file
from tracknoise.sequences.camera_pairs import (
    STATED_PLACES,
    pose_of_numbers,
    read_second,
    require_pose_numbers,
)
from tracknoise.sequences.images import (
    encode_png,
    first_readable,
    image_size,
    level_notes,
    read_depth_npy,
    read_depth_png16,
    require_levels,
)
from tracknoise.sequences.likely_times import seconds_of
from tracknoise.sequences.poses import no_poses, quaternion_poses, read_rows, require_poses, surplus_notes
from tracknoise.sequences.recorded import (
    DepthReader,
    ImageFiles,
    RecordedSequence,
    depth_files,
    depth_notes,
    image_names,
)
from tracknoise.sequences.scenes import (
    SceneReader,
    find_scenes,
    numbered_files,
    parent_of,
    require_unbroken,
    scene_folder,
    with_option,
)
from tracknoise.sequences.second_camera import SomeImages
from tracknoise.sequences.sequence import SecondCamera, Sequence, shutter_of, times_of
from tracknoise.sequences.writing import new_folder, only_camera, write_times
from tracknoise.tables.identity import SequenceId
from tracknoise.text import counted
from tracknoise.time_units import TimeUnit, is_likely, rate_of, unit_of_clock

_IMAGES, _DEPTH, _POSES, _CAMERA, _TIMES = "images", "depth", "poses.txt", "camera.json", "timestamps.txt"
_PARTS = frozenset((_IMAGES, _DEPTH, _POSES, _CAMERA))
_IMAGE, _IMAGE_ENDINGS = r"(\d+)\.(?:png|jpe?g)", (".png", ".jpg", ".jpeg", ".bmp")
_SECOND_IMAGES = "images_second"
_KNOWN = {*_PARTS, _TIMES, _SECOND_IMAGES}
_MOST_NAMED, _MOST_LEVELS = 8, 3
_COLUMNS = "tx ty tz qx qy qz qw"
_DEFAULT_MODEL = "radtan"
_SAME_S = 1e-6
"""Images of both cameras are of one time up to this: seconds since 1970 are rounded to 0.2 us."""
_FIRST_CLOCK = 10**12
"""Smaller whole numbers in the names of images are numbers of frames; larger ones are times in ms, us or ns."""


@dataclass(frozen=True, slots=True)
class Folder(SceneReader):
    """Reader of tracknoise's plain layout.

    Parameters
    ----------
    root
        Folder of one sequence, or a folder that contains several at any depth.
    depth_radius_px
        None for dense depth, which is interpolated. For sparse depth (lidar), the largest distance from a feature to
        the nearest pixel with depth, px.
    depth_unit_m
        Depth of the integer 1 in 16-bit depth images, metres; by default, what the camera file states.
    camera_file
        File of the camera, in place of each scene's ``camera.json``: of OpenCV, Kalibr, ROS or EuRoC (see
        docs/data.md).
    camera
        Which camera of that file, where it has several, such as ``cam1``; by default the first.
    lens
        Lens of a file of OpenCV with 4 coefficients and no word for it: ``radtan`` or ``equidistant``.
    second_images
        Folder of the images of a second camera, from the folder of a sequence; by default ``images_second``, if there.
        An image belongs to the frame at its time, by its name or by ``timestamps.txt`` there, or of its name.
    second_camera_file, second_camera
        File of the second camera, and which of its cameras; by default the other one of the file of the first.
    first_from_second
        16 numbers, the rows of the pose of the second camera in the frame of the first, metres; by default that of the
        files.
    image_levels
        Values of 16-bit images that become 0 and 255; values between are scaled linearly, others are clipped. Images
        of 8 bits are not changed.
    time_unit
        Unit of the timestamps: s, ms, us or ns; by default seconds, at 1 to 1,000 Hz.
    """

    name: ClassVar[str] = "folder"
    description: ClassVar[str] = "tracknoise's plain layout: images/, depth/, poses.txt, camera.json"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    depth_radius_px: NotNegative | None = None
    depth_unit_m: Positive | None = None
    camera_file: Path | None = None
    camera: str | None = None
    lens: Lens | None = None
    second_images: str | None = None
    second_camera_file: Path | None = None
    second_camera: str | None = None
    first_from_second: tuple[float, ...] | None = None
    image_levels: tuple[float, float] | None = None
    time_unit: TimeUnit | None = None

    def __post_init__(self) -> None:
        require_bounds(self)
        require_levels(self.image_levels)
        require_pose_numbers("first_from_second", self.first_from_second)

    def recordings(self) -> list[SequenceId]:
        """All folders of images, however they are named, sorted: see `ImageReader.recordings`."""
        return [SequenceId(self.name, scene) for scene in self._image_folders()]

    def open_images(self, sequence: SequenceId) -> RecordedSequence:
        """Images in the order of their names, without poses: see `ImageReader.open_images`."""
        folder = scene_folder(self._image_folders(), sequence)
        inside = _IMAGES if is_folder(folder / _IMAGES) else "."
        images = tuple(folder / name for name in natural_order(image_names(folder, inside)))
        if not images:
            raise DataError(folder / inside, "no images", "PNG, JPEG or BMP files")
        if self.camera_file is None and not is_there(folder / _CAMERA):
            raise DataError(folder, f"no {_CAMERA}", f"it, or {with_option('camera_file', 'FILE')}")
        stated = (
            self._named_camera(first_readable(images))
            if self.camera_file is not None
            else read_camera_file(folder / _CAMERA, lens=self.lens)
        )
        depths = _namesakes(folder / _DEPTH, images)
        read_depth = _depth_reader(folder, depths, self.depth_unit_m or stated.depth_unit_m)
        timestamps_s, start_ns, time_notes = self._times_of_images(folder, images)
        second, second_notes = self._second(folder, stated, images, timestamps_s, start_ns)
        return RecordedSequence(
            id=sequence,
            source=str(images[0].parent),
            camera=stated.camera,
            world_from_camera=no_poses(len(images)),
            poses_elsewhere=True,
            body=stated.body,
            timestamps_s=timestamps_s,
            time_unit_stated=self.time_unit is not None,
            clock_start_ns=start_ns,
            shutter=stated.shutter,
            second=second,
            images=ImageFiles(images, stated.camera, self.image_levels),
            depths=depth_files(depths, stated.camera, partial(_with_radius, read_depth, self.depth_radius_px)),
            notes=(
                *stated.notes,
                *level_notes(self.image_levels),
                *time_notes,
                *(depth_notes(depths) if any(depths) else ()),
                *second_notes,
            ),
            group=parent_of(sequence.scene),
        )

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one sequence, except for its images and depths."""
        folder = self._folder(sequence)
        _require_names(folder, (_POSES, *(() if self.camera_file is not None else (_CAMERA,))))
        stated = None if self.camera_file is not None else read_camera_file(folder / _CAMERA, lens=self.lens)
        rows, places = read_rows(folder / _POSES, _COLUMNS)
        images, depths = _frame_files(folder, poses=len(rows))
        stated = stated or self._named_camera(first_readable(images))
        camera = stated.camera
        read_depth = _depth_reader(folder, depths, self.depth_unit_m or stated.depth_unit_m)
        timestamps_s = _timestamps(folder / _TIMES, len(images), self.time_unit)
        second, second_notes = self._second(folder, stated, images, timestamps_s, None)
        return RecordedSequence(
            id=sequence,
            source=str(folder / _IMAGES),
            camera=camera,
            world_from_camera=_poses(rows[: len(images)], places),
            timestamps_s=timestamps_s,
            time_unit_stated=self.time_unit is not None,
            shutter=stated.shutter,
            body=stated.body,
            second=second,
            images=ImageFiles(images, camera, self.image_levels),
            depths=depth_files(depths, camera, partial(_with_radius, read_depth, self.depth_radius_px)),
            notes=(
                *stated.notes,
                *level_notes(self.image_levels),
                *surplus_notes(folder / _POSES, poses=len(rows), images=len(images)),
                *(depth_notes(depths) if is_there(folder / _DEPTH) else ()),
                *second_notes,
            ),
            group=parent_of(sequence.scene),
        )

    def _named_camera(self, image: Path) -> CameraFile:
        """The camera of the file that the options name; an image says its size where the file does not."""
        assert self.camera_file is not None, "otherwise each scene has its own"
        return read_camera_file(self.camera_file, camera=self.camera, size=image_size(image), lens=self.lens)

    def _second(
        self,
        folder: Path,
        first: CameraFile,
        frames: tuple[Path, ...],
        times_s: NDArray[np.float64] | None,
        start_ns: int | None,
    ) -> tuple[SecondCamera | None, tuple[str, ...]]:
        """The second camera and notes on it. `start_ns`: time 0 where times are those in the names of images."""
        inside = folder / (self.second_images or _SECOND_IMAGES)
        if not is_folder(inside):
            stated = (self.second_images, self.second_camera_file, self.second_camera, self.first_from_second)
            if any(value is not None for value in stated):
                raise DataError(inside, "no such folder", "the images of the second camera, as options state one")
            return None, ()
        images = tuple(inside / name for name in natural_order(image_names(inside, ".")))
        if not images:
            raise DataError(inside, "no images", "PNG, JPEG or BMP files of the second camera")
        at_s = times_s if times_s is None or start_ns is None else times_s + start_ns / 1e9
        named_in = None if start_ns is None else self.time_unit
        numbers = _numbers_of_frames(inside, images, frames, at_s, (self.time_unit, named_in))
        second, place = read_second(
            first,
            self.camera_file or folder / _CAMERA,
            self.camera,
            file=self.second_camera_file,
            name=self.second_camera,
            size=image_size(first_readable(images)),
            lens=self.lens,
        )
        if self.first_from_second is not None:
            place = pose_of_numbers("first_from_second", self.first_from_second)
        if place is None:
            source = self.second_camera_file or self.camera_file or folder / _CAMERA
            raise DataError(source, "no pose of the second camera in the first", STATED_PLACES)
        pictures = SomeImages(ImageFiles(images, second.camera, self.image_levels), numbers)
        notes = (*(f"second camera: {note}" for note in second.notes), *pictures.notes("the second camera"))
        return SecondCamera(second.camera, place, pictures), notes

    def _image_folders(self) -> dict[str, Path]:
        return find_scenes(
            self.root,
            lambda below, files: _IMAGES in below or any(name.lower().endswith(_IMAGE_ENDINGS) for name in files),
            expected=f"folders of PNG, JPEG or BMP files, or with {_IMAGES}/",
        )

    def _times_of_images(
        self, folder: Path, images: tuple[Path, ...]
    ) -> tuple[NDArray[np.float64] | None, int | None, tuple[str, ...]]:
        """Times of a file, otherwise those in the names of images; and time 0 by their clock, ns."""
        if is_there(folder / _TIMES):
            return _timestamps(folder / _TIMES, len(images), self.time_unit), None, ()
        times_ns = _times_in_names(images, self.time_unit)
        if times_ns is None:
            return None, None, _gap_notes(images)
        timestamps_s: NDArray[np.float64] = (times_ns - times_ns[0]) / 1e9
        if self.time_unit is None and (rate := rate_of(timestamps_s)) is not None and not is_likely(rate):
            return None, None, _gap_notes(images)
        return timestamps_s, int(times_ns[0]), (f"times are those in the names of images, such as {images[0].name}",)

    def _scenes(self) -> dict[str, Path]:
        return find_scenes(
            self.root,
            lambda below, files: len(_PARTS.intersection((*below, *files))) >= 2,
            expected=f"folders with {_IMAGES}/, {_POSES} and {_CAMERA}",
        )


def write_folder(sequence: Sequence, path: Path, *, progress: Callable[[int, int], None] | None = None) -> None:
    """Write a sequence to a folder that `Folder` reads; all of it appears at once, when it is complete.

    Depth is rounded to float32, by at most 6e-8 of itself.

    Parameters
    ----------
    sequence
        Of any format.
    path
        Folder to write, new or empty.
    progress
        Called after each frame with the count of frames done and of all.

    Raises
    ------
    DataError
        If the camera is of a model that the layout cannot hold, or changes, the shutter exposes columns, or the folder
        is neither new nor empty, or cannot be written.
    """
    with new_folder(path) as unfinished:
        _write_files(sequence, unfinished, progress)


def _write_files(sequence: Sequence, folder: Path, progress: Callable[[int, int], None] | None) -> None:
    (folder / _IMAGES).mkdir()
    (folder / _DEPTH).mkdir()
    for index in range(len(sequence)):
        (folder / _IMAGES / f"{index:06d}.png").write_bytes(encode_png(sequence.image(index)))
        depth = sequence.depth(index)
        if depth is not None:
            np.save(folder / _DEPTH / f"{index:06d}.npy", _plain(depth))
        if progress is not None:
            progress(index + 1, len(sequence))
    source = f"{sequence.id.dataset} {sequence.id.scene} {sequence.id.lighting}"
    camera = {**_camera_entries(sequence), "source": source}
    (folder / _CAMERA).write_text(json.dumps(camera, indent=2) + "\n", encoding="utf-8")
    (folder / _POSES).write_text(_pose_lines(sequence.world_from_camera), encoding="utf-8")
    times = times_of(sequence)
    if times is not None:
        write_times(folder / _TIMES, times)


def _camera_entries(sequence: Sequence) -> dict[str, Any]:
    """Keys of camera.json; without ``model`` where that is the default."""
    camera = only_camera(sequence)
    if not isinstance(camera, KnownCamera):
        raise DataError(
            sequence.source, f"a camera of the model {type(camera).__name__}", f"one of {', '.join(LENSES)}"
        )
    model = model_of(camera)
    return ({} if model == _DEFAULT_MODEL else {"model": model}) | asdict(camera) | _readout(sequence)


def _readout(sequence: Sequence) -> dict[str, float]:
    """Key of camera.json for a rolling shutter; nothing where all rows are exposed together."""
    shutter = shutter_of(sequence)
    if shutter is None:
        return {}
    if shutter.axis != 1:
        raise DataError(sequence.source, "a shutter that exposes columns", "one that exposes rows, of unturned images")
    return {"readout_s": shutter.readout_s}


def _plain(depth: DepthMap) -> NDArray[np.float32]:
    """(height, width) float32: metres, 0 where there is no depth."""
    return np.where(depth.valid, depth.depth_m, 0.0).astype(np.float32)


def _pose_lines(world_from_camera: NDArray[np.float64]) -> str:
    """One row per frame, with all digits of a float64; nan where it has no pose."""
    rows = position_rows(world_from_camera, canonical=False).tolist()
    lines = (" ".join(map(repr, row)) for row in rows)
    return "\n".join([f"# {_COLUMNS} (world_from_camera, metres; one row per frame)", *lines, ""])


def _require_names(folder: Path, files: tuple[str, ...]) -> None:
    """Refuse a scene that needs several renames, or whose images lie elsewhere: the message has all of them."""
    images, pattern = folder / _IMAGES, re.compile(_IMAGE)
    named = is_folder(images) and any(pattern.fullmatch(path.name) for path in images.iterdir())
    missing = [*([] if named else [f"{_IMAGES}/000000.png"]), *(name for name in files if not is_there(folder / name))]
    elsewhere = [] if named else _other_images(folder)
    if not elsewhere and len(missing) < 2:
        return
    parts = [f"no {name}" for name in missing]
    if elsewhere:
        parts.append(f"but {counted(len(elsewhere), 'image file')} such as {elsewhere[0]}")
    if unknown := sorted(path.name for path in folder.iterdir() if path.name not in _KNOWN):
        parts.append(f"beside {', '.join(unknown[:_MOST_NAMED])}")
    raise DataError(folder, ", ".join(parts), f"{_IMAGES}/000000.png and so on, {' and '.join(files)}: rename them")


def _other_images(folder: Path) -> list[str]:
    """Image files below a folder whose names are not those of the layout, down to some levels, without depth."""
    images: list[str] = []
    for name, below, files in os.walk(folder):
        inside = Path(name).relative_to(folder)
        if len(inside.parts) >= _MOST_LEVELS:
            below.clear()
        below[:] = sorted(inner for inner in below if inner not in (_DEPTH, _SECOND_IMAGES))
        images += [(inside / file).as_posix() for file in natural_order(files) if file.lower().endswith(_IMAGE_ENDINGS)]
    return images


def _frame_files(folder: Path, *, poses: int) -> tuple[tuple[Path, ...], tuple[Path | None, ...]]:
    """Image and depth (None where there is none) of each frame. There may be more poses than images."""
    images = numbered_files(folder / _IMAGES, _IMAGE)
    depths = numbered_files(folder / _DEPTH, r"(\d+)\.(?:npy|png)") if is_there(folder / _DEPTH) else {}
    frames = require_unbroken(images, {0, *depths}, lambda number: folder / _IMAGES / _image_name(images, number))
    require_poses(folder / _POSES, poses=poses, images=len(frames))
    return tuple(images[number] for number in frames), tuple(map(depths.get, frames))


def _image_name(images: Mapping[int, Path], number: int) -> str:
    """What the image of a frame would be called, next to the others."""
    if not images:
        return f"{number:06d}.png"
    shortest = min(images.values(), key=lambda path: len(path.stem))
    return f"{number:0{len(shortest.stem)}d}{shortest.suffix}"


def _namesakes(folder: Path, images: tuple[Path, ...]) -> tuple[Path | None, ...]:
    """Depth map of each image, by its name; None of one without."""
    paths = sorted(folder.iterdir()) if is_folder(folder) else []
    depths = {path.stem: path for path in paths if path.suffix in (".npy", ".png")}
    return tuple(depths.get(image.stem) for image in images)


def _times_in_names(images: tuple[Path, ...], unit: TimeUnit | None) -> NDArray[np.int64] | None:
    """(n,) int64: ns of names such as 1403636579763555584.png or 1305031102.175304.png; None where they are no times.

    `unit`: by default that in which the number can be a time since 1970; numbers with a point are seconds.
    """
    stems = [image.stem for image in images]
    if not all(re.fullmatch(r"\d{1,19}(?:\.\d{1,12})?", stem) for stem in stems):
        return None
    if unit is None:
        pointed = all("." in stem for stem in stems)
        if not pointed and (any("." in stem for stem in stems) or min(map(int, stems)) < _FIRST_CLOCK):
            return None
        unit = TimeUnit.s if pointed else unit_of_clock(float(stems[0]))
    times = [int(Decimal(stem) * (TimeUnit.ns.per_second // unit.per_second)) for stem in stems]
    increasing = all(first < second for first, second in pairwise(times))
    return np.array(times, np.int64) if increasing and times[-1] < 2**63 else None


def _numbers_of_frames(
    folder: Path,
    images: tuple[Path, ...],
    frames: tuple[Path, ...],
    times_s: NDArray[np.float64] | None,
    units: tuple[TimeUnit | None, TimeUnit | None],
) -> tuple[int, ...]:
    """Which image of the second camera is that of each frame, by times or by names; -1 where none is.

    `times_s`: of frames; `units`: of a file of times, and of times in names.
    """
    others_s = _timestamps(folder / _TIMES, len(images), units[0])
    if others_s is not None and (times_s is None or len(others_s) < len(images) or (np.diff(others_s) <= 0.0).any()):
        found = f"{counted(len(others_s), 'time')} for {counted(len(images), 'image')} of the second camera"
        raise DataError(folder / _TIMES, found, "an increasing time of each, and times of the first camera too")
    if others_s is None and (times_ns := _times_in_names(images, units[1])) is not None:
        others_s = times_ns / 1e9
    if times_s is not None and others_s is not None:
        numbers = tuple(nearest(times_s, others_s, max_gap_s=_SAME_S).tolist())
    else:
        by_name = {_number_or_name(image): number for number, image in enumerate(images)}
        numbers = tuple(by_name.get(_number_or_name(frame), -1) for frame in frames)
    if max(numbers, default=-1) < 0:
        found = f"no image of any of {counted(len(frames), 'frame')}, such as {images[0].name}"
        raise DataError(folder, found, f"names or times of the first camera, such as {frames[0].name}")
    return numbers


def _number_or_name(image: Path) -> int | str:
    return int(image.stem) if image.stem.isdecimal() else image.stem


def _gap_notes(images: tuple[Path, ...]) -> tuple[str, ...]:
    """A sentence where numbers of images jump, as if frames between were missing."""
    matches = [re.search(r"(\d{1,18})\D*$", image.stem) for image in images]
    counted_up = [int(match[1]) for match in matches if match]
    steps = np.diff(counted_up) if len(counted_up) == len(images) else np.empty(0)
    if not len(steps) or steps.max() == steps.min():
        return ()
    at = int(np.argmax(steps != np.median(steps)))
    return (f"the numbers of images jump from {images[at].name} to {images[at + 1].name}: frames may be missing",)


def _poses(rows: NDArray[np.float64], places: list[str]) -> NDArray[np.float64]:
    """(n, 4, 4) float64: the pose of each row, all NaN where every field of the row is nan."""
    posed = np.asarray(~np.isnan(rows).all(axis=1))
    poses = no_poses(len(rows))
    poses[posed] = quaternion_poses(rows[posed, :3], rows[posed, 3:], list(compress(places, posed)))
    return poses


def _timestamps(path: Path, n_frames: int, unit: TimeUnit | None) -> NDArray[np.float64] | None:
    """(n,) float64, seconds; None where there is no file. Like poses, times beyond the last image are left out."""
    if not is_there(path):
        return None
    rows, places = read_rows(path, "timestamp_s")
    return seconds_of(rows[:n_frames, 0], unit, path, places, partial(with_option, "time_unit"))


def _depth_reader(folder: Path, depths: tuple[Path | None, ...], depth_unit_m: float | None) -> DepthReader:
    """What reads the depth files."""
    kinds = {path.suffix for path in depths if path is not None}
    if len(kinds) > 1:
        raise DataError(folder / _DEPTH, "both .npy and .png files", "files of one kind")
    if ".png" not in kinds:
        return read_depth_npy
    if depth_unit_m is None:
        raise DataError(folder / _CAMERA, "no depth_unit_m", "it, since the depths are 16-bit PNG files")
    return partial(read_depth_png16, metres_per_unit=depth_unit_m)


def _with_radius(read: DepthReader, radius_px: float | None, path: Path, camera: CameraModel) -> DepthMap:
    return replace(read(path, camera), radius_px=radius_px)
