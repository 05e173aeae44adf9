"""The reader of recordings in the format of the TUM RGB-D benchmark (Sturm et al., IROS 2012): see docs/formats.md.

The cameras of published recordings, and what their poses are poses of, are known:

TUM RGB-D: the benchmark's page on file formats, cameras of ROS calibrations; freiburg3 is published undistorted.
ICL-NUIM: the data set's page; its images come from a renderer whose y axis points up, so fy is negative.
Bonn RGB-D dynamic: the data set's page; its poses are those of markers on the camera, in another convention of axes.
"""

import os
import re
from collections.abc import Callable, Iterator
from collections.abc import Sequence as Items
from dataclasses import KW_ONLY, dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, Positive, require_bounds, require_finite
from tracknoise.exceptions import DataError
from tracknoise.foreign_files import is_number, read_text
from tracknoise.geometry.cameras import DISTORTION_COUNTS, Camera, CameraModel
from tracknoise.geometry.pose import PosePath, nearest, nearest_rigid
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.camera_files import CameraFile, Lens, read_camera_file
from tracknoise.sequences.images import first_readable, image_size, read_depth_png16
from tracknoise.sequences.likely_times import require_likely_rate, require_pose_rate, require_seconds
from tracknoise.sequences.poses import no_poses, read_rows
from tracknoise.sequences.recorded import ImageFiles, RecordedSequence, depth_files, depth_notes
from tracknoise.sequences.scenes import SceneReader, find_scenes, with_option
from tracknoise.sequences.sequence import Body
from tracknoise.sequences.timed_poses import (
    PosesOf,
    Trajectory,
    in_order,
    order_notes,
    path_through,
    poses_at,
    require_distinct,
    trajectory,
)
from tracknoise.tables.identity import SequenceId
from tracknoise.text import counted
from tracknoise.time_units import TimeUnit


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Recording:
    """Recordings with one camera."""

    name: str  # of the recordings, for notes
    pattern: str  # found in the names of their folders
    place: str | None  # what all of them show; None where they show several places
    camera: Camera  # published intrinsics
    upside_down: bool = False  # whether the published fy is negative: the y axes of camera and world point up
    # (4, 4) float64: from the camera to what the poses are poses of; None where that is the camera
    body_from_camera: NDArray[np.float64] | None = None


