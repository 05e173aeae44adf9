"""Recordings in the ASL layout of EuRoC MAV (Burri et al., IJRR 2016) and TUM-VI: see docs/formats.md.

A folder for each sensor lies below ``mav0``. Its ``data.csv`` has a time in nanoseconds in the first column, and names
of columns in a header, or none.
"""

import re
from dataclasses import KW_ONLY, dataclass
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, require_bounds, require_finite
from tracknoise.exceptions import DataError, TracknoiseError, UnknownNameError
from tracknoise.foreign_files import read_text
from tracknoise.geometry.pose import PosePath, invert
from tracknoise.sequences.camera_files import CameraFile, cameras_in, read_camera_file, read_yaml
from tracknoise.sequences.images import Levels, level_notes, require_levels
from tracknoise.sequences.likely_times import StatedBy, require_likely_rate, require_pose_rate
from tracknoise.sequences.poses import checked_poses, no_poses
from tracknoise.sequences.recorded import ImageFiles, RecordedSequence
from tracknoise.sequences.scenes import SceneReader, find_scenes, with_option
from tracknoise.sequences.second_camera import SomeImages
from tracknoise.sequences.sequence import Body, SecondCamera
from tracknoise.sequences.timed_poses import (
    in_order,
    order_notes,
    path_through,
    poses_at,
    require_distinct,
    trajectory,
)
from tracknoise.tables.identity import SequenceId
from tracknoise.text import counted
from tracknoise.time_units import TimeUnit, unit_of_clock

_DEVICE, _DATA, _SENSOR = "mav0", "data.csv", "sensor.yaml"
POSE_SOURCES = ("state_groundtruth_estimate0", "mocap0", "vicon0", "gt")
"""Folders of poses, best first: what others were fused and aligned into is better than a sensor alone."""

_POSITIONS_ONLY = "leica0"
_CHAIN_FOLDERS = (".", "dso", "mav0")
_CAMERA_CHAIN, _ANY_CHAIN, _CHAIN_WITH_IMU = "camchain.yaml", "*camchain*.yaml", "camchain-imucam"
"""Kalibr writes ``camchain-NAME.yaml`` or ``NAME-camchain.yaml``, and ``camchain-imucam`` where the body is known."""
_PLACES = (r"(MH)_\d", r"(V[12])_\d", r"dataset-([a-z]+)\d")


@dataclass(frozen=True, slots=True)
class Files:
    """The files of one recording."""

    folder: Path  # its own folder

    @property
    def device(self) -> Path:
        """The folder of all sensors: the recording's, if its sensors lie there."""
        return self.folder / _DEVICE if (self.folder / _DEVICE).exists() else self.folder

    def list_of_images(self, camera: str) -> Path:
        """The list of a camera's images."""
        if not (self.device / camera).exists():
            raise UnknownNameError("camera", camera, self.cameras())
        return self.device / camera / _DATA

    def cameras(self) -> list[str]:
        """Names of all cameras, sorted."""
        return sorted(folder.name for folder in self.device.glob("cam*") if folder.is_dir())

    def image(self, camera: str, name: str) -> Path:
        """An image from its name in the list."""
        return self.device / camera / "data" / name.removeprefix("data/")

    def calibration(self, camera: str) -> Path:
        """The file with a camera's intrinsics: its own, or a Kalibr chain of all cameras."""
        sensor_file = self.device / camera / _SENSOR
        return sensor_file if sensor_file.exists() else self._camera_chain(sensor_file)

    def _camera_chain(self, missing: Path) -> Path:
        """Kalibr's file: in the first folder that has one; those with the place of the cameras on the body first."""
        named = with_option("camera_file", "FILE")
        for folder in (self.folder / name for name in _CHAIN_FOLDERS):
            if (folder / _CAMERA_CHAIN).exists():
                return folder / _CAMERA_CHAIN
            chains = sorted(folder.glob(_ANY_CHAIN))
            best = [path for path in chains if _CHAIN_WITH_IMU in path.name] or chains
            if len(best) > 1:
                raise DataError(folder, f"several files: {', '.join(path.name for path in best)}", f"one, or {named}")
            if best:
                return best[0]
        raise DataError(missing, "no such file", f"it, {_CAMERA_CHAIN} in the recording, dso or mav0, or {named}")

    def pose_source(self, name: str | None) -> str:
        """The folder of the poses: the one of this name, or the best that there is."""
        sources = [source for source in POSE_SOURCES if (self.device / source / _DATA).exists()]
        if name is not None:
            if not (self.device / name / _DATA).exists():
                raise UnknownNameError("pose_source", name, sources)
            return name
        if not sources:
            positions = (self.device / _POSITIONS_ONLY).exists()
            found = f"{_POSITIONS_ONLY} only, which has no rotations" if positions else "no poses"
            raise DataError(self.device, found, f"{', '.join(POSE_SOURCES)}, each with {_DATA}")
        return sources[0]

    def poses(self, source: str) -> Path:
        """The table of poses."""
        return self.device / source / _DATA

    def sensor(self, source: str) -> Path:
        """The file that states where a sensor of poses is on the body; it may be missing."""
        return self.device / source / _SENSOR


