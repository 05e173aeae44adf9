"""A plain layout on disk, for your own data and for simulated sequences: see docs/folder-layout.md.

``images/NNNNNN.png``, ``depth/NNNNNN.npy``, ``poses.txt`` and ``camera.json``; frames are numbered from 0.
"""

import json
import math
from collections.abc import Callable
from dataclasses import KW_ONLY, asdict, dataclass, replace
from functools import partial
from itertools import compress
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import require_at_least
from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_text
from tracknoise.geometry.camera import DISTORTION_COUNTS, Camera
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import position_rows
from tracknoise.sequences.frame_files import DepthReader, ImageFiles, depth_files, depth_notes
from tracknoise.sequences.images import read_depth_npy, read_depth_png16
from tracknoise.sequences.new_folder import new_folder
from tracknoise.sequences.pinhole import pinhole_of
from tracknoise.sequences.poses import quaternion_poses, read_rows, require_poses, surplus_notes
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.scenes import find_scenes, numbered_files, parent_of, require_unbroken, scene_folder
from tracknoise.sequences.sequence import Sequence
from tracknoise.tables.identity import SequenceId

_IMAGES, _DEPTH, _POSES, _CAMERA = "images", "depth", "poses.txt", "camera.json"
_PARTS = frozenset((_IMAGES, _DEPTH, _POSES, _CAMERA))
_COLUMNS = "tx ty tz qx qy qz qw"
_COUNTS, _FOCAL, _CENTRE = ("width", "height"), ("fx", "fy"), ("cx", "cy")
_DISTORTION = "a list of 0, 4, 5 or 8 numbers (k1, k2, p1, p2, k3, k4, k5, k6)"
_SHOWN = 60
_OPTIONAL = ("distortion", "depth_unit_m", "source")