def _bonn_body_from_camera() -> NDArray[np.float64]:
    """Published as T_ros T_m after the pose; the rotation of T_m has a scale of 1.06, which is left out."""
    axes = np.array([[-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    marker = [
        [1.0157, 0.1828, -0.2389, 0.0113],
        [0.0009, -0.8431, -0.6413, -0.0098],
        [-0.3009, 0.6147, -0.8085, 0.0111],
        [0.0, 0.0, 0.0, 1.0],
    ]
    rigid, _ = nearest_rigid(np.array([marker]))
    body_from_camera: NDArray[np.float64] = axes @ rigid[0]
    return body_from_camera


_ICL_NUIM = Camera(640, 480, 481.2, 480.0, 319.5, 239.5)
RECORDINGS = (
    Recording(
        name="freiburg1",
        pattern=r"freiburg1|(?<![a-z])fr1(?![0-9])",
        place="freiburg1",
        camera=Camera(640, 480, 517.3, 516.5, 318.6, 255.3, (0.2624, -0.9531, -0.0054, 0.0026, 1.1633)),
    ),
    Recording(
        name="freiburg2",
        pattern=r"freiburg2|(?<![a-z])fr2(?![0-9])",
        place="freiburg2",
        camera=Camera(640, 480, 520.9, 521.0, 325.1, 249.7, (0.2312, -0.7849, -0.0033, -0.0001, 0.9172)),
    ),
    Recording(
        name="freiburg3",
        pattern=r"freiburg3|(?<![a-z])fr3(?![0-9])",
        place="freiburg3",
        camera=Camera(640, 480, 535.4, 539.2, 320.1, 247.6),
    ),
    Recording(
        name="ICL-NUIM",
        pattern=r"living_?room_?traj",
        place="living_room",
        camera=_ICL_NUIM,
        upside_down=True,
    ),
    Recording(
        name="ICL-NUIM",
        pattern=r"office_?room_?traj|^traj[0-9]n?_frei_png",
        place="office_room",
        camera=_ICL_NUIM,
        upside_down=True,
    ),
    Recording(name="ICL-NUIM", pattern=r"icl[-_ ]?nuim", place=None, camera=_ICL_NUIM, upside_down=True),
    Recording(
        name="Bonn",
        pattern=r"rgbd_bonn",
        place="bonn",
        camera=Camera(
            640, 480, 542.822841, 542.57687, 315.59352, 237.756098, (0.039903, -0.099343, -0.00073, -0.000144, 0.0)
        ),
        body_from_camera=_bonn_body_from_camera(),
    ),
)


def find_recording(names: list[str]) -> Recording | None:
    """The known recording that a folder's name fits; None if it fits none."""
    pairs = ((name, recording) for name in names for recording in RECORDINGS)
    return next((recording for name, recording in pairs if re.search(recording.pattern, name.lower())), None)


COLOUR, DEPTH = "rgb.txt", "depth.txt"
PAIRS = ("associations.txt", "associated.txt", "association.txt")
"""Names that lists of pairs have."""
SEPARATOR = ","
"""What the tools of the benchmark take between fields, besides white space."""

_PAIR = "timestamp filename timestamp filename"
_POSE_FIELDS = (7, 8)
"""How many fields of a pose may follow a pair: without its time, and with it."""

Rows = list[tuple[str, list[str]]]

_UNIT, _POSE_UNIT = (partial(with_option, name) for name in ("time_unit", "pose_time_unit"))


@dataclass(frozen=True, slots=True, eq=False)
class FileList:
    """Files in order of time."""

    path: Path  # of the list
    times_s: NDArray[np.float64]  # (n,) float64, seconds, increasing
    files: tuple[Path, ...]  # one for each
    notes: tuple[str, ...] = ()  # what was corrected, one sentence each


NO_FILES = FileList(Path(), np.empty(0), ())


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Which depth map belongs to which image, as a file states."""

    path: Path
    depths: dict[Path, tuple[float, Path]]  # by image: time, seconds, and file of its depth map


def read_lists(folder: Path, unit: TimeUnit) -> tuple[FileList, FileList | Pairs]:
    """Read which images and depth maps a recording has, at times in a unit."""
    colour, depth = folder / COLOUR, folder / DEPTH
    pairs = next((folder / name for name in PAIRS if (folder / name).exists()), None)
    if not colour.exists():
        return (_read_list(colour, unit), NO_FILES) if pairs is None else _read_pairs(pairs, unit)
    if pairs is not None and _names_pairs(pairs):
        return _read_list(colour, unit), _read_pairs(pairs, unit)[1]
    return _read_list(colour, unit), _read_list(depth, unit) if depth.exists() else NO_FILES


def _read_list(path: Path, unit: TimeUnit) -> FileList:
    rows = _rows(path, "timestamp filename")
    return _file_list(path, [(place, fields[0], fields[1]) for place, fields in rows], unit)


def _names_pairs(path: Path) -> bool:
    """Whether a list has rows, and not those of images and poses, which lists of the same names may hold."""
    first = next(_fields(path, _PAIR), None)
    return first is not None and not any(map(is_number, first[1][1:4:2]))


def _read_pairs(path: Path, unit: TimeUnit) -> tuple[FileList, Pairs]:
    """The benchmark's script writes colour first, ICL-NUIM depth first: the names of the folders decide."""
    rows = _rows(path, _PAIR, further=_POSE_FIELDS)
    images: list[tuple[str, str, str]] = []
    depths: dict[Path, tuple[float, Path]] = {}
    for place, fields in rows:
        if number := next(filter(is_number, fields[1:4:2]), None):
            raise DataError(place, f"{number} as a filename", _PAIR)
        if _depth_first(fields) != _depth_first(rows[0][1]):
            raise DataError(place, "image and depth map in another order", "that of the first row")
        pair = (fields[:2], fields[2:4])
        (image_stamp, image), (depth_stamp, depth) = reversed(pair) if _depth_first(fields) else pair
        images.append((place, image_stamp, image))
        stated = (float(_seconds([place], [depth_stamp], unit)[0]), _file(path, depth))
        if depths.setdefault(_file(path, image), stated)[1] != stated[1]:
            raise DataError(place, f"another depth map of {image}", "one for each image")
    return _file_list(path, images, unit), Pairs(path, depths)


def _depth_first(fields: list[str]) -> bool:
    return "depth" in Path(fields[1].replace("\\", "/")).parts[:1]


def _rows(path: Path, columns: str, further: tuple[int, ...] = ()) -> Rows:
    """Fields of each row with its place; `further`: how many more than the columns there may be."""
    rows, expected = [], len(columns.split())
    for place, fields in _fields(path, columns):
        if len(fields) - expected not in (0, *further):
            raise DataError(place, counted(len(fields), "field"), f"{expected} ({columns})")
        rows.append((place, fields))
    return rows


def _fields(path: Path, columns: str) -> Iterator[tuple[str, list[str]]]:
    """Place and fields of each row. Blank lines and ``#`` comments are skipped."""
    for number, line in enumerate(read_text(path, f"rows of {columns}").splitlines(), start=1):
        fields = line.replace(SEPARATOR, " ").split()
        if fields and not fields[0].startswith("#"):
            yield f"{path}:{number}", fields


def _file(path: Path, name: str) -> Path:
    return path.parent / name.replace("\\", "/")


def _file_list(path: Path, rows: list[tuple[str, str, str]], unit: TimeUnit) -> FileList:
    if not rows:
        raise DataError(path, "no files", "rows of a timestamp and a file")
    places, stamps, names = zip(*rows, strict=True)
    times_s = _seconds(places, stamps, unit)
    require_distinct(path, times_s, names)
    order = in_order(times_s)
    files = tuple(_file(path, rows[index][2]) for index in order)
    return FileList(path, times_s[order], files, order_notes(path, times_s))


def _seconds(places: Items[str], stamps: Items[str], unit: TimeUnit) -> NDArray[np.float64]:
    """(n,) float64: seconds of times that are written in a unit."""
    for place, stamp in zip(places, stamps, strict=True):
        if not is_number(stamp):
            raise DataError(place, repr(stamp), "a timestamp, seconds")
    times_s = np.array([float(stamp) for stamp in stamps]) / unit.per_second
    require_seconds(times_s, places, _UNIT, taken=unit)
    return times_s


CAMERA_FILES = ("camera.yaml", "camera.yml", "camera.json", "calibration.yaml", "calibration.yml")
PLAIN_CALIBRATION = "calibration.txt"
_PINHOLE, _COEFFICIENTS = "fx fy cx cy", "k1 k2 p1 p2 k3 k4 k5 k6"
DEPTH_UNIT_M = 1 / 5000
"""Depth of the integer 1 in the benchmark, metres."""

_REGISTERED = "depth maps are assumed to be registered to the images pixel by pixel, as published"
_FLIP = np.diag((1.0, -1.0, 1.0, 1.0))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Calibration:
    """The camera of a recording.

    Parameters
    ----------
    camera
        Intrinsics, with y down.
    notes
        Where they are from, and what was assumed.
    body_from_camera
        (4, 4) float64: from the camera to what the poses are poses of; None where that is the camera.
    upside_down
        Whether the y axes of the recorded poses point up, in the frames of camera and world.
    depth_unit_m
        Depth of the integer 1, metres.
    shutter
        Rolling shutter that a file of the camera states; None where there is none.
    body
        What the camera is mounted on, if its file states where.
    """

    camera: CameraModel
    notes: tuple[str, ...]
    body_from_camera: NDArray[np.float64] | None = None
    upside_down: bool = False
    depth_unit_m: float = DEPTH_UNIT_M
    shutter: RollingShutter | None = None
    body: Body | None = None

    def world_from_camera(self, recorded: NDArray[np.float64]) -> NDArray[np.float64]:
        """Poses of the camera, (n, 4, 4) float64, from the recorded ones."""
        if self.body_from_camera is not None:
            recorded = recorded @ self.body_from_camera
        return _FLIP @ recorded @ _FLIP if self.upside_down else recorded


def known_recording(root: Path, folder: Path) -> Recording | None:
    """The recording that the name of a folder, or of one above it down from the root, fits; None if none does."""
    levels = [level for level in (folder, *folder.parents) if root in (level, *level.parents)]
    return find_recording([Path(os.path.abspath(level)).name for level in levels])  # noqa: PTH100


def find_calibration(
    folder: Path,
    images: tuple[Path, ...],
    known: Recording | None,
    *,
    camera_file: Path | None,
    poses_of: PosesOf,
    read_camera: Callable[[Path], CameraFile],
) -> Calibration:
    """Find the camera: in the given file, in one of the recording's folder, or the published one."""
    candidates = (camera_file, *(folder / name for name in CAMERA_FILES))
    file = next((path for path in candidates if path is not None and (path == camera_file or path.exists())), None)
    if file is not None:
        return _from_file(file, read_camera(file), known, poses_of)
    if poses_of is PosesOf.body:
        raise DataError(folder, "poses of a body and no camera file", "a camera file that states where the camera is")
    if (folder / PLAIN_CALIBRATION).exists():
        return _from_plain_numbers(folder / PLAIN_CALIBRATION, images, known)
    if known is None:
        names = ", ".join((*CAMERA_FILES, PLAIN_CALIBRATION))
        expected = f"one of {names}, or {with_option('camera_file', 'FILE')}"
        raise DataError(folder, "no camera, and a name that is not that of a known recording", expected)
    return _published(folder, known)


def _from_file(file: Path, read: CameraFile, recording: Recording | None, poses_of: PosesOf) -> Calibration:
    """A known recording's poses are of what is published, and in its axes, whatever the file states."""
    body_from_camera = None if recording is None else recording.body_from_camera
    upside_down = recording is not None and recording.upside_down and poses_of is PosesOf.camera
    notes = [f"the camera is that of {file}", *_upside_down_notes(recording, upside_down)]
    if poses_of is PosesOf.body:
        if read.body_from_camera is None:
            raise DataError(file, "no position of the camera on the body", "T_BS or T_cam_imu, for poses of the body")
        body_from_camera = read.body_from_camera
        notes += ["the poses are those of the body, and moved to the camera", *_shift_notes(read.time_shift_s)]
    elif read.body_from_camera is not None:
        notes.append("the poses are taken as those of the camera, though its file states where it is on a body")
    return Calibration(
        camera=read.camera,
        notes=(*notes, *read.notes),
        body_from_camera=body_from_camera,
        upside_down=upside_down,
        depth_unit_m=read.depth_unit_m or DEPTH_UNIT_M,
        shutter=read.shutter,
        body=read.body,
    )


def _from_plain_numbers(path: Path, images: tuple[Path, ...], recording: Recording | None) -> Calibration:
    rows, _ = read_rows(path, _plain_columns(path))
    if len(rows) != 1:
        raise DataError(path, counted(len(rows), "row"), "one of fx fy cx cy")
    fx, fy, cx, cy, *distortion = rows[0].tolist()
    if not (np.isfinite(rows).all() and fx > 0.0 and fy != 0.0):
        raise DataError(path, f"fx {fx:g}, fy {fy:g}, cx {cx:g}, cy {cy:g}", "focal lengths and a principal point, px")
    if distortion and fy < 0.0:
        distortion[2] = -distortion[2]  # p1 changes its sign with the y axis
    camera = Camera(*image_size(first_readable(images)), fx, abs(fy), cx, cy, tuple(distortion))
    lens = "with radial-tangential distortion" if distortion else "without distortion"
    by_name = fy > 0.0 and recording is not None and recording.upside_down
    notes = (*_flip_notes(fy < 0.0), *_upside_down_notes(recording, by_name))
    return Calibration(
        camera=camera,
        notes=(f"the camera is that of {path}, {lens}", *notes),
        body_from_camera=None if recording is None else recording.body_from_camera,
        upside_down=fy < 0.0 or by_name,
    )


def _plain_columns(path: Path) -> str:
    """Names of the numbers in a row: those of as many distortion coefficients as the first row has, or none."""
    lines = read_text(path, f"a row of {_PINHOLE}").splitlines()
    fields = next((line.split() for line in lines if line.strip() and not line.lstrip().startswith("#")), [])
    count = len(fields) - len(_PINHOLE.split())
    coefficients = _COEFFICIENTS.split()[: count if count in DISTORTION_COUNTS else 0]
    return " ".join([_PINHOLE, *coefficients])


def _published(folder: Path, recording: Recording) -> Calibration:
    source = f"{folder}: no camera file, so the published camera of {recording.name} is used, by the name of the folder"
    moved = f"the poses were moved from the markers to the camera as published for {recording.name}"
    return Calibration(
        camera=recording.camera,
        notes=(
            source,
            _REGISTERED,
            *((moved,) if recording.body_from_camera is not None else ()),
            *_flip_notes(recording.upside_down),
        ),
        body_from_camera=recording.body_from_camera,
        upside_down=recording.upside_down,
    )


def _flip_notes(upside_down: bool) -> tuple[str, ...]:
    note = "fy is negative: the y axes of camera and world point up, and both were turned down together with the poses"
    return (note,) if upside_down else ()


def _upside_down_notes(recording: Recording | None, upside_down: bool) -> tuple[str, ...]:
    """Of a recording whose poses are published with axes that no camera file can state."""
    if recording is None or not upside_down:
        return ()
    return (f"the y axes of the poses of {recording.name} point up, and were turned down",)


def _shift_notes(shift_s: float | None) -> tuple[str, ...]:
    """Of a time between camera and body that a camera file states; the option alone says what the poses' clock is."""
    if not shift_s:
        return ()
    return (f"the camera file states a time shift of {1e3 * shift_s:g} ms; only the option time_shift_s is applied",)


_GROUND_TRUTH = "groundtruth.txt"
_LARGEST_FRAME_NUMBER = 1e6
_LARGEST_STEP = 5
"""Largest usual step between listed numbers of frames, of which only every n-th is kept."""
_NUMBERS = (
    "the timestamps are whole numbers: they are taken as numbers of frames, so times are unknown; if they are times, "
    "state time_unit"
)
_COLUMNS = "timestamp tx ty tz qx qy qz qw"


@dataclass(frozen=True, slots=True)
class Tum(SceneReader):
    """Reader of the TUM RGB-D benchmark, ICL-NUIM, Bonn RGB-D, ETH3D SLAM and all that is written like them.

    Parameters
    ----------
    root
        Folder of one recording, or of several at any depth.
    camera_file
        Intrinsics; by default a camera file in the recording's folder, else the published camera that its name fits.
    camera
        Which camera of that file, where it has several, such as ``cam1``; by default the first.
    lens
        Lens of a file of OpenCV with 4 coefficients and no word for it: ``radtan`` or ``equidistant``.
    poses_of
        What the poses are poses of: the camera, or a body on which the camera file states the camera's place.
    depth_unit_m
        Depth of the integer 1, metres; by default what the camera file states, else 1/5000.
    max_gap_s
        Largest time between an image and its depth map, seconds, where no list of pairs states which it is.
    max_pose_gap_s
        Longest time between two poses that are interpolated, seconds. Images in longer gaps have no pose.
    time_shift_s
        Added to the times of the images to get the clock of the poses, seconds.
    time_unit, pose_time_unit
        Units of the times of images and of poses: s, ms, us or ns. By default seconds, at 1 to 1,000 Hz, and for poses
        that of the images.
    """

    name: ClassVar[str] = "tum"
    description: ClassVar[str] = "TUM RGB-D and its format: ICL-NUIM, Bonn, ETH3D SLAM; depth/5000, poses by time"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    camera_file: Path | None = None
    camera: str | None = None
    lens: Lens | None = None
    poses_of: PosesOf = PosesOf.camera
    depth_unit_m: Positive | None = None
    max_gap_s: NotNegative = 0.02
    max_pose_gap_s: NotNegative = 0.1
    time_shift_s: float = 0.0
    time_unit: TimeUnit | None = None
    pose_time_unit: TimeUnit | None = None

    def __post_init__(self) -> None:
        require_bounds(self)
        require_finite("time_shift_s", self.time_shift_s)

    def recordings(self) -> list[SequenceId]:
        """All recordings: see `ImageReader.recordings`."""
        return self.sequences()

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one recording, except for its images and depths."""
        recorded = _read_trajectory(self._folder(sequence), self.pose_time_unit or self.time_unit or TimeUnit.s)
        return self._opened(sequence, recorded)

    def open_images(self, sequence: SequenceId) -> RecordedSequence:
        """The same without poses: see `ImageReader.open_images`."""
        return self._opened(sequence, None)

    def _opened(self, sequence: SequenceId, recorded: Trajectory | None) -> RecordedSequence:
        folder = self._folder(sequence)
        unit = self.time_unit or TimeUnit.s
        images, depths = read_lists(folder, unit)
        recording = known_recording(self.root, folder)
        calibration = find_calibration(
            folder,
            images.files,
            recording,
            camera_file=self.camera_file,
            poses_of=self.poses_of,
            read_camera=partial(self._camera_of, images.files),
        )
        timestamps_s, time_notes = self._timestamps(images, recorded)
        poses, path, pose_notes = self._camera_poses(images, timestamps_s, recorded, calibration)
        paths, association_notes = _depths_of(images, depths, max_gap_s=self.max_gap_s)
        read_depth = partial(read_depth_png16, metres_per_unit=self.depth_unit_m or calibration.depth_unit_m)
        return RecordedSequence(
            id=sequence,
            source=str(folder),
            camera=calibration.camera,
            world_from_camera=poses,
            poses_elsewhere=recorded is None,
            images=ImageFiles(images.files, calibration.camera),
            depths=depth_files(paths, calibration.camera, read_depth),
            notes=(*calibration.notes, *pose_notes, *images.notes, *time_notes, *association_notes),
            timestamps_s=timestamps_s,
            time_unit_stated=self.time_unit is not None,
            clock_start_ns=None if timestamps_s is None else round(1e9 * images.times_s[0]),
            group=None if recording is None else recording.place,
            shutter=calibration.shutter,
            body=calibration.body,
            path=path,
        )

    def _camera_poses(
        self,
        images: FileList,
        timestamps_s: NDArray[np.float64] | None,
        recorded: Trajectory | None,
        calibration: Calibration,
    ) -> tuple[NDArray[np.float64], PosePath | None, tuple[str, ...]]:
        """Poses of the camera at the times of images, and between them."""
        if recorded is None:
            return no_poses(len(images.files)), None, ()
        taken, notes = poses_at(recorded, images.times_s + self.time_shift_s, max_gap_s=self.max_pose_gap_s)
        poses = calibration.world_from_camera(taken)
        if timestamps_s is None:
            return poses, None, notes
        start_s = images.times_s[0] + self.time_shift_s
        path = PosePath(recorded.times_s - start_s, calibration.world_from_camera(recorded.poses))
        return poses, path_through(timestamps_s, poses, path, max_gap_s=self.max_pose_gap_s), notes

    def _camera_of(self, images: tuple[Path, ...], file: Path) -> CameraFile:
        """A file's camera; an image says its size where the file does not."""
        return read_camera_file(file, camera=self.camera, size=image_size(first_readable(images)), lens=self.lens)

    def _scenes(self) -> dict[str, Path]:
        expected = f"folders with {COLOUR} or {PAIRS[0]}"
        return find_scenes(self.root, lambda _, files: not {COLOUR, *PAIRS}.isdisjoint(files), expected=expected)

    def _timestamps(
        self, images: FileList, recorded: Trajectory | None
    ) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
        """Times since the first image; None where small whole numbers show that they are numbers of frames."""
        times_s, unit = images.times_s, self.time_unit
        if unit is None and _are_numbers(times_s):
            return None, (_NUMBERS,)
        if unit is None:
            require_likely_rate(times_s, images.path, _UNIT)
        if recorded is not None and self.pose_time_unit is None:
            require_pose_rate(recorded.times_s, times_s, recorded.path, _POSE_UNIT, taken=unit or TimeUnit.s)
        return times_s - times_s[0], ()


def _are_numbers(times: NDArray[np.float64]) -> bool:
    """Whether times are numbers of frames: small whole ones in small steps. Larger steps are those of milliseconds."""
    if len(times) < 2 or times[-1] >= _LARGEST_FRAME_NUMBER or not np.array_equal(times, np.rint(times)):
        return False
    return bool(np.median(np.diff(times)) <= _LARGEST_STEP)


def _read_trajectory(folder: Path, unit: TimeUnit) -> Trajectory:
    path = folder / _GROUND_TRUTH
    if not path.exists():
        path = next(iter(sorted(folder.glob("*.gt.freiburg"))), path)
    rows, places = read_rows(path, _COLUMNS, separator=SEPARATOR)
    times_s = rows[:, 0] / unit.per_second
    require_seconds(times_s, places, _POSE_UNIT, taken=unit)
    return trajectory(path, times_s, rows[:, 1:], places)


def _depths_of(
    images: FileList, depths: FileList | Pairs, *, max_gap_s: float
) -> tuple[tuple[Path | None, ...], tuple[str, ...]]:
    """The depth map of each image, and sentences on how far apart in time they are."""
    if isinstance(depths, Pairs):
        return _stated_depths(images, depths)
    index = nearest(images.times_s, depths.times_s, max_gap_s=max_gap_s)
    paths = tuple(depths.files[depth] if depth >= 0 else None for depth in index)
    if not depths.files:
        return paths, ()
    used = np.flatnonzero(index >= 0)
    if not len(used):
        found = f"depth maps: {len(depths.files)}, but none within {max_gap_s:g} s of an image"
        raise DataError(depths.files[0].parent, found, "depth maps at the times of images, or a larger max_gap_s")
    apart = _apart(depths.times_s[index[used]] - images.times_s[used])
    return paths, (*depths.notes, f"the depth of an image is the nearest in time: {apart}", *depth_notes(paths))


def _stated_depths(images: FileList, pairs: Pairs) -> tuple[tuple[Path | None, ...], tuple[str, ...]]:
    """The depth map that a list of pairs names for each image, however far in time; None for an image without one."""
    stated = [pairs.depths.get(image) for image in images.files]
    apart_s = [depth[0] - time_s for depth, time_s in zip(stated, images.times_s, strict=True) if depth is not None]
    if not apart_s:
        raise DataError(pairs.path, "no pair of an image of the recording", f"images that {COLOUR} lists")
    paths = tuple(None if depth is None else depth[1] for depth in stated)
    note = f"the depth of an image is the one that {pairs.path} names: {_apart(np.array(apart_s))}"
    unlisted = len(pairs.depths) - len(apart_s)
    left_out = f"{pairs.path}: {counted(unlisted, 'pair')} of images that {COLOUR} does not list, left out"
    return paths, (note, *((left_out,) if unlisted else ()), *depth_notes(paths))


def _apart(apart_s: NDArray[np.float64]) -> str:
    apart_ms = 1e3 * np.abs(apart_s)
    return f"{np.median(apart_ms):.1f} ms from it in the median, {apart_ms.max():.1f} ms at most"