def place_of(scene: str) -> str | None:
    """The place that recordings of EuRoC and TUM-VI share, from their names; None for others."""
    matches = (re.search(pattern, scene) for pattern in _PLACES)
    return next((match[1] for match in matches if match), None)


_NUMBER = re.compile(r"[0-9]{1,19}(?:\.[0-9]{0,30})?(?:[eE]\+?[0-9]{1,2})?")
_LARGEST_NS = 2**63 - 1
_IMAGE_COLUMNS = "a time and the name of an image"
_UNIT, _POSE_UNIT = (partial(with_option, name) for name in ("time_unit", "pose_time_unit"))
_POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
_USUAL = (1, 2, 3, 5, 6, 7, 4)
"""Columns of `_POSE` where a header does not name them: the scalar of the quaternion is first."""
_COLUMN = re.compile(
    r"(?:(?:.*\.)?(?:p|t|pos|position|translation)(?:_?[A-Z]+)*[_.]?)?(?P<p>[xyz])\s*(?:\[.*\])?"
    r"|(?:.*\.)?(?:q|quat|quaternion|rot|rotation|orientation)(?:_?[A-Z]+)*[_.]?(?P<q>[wxyz])\s*(?:\[.*\])?"
)
"""Names of columns of a pose: ``p_RS_R_x [m]``, ``tx``, ``x``; ``q_RS_w []``, ``qw``, ``rotation.w``."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Rows of one file."""

    path: Path  # the file
    header: list[str]  # names of the columns; empty where there are none
    times_ns: NDArray[np.int64]  # (n,) int64, nanoseconds, in the order of the file
    rows: list[list[str]]  # all fields of each row
    places: list[str]  # ``file:line`` of each row


def read_table(path: Path, columns: str, unit: TimeUnit | None, stated_by: StatedBy) -> Table:
    """Read a file of comma-separated values. `unit`: of its times; None for nanoseconds that are not stated.

    Blank lines and ``#`` comments are skipped; the first may be the header.
    """
    header: list[str] = []
    rows: list[list[str]] = []
    times, places = [], []
    for number, line in enumerate(read_text(path, f"rows of {columns}").splitlines(), start=1):
        fields = [field.strip() for field in line.split(",")]
        if line.lstrip().startswith("#") or (not rows and not header and _is_text(fields[0])):
            header = header or [field.lstrip("# ") for field in fields]
        elif line.strip():
            places.append(f"{path}:{number}")
            times.append(_nanoseconds(places[-1], fields[0], unit, stated_by))
            rows.append(fields)
    if not rows:
        raise DataError(path, "no rows", f"rows of {columns}")
    return Table(path, header, np.array(times, dtype=np.int64), rows, places)


def file_names(table: Table) -> list[str]:
    """The second column of a list of images."""
    for place, row in zip(table.places, table.rows, strict=True):
        if len(row) < 2 or not row[1]:
            raise DataError(place, "no name of a file", "a time and the name of an image")
    return [row[1] for row in table.rows]


def pose_rows(table: Table) -> NDArray[np.float64]:
    """Positions and quaternions, scalar last, (n, 7) float64: by the names of the columns, else ``p xyz, q wxyz``."""
    columns = _pose_columns(table.header)
    if len({*columns}) < len(columns):
        raise DataError(table.path, "names of a part of the columns of the pose", f"{', '.join(_POSE)}, or no names")
    if len(table.rows[0]) <= max(_USUAL) and len(table.rows[0]) <= max(columns):
        raise DataError(table.places[0], counted(len(table.rows[0]), "field"), "a time, a position and a quaternion")
    pairs = zip(table.places, table.rows, strict=True)
    return np.array([[_number(place, row, column) for column in columns] for place, row in pairs])