@dataclass(frozen=True, slots=True)
class Folder:
    """Reader of tracknoise's plain layout.

    Parameters
    ----------
    root
        Folder of one sequence, or a folder that contains several at any depth.
    depth_radius_px
        None for dense depth, which is interpolated. For sparse depth (lidar), the largest distance from a feature to
        the nearest pixel with depth, px.

    Raises
    ------
    ValueError
        If `depth_radius_px` is below 0 or not finite.
    """

    name: ClassVar[str] = "folder"
    description: ClassVar[str] = "tracknoise's plain layout: images/, depth/, poses.txt, camera.json"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    depth_radius_px: float | None = None

    def __post_init__(self) -> None:
        if self.depth_radius_px is not None:
            require_at_least("depth_radius_px", self.depth_radius_px, 0)

    def sequences(self) -> list[SequenceId]:
        """All sequences, sorted: each folder that holds two of ``images``, ``depth``, ``poses.txt``, ``camera.json``.

        A sequence that lacks something is listed, so that `open` reports what is missing.

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
            If an image is missing, or the poses or the camera are missing or damaged.
        UnknownNameError
            If there is no such scene or lighting.
        """
        folder = scene_folder(self._scenes(), sequence)
        camera, depth_unit_m = _read_camera(folder / _CAMERA)
        rows, places = read_rows(folder / _POSES, _COLUMNS)
        images, depths = _frame_files(folder, poses=len(rows))
        read_depth = partial(_with_radius, _depth_reader(folder, depths, depth_unit_m), self.depth_radius_px)
        return RecordedSequence(
            id=sequence,
            source=str(folder / _IMAGES),
            camera=camera,
            world_from_camera=_poses(rows[: len(images)], places),
            images=ImageFiles(images, camera),
            depths=depth_files(depths, camera, read_depth),
            notes=(
                *surplus_notes(folder / _POSES, poses=len(rows), images=len(images)),
                *(depth_notes(depths) if (folder / _DEPTH).exists() else ()),
            ),
            group=parent_of(sequence.scene),
        )

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
        If the camera is not a pinhole camera or changes, or the folder is neither new nor empty, or cannot be written.
    """
    with new_folder(path) as unfinished:
        _write_files(sequence, unfinished, progress)


def _write_files(sequence: Sequence, folder: Path, progress: Callable[[int, int], None] | None) -> None:
    (folder / _IMAGES).mkdir()
    (folder / _DEPTH).mkdir()
    for index in range(len(sequence)):
        _, png = cv2.imencode(".png", sequence.image(index))
        (folder / _IMAGES / f"{index:06d}.png").write_bytes(png.tobytes())
        depth = sequence.depth(index)
        if depth is not None:
            np.save(folder / _DEPTH / f"{index:06d}.npy", _plain(depth))
        if progress is not None:
            progress(index + 1, len(sequence))
    source = f"{sequence.id.dataset} {sequence.id.scene} {sequence.id.lighting}"
    camera = {**asdict(pinhole_of(sequence)), "source": source}
    (folder / _CAMERA).write_text(json.dumps(camera, indent=2) + "\n", encoding="utf-8")
    (folder / _POSES).write_text(_pose_lines(sequence.world_from_camera), encoding="utf-8")


def _plain(depth: DepthMap) -> NDArray[np.float32]:
    """(height, width) float32: metres, 0 where there is no depth."""
    return np.where(depth.valid, depth.depth_m, 0.0).astype(np.float32)


def _pose_lines(world_from_camera: NDArray[np.float64]) -> str:
    """One row per frame, with all digits of a float64; nan where it has no pose."""
    rows = position_rows(world_from_camera, canonical=False).tolist()
    lines = (" ".join(map(repr, row)) for row in rows)
    return "\n".join([f"# {_COLUMNS} (world_from_camera, metres; one row per frame)", *lines, ""])


def _frame_files(folder: Path, *, poses: int) -> tuple[tuple[Path, ...], tuple[Path | None, ...]]:
    """Image and depth (None where there is none) of each frame. There may be more poses than images."""
    images = numbered_files(folder / _IMAGES, r"(\d+)\.(?:png|jpe?g)")
    depths = numbered_files(folder / _DEPTH, r"(\d+)\.(?:npy|png)") if (folder / _DEPTH).exists() else {}
    frames = require_unbroken(images, {0, *depths}, lambda number: folder / _IMAGES / f"{number:06d}.png")
    require_poses(folder / _POSES, poses=poses, images=len(frames))
    return tuple(images[number] for number in frames), tuple(map(depths.get, frames))


def _poses(rows: NDArray[np.float64], places: list[str]) -> NDArray[np.float64]:
    """(n, 4, 4) float64: the pose of each row, all NaN where every field of the row is nan."""
    known = np.asarray(~np.isnan(rows).all(axis=1))
    poses = np.full((len(rows), 4, 4), np.nan)
    poses[known] = quaternion_poses(rows[known, :3], rows[known, 3:], list(compress(places, known)))
    return poses


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


def _read_camera(path: Path) -> tuple[Camera, float | None]:
    """Camera and depth unit of a ``camera.json`` file."""
    entries = _read_object(path)
    _require_keys(path, entries)
    width, height = (_number(path, key, entries[key], whole=True, positive=True) for key in _COUNTS)
    fx, fy = (_number(path, key, entries[key], positive=True) for key in _FOCAL)
    cx, cy = (_number(path, key, entries[key]) for key in _CENTRE)
    distortion = entries.get("distortion", [])
    if not isinstance(distortion, list) or len(distortion) not in DISTORTION_COUNTS:
        raise DataError(path, f"distortion = {_shown(distortion)}", _DISTORTION)
    coefficients = tuple(_number(path, "distortion", value) for value in distortion)
    unit = _number(path, "depth_unit_m", entries["depth_unit_m"], positive=True) if "depth_unit_m" in entries else None
    camera = Camera(int(width), int(height), fx, fy, cx, cy, coefficients)
    if not camera.is_invertible:
        found = "fx, fy, cx, cy and distortion that cannot be inverted over the whole image"
        raise DataError(path, found, "a ray of its own for every pixel")
    return camera, unit


def _require_keys(path: Path, entries: dict[str, Any]) -> None:
    required = (*_COUNTS, *_FOCAL, *_CENTRE)
    expected = f"{', '.join(required)} and, if need be, {', '.join(_OPTIONAL)}"
    for key in required:
        if key not in entries:
            raise DataError(path, f"no {key}", expected)
    for key in entries:
        if key not in (*required, *_OPTIONAL):
            raise DataError(path, f"unknown key {key!r}", expected)


def _read_object(path: Path) -> dict[str, Any]:
    try:
        entries = json.loads(read_text(path, "the camera's width, height, fx, fy, cx and cy in JSON"))
    except json.JSONDecodeError as error:
        raise DataError(f"{path}:{error.lineno}", f"no JSON ({error.msg})", "a JSON object") from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits, or thousands of brackets
        raise DataError(path, "unreadable file", "a JSON object") from error
    if not isinstance(entries, dict):
        raise DataError(path, "JSON, but no object", "a JSON object")
    return entries


def _number(path: Path, key: str, value: Any, *, whole: bool = False, positive: bool = False) -> float:
    kinds = int if whole else int | float
    if isinstance(value, kinds) and not isinstance(value, bool):
        number = _finite(value)
        if number is not None and (number > 0.0 or not positive):
            return number
    raise DataError(
        path, f"{key} = {_shown(value)}", f"a {'whole' if whole else 'finite'} number{' above 0' if positive else ''}"
    )


def _finite(value: float) -> float | None:
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _shown(value: Any) -> str:
    """A value as JSON, cut off where it is long."""
    try:
        text = json.dumps(value)
    except RecursionError:
        return "lists in lists"
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