def _pose_columns(header: list[str]) -> tuple[int, ...]:
    """Columns of `_POSE`: positions and quaternions by their names, each where all of their names are there."""
    by_name: dict[str, int] = {}
    for column, name in enumerate(header):
        match = _COLUMN.fullmatch(name)
        if match and match.lastgroup:
            by_name.setdefault(match.lastgroup + match[match.lastgroup], column)
    named = {kind: all(name in by_name for name in _POSE if name[0] == kind) for kind in "pq"}
    pairs = zip(_POSE, _USUAL, strict=True)
    return tuple(by_name[name] if named[name[0]] else usual for name, usual in pairs)


def _is_text(field: str) -> bool:
    """Whether a field is a name and not a number."""
    return bool(re.match(r"[A-Za-z\"]", field)) and field.lower() not in ("nan", "inf", "infinity")


def _nanoseconds(place: str, field: str, unit: TimeUnit | None, stated_by: StatedBy) -> int:
    """A time to the nanosecond, which may be written with a point or a power of ten: 1403636579763555584.0 or 1.4e18.

    Nanoseconds that are not stated are whole numbers: others are probably of a larger unit.
    """
    time = Decimal(field) if _NUMBER.fullmatch(field) else Decimal(-1)
    ns = time * (TimeUnit.ns.per_second // (unit or TimeUnit.ns).per_second)
    if _NUMBER.fullmatch(field.removeprefix("-")) and field.startswith("-"):
        raise DataError(place, f"a time of {field!r}", "a time of 0 or later")
    if not 0 <= ns <= _LARGEST_NS or (unit is None and ns != int(ns)):
        expected = f"a whole number of nanoseconds, or another unit: {stated_by(unit_of_clock(float(time)))}"
        raise DataError(place, f"a time of {field!r}", expected if unit is None else f"a time in {unit}")
    return round(ns)


def _number(place: str, row: list[str], column: int) -> float:
    try:
        return float(row[column])
    except (ValueError, IndexError) as error:
        found = repr(row[column]) if column < len(row) else counted(len(row), "field")
        raise DataError(place, found, "a number in each column of the pose") from error


_EXTRINSICS = "T_BS"


def read_camera(path: Path, camera: str, *, on_body: bool = True) -> CameraFile:
    """Read the intrinsics of a camera, and its place on the body, which may be missing unless it is needed."""
    read = read_camera_file(path, camera=camera if cameras_in(path) else None)
    if on_body and read.body_from_camera is None:
        raise DataError(path, f"no place of {camera} on the body", f"{_EXTRINSICS} or T_cam_imu")
    return read


def read_sensor_from_body(path: Path) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Read where a sensor of poses is on the body.

    Returns sensor_from_body (4, 4). `sensor_from_body`: the inverse of T_BS. The identity where there is no file, or it
    does not state it.
    """
    values = read_yaml(path) if path.exists() else {}
    if _EXTRINSICS not in values:
        return np.eye(4), (f"there is no {_EXTRINSICS} in {path}, so the poses are taken as those of the body",)
    poses, _ = checked_poses(_matrix(path, values[_EXTRINSICS])[None], [path])
    sensor_from_body: NDArray[np.float64] = invert(poses[0])
    return sensor_from_body, ()


def _matrix(path: Path, values: Any) -> NDArray[np.float64]:
    """The 16 numbers of a matrix, below the key ``data``."""
    data = values.get("data") if isinstance(values, dict) else values
    if not (isinstance(data, list) and len(data) == 16 and all(type(value) in (int, float) for value in data)):
        raise DataError(path, f"no matrix {_EXTRINSICS}", f"{_EXTRINSICS} with data of 16 numbers")
    return np.array(data, dtype=np.float64).reshape(4, 4)


def find_second(
    files: Files,
    first: str,
    body_from_first: NDArray[np.float64],
    times_ns: NDArray[np.int64],
    *,
    camera_file: Path | None,
    levels: Levels | None,
    unit: TimeUnit | None,
) -> tuple[SecondCamera | None, tuple[str, ...]]:
    """Find the camera beside another one. It is not needed for other depth or truth, so its faults are no errors.

    Shapes: body_from_first (4, 4), times_ns (n,). `second`: None where there is none, or it cannot be used.
    """
    name = next((name for name in files.cameras() if name != first), None)
    if name is None:
        return None, ()
    try:
        of_both = camera_file if camera_file is not None and cameras_in(camera_file) else None
        calibration = read_camera(of_both or files.calibration(name), name)
        paths, numbers = _paths_at(files, name, times_ns, unit)
    except TracknoiseError as error:
        return None, (f"{name} gives no depth: {error}",)
    assert calibration.body_from_camera is not None, "checked when it was read"
    first_from_second = invert(body_from_first) @ calibration.body_from_camera
    images = SomeImages(ImageFiles(paths, calibration.camera, levels), numbers)
    return SecondCamera(calibration.camera, first_from_second, images), images.notes(name)


def _paths_at(
    files: Files, camera: str, times_ns: NDArray[np.int64], unit: TimeUnit | None
) -> tuple[tuple[Path, ...], tuple[int, ...]]:
    """The images of a camera at some times, to the nanosecond: cameras of a pair are triggered together.

    `numbers`: which of them is that of each time; -1 where the list has none, or its file is missing.
    """
    table = read_table(files.list_of_images(camera), _IMAGE_COLUMNS, unit, _UNIT)
    listed = dict(zip(table.times_ns.tolist(), file_names(table), strict=True))
    paths = {time: files.image(camera, listed[time]) for time in times_ns.tolist() if time in listed}
    there = {time: path for time, path in paths.items() if path.is_file()}
    if not there:
        times = counted(len(times_ns), "time")
        raise DataError(table.path, f"no image at any of {times}", "images at the times of frames")
    numbers = {time: number for number, time in enumerate(there)}
    return tuple(there.values()), tuple(numbers.get(time, -1) for time in times_ns.tolist())


@dataclass(frozen=True, slots=True)
class Euroc(SceneReader):
    """Reader of EuRoC MAV, TUM-VI and others in the ASL layout.

    Parameters
    ----------
    root
        Folder of one recording, or of several at any depth.
    camera
        Folder of the camera.
    camera_file
        Intrinsics and place of the camera on the body; by default the camera's ``sensor.yaml``, else a Kalibr
        ``camchain.yaml``.
    pose_source
        Folder of the poses; by default the first of `tracknoise.sequences.euroc.POSE_SOURCES` that there is.
    time_shift_s
        Added to the times of the images to get the clock of the poses, seconds; by default what the camera's file
        states, else 0.
    max_pose_gap_s
        Longest time between two poses that are interpolated, seconds. Images in longer gaps have no pose.
    image_levels
        Values of 16-bit images that become 0 and 255; values between are scaled linearly, others are clipped. Images
        of 8 bits are not changed.
    time_unit, pose_time_unit
        Units of the times of images and of poses: s, ms, us or ns. By default nanoseconds, at 1 to 1,000 Hz, and for
        poses that of the images.
    """

    name: ClassVar[str] = "euroc"
    description: ClassVar[str] = "EuRoC MAV, TUM-VI and the ASL layout: poses of the body in nanoseconds, no depth"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    camera: str = "cam0"
    camera_file: Path | None = None
    pose_source: str | None = None
    time_shift_s: float | None = None
    max_pose_gap_s: NotNegative = 0.1
    image_levels: tuple[float, float] | None = None
    time_unit: TimeUnit | None = None
    pose_time_unit: TimeUnit | None = None

    def __post_init__(self) -> None:
        require_bounds(self)
        require_finite("time_shift_s", self.time_shift_s or 0.0)
        require_levels(self.image_levels)

    def recordings(self) -> list[SequenceId]:
        """All recordings: see `ImageReader.recordings`."""
        return self.sequences()

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one recording, except for its images."""
        return self._opened(sequence, with_poses=True)

    def open_images(self, sequence: SequenceId) -> RecordedSequence:
        """The same without poses: see `ImageReader.open_images`."""
        return self._opened(sequence, with_poses=False)

    def _opened(self, sequence: SequenceId, *, with_poses: bool) -> RecordedSequence:
        files = Files(self._folder(sequence))
        images = read_table(files.list_of_images(self.camera), _IMAGE_COLUMNS, self.time_unit, _UNIT)
        file = self.camera_file or files.calibration(self.camera)
        calibration = read_camera(file, self.camera, on_body=with_poses)
        order = in_order(images.times_ns)
        names = file_names(images)
        require_distinct(images.path, images.times_ns, names)
        paths = tuple(files.image(self.camera, names[index]) for index in order)
        start_ns = images.times_ns[order[0]]
        times_s = _seconds_after(images.times_ns[order], start_ns)
        if self.time_unit is None:
            require_likely_rate(times_s, images.path, _UNIT, taken=TimeUnit.ns)
        shift_s = (calibration.time_shift_s or 0.0) if self.time_shift_s is None else self.time_shift_s
        body = calibration.body_from_camera
        poses, path, notes = no_poses(len(order)), None, tuple[str, ...]()
        if with_poses:
            assert body is not None, "checked when it was read"
            poses, path, notes = self._camera_poses(files, body, start_ns, times_s, shift_s)
            notes = (*_shift_notes(shift_s), *notes)
        second, second_notes = (
            (None, tuple[str, ...]())
            if body is None
            else find_second(
                files,
                self.camera,
                body,
                images.times_ns[order],
                camera_file=self.camera_file,
                levels=self.image_levels,
                unit=self.time_unit,
            )
        )
        return RecordedSequence(
            id=sequence,
            source=str(files.folder),
            camera=calibration.camera,
            world_from_camera=poses,
            images=ImageFiles(paths, calibration.camera, self.image_levels),
            notes=(
                f"the camera is that of {file}",
                *calibration.notes,
                *level_notes(self.image_levels),
                *order_notes(images.path, images.times_ns),
                *notes,
                *second_notes,
            ),
            timestamps_s=times_s,
            time_unit_stated=self.time_unit is not None,
            clock_start_ns=int(start_ns),
            group=place_of(sequence.scene),
            second=second,
            shutter=calibration.shutter,
            path=path,
            body=None if body is None else Body(body, shift_s),
            poses_elsewhere=not with_poses,
        )

    def _scenes(self) -> dict[str, Path]:
        def is_recording(below: list[str], _files: list[str]) -> bool:
            return _DEVICE in below or ("cam0" in below and not {*POSE_SOURCES, "imu0"}.isdisjoint(below))

        return find_scenes(self.root, is_recording, expected=f"folders with {_DEVICE}/, which holds cam0/ and poses")

    def _camera_poses(
        self,
        files: Files,
        body_from_camera: NDArray[np.float64],
        start_ns: np.int64,
        times_s: NDArray[np.float64],
        shift_s: float,
    ) -> tuple[NDArray[np.float64], PosePath, tuple[str, ...]]:
        """Poses of the camera at the times of its images, and between them; times are after that of the first image."""
        source = files.pose_source(self.pose_source)
        unit = self.pose_time_unit or self.time_unit
        table = read_table(files.poses(source), "a time, a position and a quaternion", unit, _POSE_UNIT)
        if self.pose_time_unit is None:  # by the times alone: far from those of images, their seconds are rounded
            recorded_s = _seconds_after(np.unique(table.times_ns), table.times_ns.min())
            require_pose_rate(recorded_s, times_s, table.path, _POSE_UNIT, taken=unit or TimeUnit.ns)
        recorded = trajectory(table.path, _seconds_after(table.times_ns, start_ns), pose_rows(table), table.places)
        sensor_from_body, sensor_notes = read_sensor_from_body(files.sensor(source))
        sensor_from_camera = sensor_from_body @ body_from_camera
        sensors, notes = poses_at(recorded, times_s + shift_s, max_gap_s=self.max_pose_gap_s)
        poses = sensors @ sensor_from_camera
        along = PosePath(recorded.times_s - shift_s, recorded.poses @ sensor_from_camera)
        path = path_through(times_s, poses, along, max_gap_s=self.max_pose_gap_s)
        return poses, path, (f"poses come from {source}", *sensor_notes, *notes)


def _seconds_after(times_ns: NDArray[np.int64], start_ns: np.int64) -> NDArray[np.float64]:
    """Seconds after a start. Whole nanoseconds are subtracted first: seconds since 1970 would be rounded to 0.2 us."""
    seconds: NDArray[np.float64] = (times_ns - start_ns) / 1e9
    return seconds


def _shift_notes(shift_s: float) -> tuple[str, ...]:
    return (
        (f"{1e3 * shift_s:g} ms were added to the times of the images for the clock of the poses",) if shift_s else ()
    )
