"""Files of KITTI: where they lie, calibrations, times, positions of the car and Velodyne scans.

A drive of KITTI raw data is a folder ``<date>/<date>_drive_NNNN_sync`` with ``image_02/data``, ``oxts/data`` and
``velodyne_points/data``; the calibration of a day lies beside its drives. Depth-completion maps lie in
``proj_depth/groundtruth/image_02`` of the drive's folder, here or below another root's ``train`` and ``val``.

Calibration files have one ``key: numbers`` per line. Only the keys that are needed are read. The chain of frames is:
imu (x forward, y left, z up) -> velo (the same axes) -> cam0 (x right, y down, z forward) -> rectified cam0 (R_rect_00)
-> rectified cam2, which only a translation t separates from it: P_rect_02 = K (I | t).

A file with the times of a drive's images has a line ``2011-09-26 13:02:25.964389445`` for each frame, from frame 0 on.

Positions and attitudes of the inertial navigation system (OXTS) are converted to poses and back. Latitude and longitude
go to metres by the Mercator projection, x = s R lon, y = s R log tan(pi/4 + lat/2), with R = 6378137 m and s = cos(lat)
of a drive's first frame; z is the altitude: east, north, up. The rotation is Rz(yaw) Ry(pitch) Rx(roll), from the
vehicle's axes (forward, left, up) to those.

Velodyne scans are float32 x, y, z (metres, forward, left, up) and reflectance of each point.
"""

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.foreign_files import MIB, damage_reported, read_bytes, read_text
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import from_rotation, invert
from tracknoise.sequences.images import first_readable, image_size
from tracknoise.sequences.poses import checked_poses, no_poses, read_rows, require_near
from tracknoise.sequences.recorded import ImageFiles
from tracknoise.sequences.scenes import any_numbered_files, find_scenes, numbered_files, require_unbroken
from tracknoise.sequences.sequence import SecondCamera, require_directory
from tracknoise.text import counted, counted_of

IMAGES, OXTS, VELODYNE = "image_02", "oxts", "velodyne_points"
DEPTH, POSES = "proj_depth", "poses_image_02.txt"
CAM_TO_CAM, VELO_TO_CAM, IMU_TO_VELO = "calib_cam_to_cam.txt", "calib_velo_to_cam.txt", "calib_imu_to_velo.txt"
_PARTS = frozenset((IMAGES, OXTS, VELODYNE, DEPTH, POSES))
_SPLITS = ("train", "val")
_RECORDING = re.compile(r"\d{4}_\d{2}_\d{2}_drive_\d{4}")


@dataclass(frozen=True, slots=True)
class Drive:
    """One drive's files."""

    folder: Path  # the drive's own folder
    # the folder below which its depth-completion maps lie, if there are any; by default its own
    depth_root: Path | None = None

    @property
    def day(self) -> Path:
        """The folder of its date, where the calibration lies."""
        # resolve() would follow a link to a drive that lies apart from its calibration
        return Path(os.path.abspath(self.folder)).parent  # noqa: PTH100

    @property
    def poses(self) -> Path:
        """The file of poses, used instead of OXTS."""
        return self.folder / POSES

    @property
    def has_oxts(self) -> bool:
        """Whether there is a record of the inertial navigation system."""
        return (self.folder / OXTS).exists()

    @property
    def depth_folder(self) -> Path:
        """Where its depth-completion maps lie, if there are any."""
        return (self.depth_root or self.folder) / DEPTH / "groundtruth" / IMAGES

    @property
    def oxts_timestamps(self) -> Path:
        """Times of the records of the inertial navigation system."""
        return self.folder / OXTS / "timestamps.txt"

    @property
    def timestamps(self) -> Path:
        """The file with the time of each image."""
        return self.folder / IMAGES / "timestamps.txt"

    def image(self, number: int) -> Path:
        """Where the image of a frame should be."""
        return self.folder / IMAGES / "data" / f"{number:010d}.png"

    def oxts(self, number: int) -> Path:
        """Where the position and attitude of a frame should be."""
        return self.folder / OXTS / "data" / f"{number:010d}.txt"

    def scan(self, number: int) -> Path:
        """Where the Velodyne scan of a frame should be."""
        return self.folder / VELODYNE / "data" / f"{number:010d}.bin"

    def depth(self, number: int) -> Path:
        """Where the depth-completion map of a frame should be."""
        return self.depth_folder / f"{number:010d}.png"


@dataclass(frozen=True, slots=True)
class DriveFrames:
    """The frames of one drive, or of a sequence of KITTI odometry."""

    numbers: range  # of the frames, without a gap
    images: tuple[Path, ...]  # an image for each
    depths: tuple[Path | None, ...]  # for each its depth-completion map, else its Velodyne scan, else None


def find_drives(root: Path, depth_root: Path | None) -> dict[str, Drive]:
    """Find the drives in or below a folder, by name, sorted.

    `depth_root`: folder of the depth-completion release, or None where the maps lie in the drives' own folders.
    """
    expected = f"drives: folders with {IMAGES}/ and {OXTS}/ or {POSES}"
    folders = find_scenes(root, lambda below, files: len(_PARTS.intersection((*below, *files))) >= 2, expected=expected)
    drives: dict[str, Drive] = {}
    for scene, folder in folders.items():
        name = scene.rpartition("/")[2]
        if name in drives:
            raise DataError(folder, f"the drive {name} again, which is also in {drives[name].folder}", "it once")
        drives[name] = Drive(folder, None if depth_root is None else _split_of(depth_root, name))
    if depth_root is not None and not any(drive.depth_folder.exists() for drive in drives.values()):
        example = Drive(Path(), Path(_SPLITS[0], min(drives))).depth_folder
        found = f"no maps of the {counted(len(drives), 'drive')} in {root}"
        raise DataError(require_directory(depth_root), found, f"folders such as {example.as_posix()}")
    return dict(sorted(drives.items()))


def recording_of(name: str) -> str | None:
    """Date and number of the recording that a drive is, or is a piece of, from its name; None if it has neither."""
    match = _RECORDING.match(name)
    return match.group() if match else None


def find_frames(drive: Drive) -> DriveFrames:
    """Find the frames of a drive."""
    images = numbered_files(drive.folder / IMAGES / "data", r"(\d+)\.(?:png|jpe?g)")
    maps = any_numbered_files(drive.depth_folder, r"(\d+)\.png")
    scans = any_numbered_files(drive.folder / VELODYNE / "data", r"(\d+)\.bin")
    records = any_numbered_files(drive.oxts(0).parent, r"(\d+)\.txt")
    numbers = require_unbroken(images, {*maps, *scans, *records}, drive.image)
    depths = tuple(maps.get(number, scans.get(number)) for number in numbers)
    return DriveFrames(numbers, tuple(images.values()), depths)


def _split_of(depth_root: Path, name: str) -> Path:
    """The folder of a drive in the depth-completion release, which divides them."""
    return next(
        (depth_root / split / name for split in _SPLITS if (depth_root / split / name).exists()), depth_root / name
    )


POSE_COLUMNS = "r11 r12 r13 tx r21 r22 r23 ty r31 r32 r33 tz"
Values = dict[str, NDArray[np.float64]]


def read_values(path: Path, counts: dict[str, int]) -> Values:
    """Read the values of some keys of a file."""
    lines = read_text(path, f"a calibration with {', '.join(counts)}").splitlines()
    values: Values = {}
    for number, line in enumerate(lines, start=1):
        key, _, rest = line.partition(":")
        if key.strip() in counts:
            values[key.strip()] = _numbers(f"{path}:{number}", key.strip(), rest.split(), counts[key.strip()])
    for key, count in counts.items():
        if key not in values:
            raise DataError(path, f"no {key}", f"a line of {key} and {counted(count, 'number')}")
    return values


def projection(path: Path, values: Values, key: str) -> NDArray[np.float64]:
    """A projection matrix, (3, 4) float64, after checking that it is that of a camera without skew."""
    P = values[key].reshape(3, 4)
    plain = P[0, 1] == P[1, 0] == P[2, 0] == P[2, 1] == 0.0 and P[2, 2] == 1.0
    if not (plain and P[0, 0] > 0.0 and P[1, 1] > 0.0):
        raise DataError(path, f"another {key}", "fx 0 cx . 0 fy cy . 0 0 1 . with positive fx, fy")
    with np.errstate(all="ignore"):  # of numbers that no camera has
        shift_m = camera_from_reference(P)[None, :3, 3]
    require_near(shift_m, [path])
    return P


def camera_from_reference(P: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4, 4) float64: from the rectified camera 0 to the camera of P = K (I | t), which only t separates from it."""
    return from_rotation(np.eye(3), np.linalg.solve(P[:, :3], P[:, 3]))


def camera_of(P: NDArray[np.float64], images: tuple[Path, ...]) -> Camera:
    """The camera of a projection matrix, of the size of its images."""
    (fx, _, cx), (_, fy, cy), _ = P[:, :3].tolist()
    return Camera(*image_size(first_readable(images)), fx, fy, cx, cy)


def second_camera(first: NDArray[np.float64], second: NDArray[np.float64], images: tuple[Path, ...]) -> SecondCamera:
    """The camera with the second of two projection matrices, beside that with the first."""
    camera = camera_of(second, images)
    first_from_second = camera_from_reference(first) @ invert(camera_from_reference(second))
    return SecondCamera(camera, first_from_second, ImageFiles(images, camera))


def rigid(path: Path, rotation: NDArray[np.float64], translation_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """A transform, (4, 4) float64, whose rotation, rounded in the file, is made exact."""
    poses, _ = checked_poses(from_rotation(rotation.reshape(1, 3, 3), translation_m), [path])
    exact: NDArray[np.float64] = poses[0]
    return exact


def poses_of_rows(rows: NDArray[np.float64], places: Sequence[str]) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Check poses of 12 numbers, the first three rows of a matrix; a row of NaN is none.

    Shapes: rows (n, 12); returns poses (n, 4, 4), and notes.
    """
    posed = np.flatnonzero(~np.isnan(rows).all(axis=1))
    poses = np.broadcast_to(np.eye(4), (len(posed), 4, 4)).copy()
    poses[:, :3] = rows[posed].reshape(-1, 3, 4)
    found = no_poses(len(rows))
    found[posed], notes = checked_poses(poses, [places[index] for index in posed.tolist()])
    lost = len(rows) - len(posed)
    hold = counted_of(lost, len(rows), "row", "holds", "hold")
    return found, (*notes, *((f"{hold} no pose (NaN)",) if lost else ()))


def _numbers(place: str, key: str, fields: list[str], count: int) -> NDArray[np.float64]:
    if len(fields) != count:
        raise DataError(place, f"{key} of {counted(len(fields), 'number')}", f"{count}")
    try:
        numbers = np.array([float(field) for field in fields])
    except ValueError as error:
        raise DataError(place, f"{key} with fields that are not numbers", counted(count, "number")) from error
    if not np.isfinite(numbers).all():
        raise DataError(place, f"NaN or infinity in {key}", "finite numbers")
    return numbers


_SIZE, _RECTIFY, _PROJECT = "S_rect_02", "R_rect_00", "P_rect_02"
_SECOND_IMAGES, _SECOND_PROJECT = "image_03", "P_rect_03"


def read_camera(day: Path) -> Camera:
    """The rectified camera 2: fx, fy, cx, cy of P_rect_02 and the size S_rect_02."""
    path = day / CAM_TO_CAM
    values = read_values(path, {_SIZE: 2, _PROJECT: 12})
    width, height = values[_SIZE].tolist()
    if not (width >= 1 and height >= 1 and width.is_integer() and height.is_integer()):
        raise DataError(path, f"{_SIZE} of {width:g} {height:g}", "the images' width and height, px")
    (fx, _, cx), (_, fy, cy), _ = projection(path, values, _PROJECT)[:, :3].tolist()
    return Camera(int(width), int(height), fx, fy, cx, cy)


def read_second_camera(drive: Drive, numbers: range) -> SecondCamera | None:
    """Camera 3 beside camera 2; None where its calibration, or an image of a frame, is missing."""
    images = any_numbered_files(drive.folder / _SECOND_IMAGES / "data", r"(\d+)\.(?:png|jpe?g)")
    if not images.keys() >= {*numbers}:
        return None
    path, paths = drive.day / CAM_TO_CAM, tuple(images[number] for number in numbers)
    try:
        values = read_values(path, {_PROJECT: 12, _SECOND_PROJECT: 12})
    except DataError:  # of one camera only
        return None
    first, second = (projection(path, values, key) for key in (_PROJECT, _SECOND_PROJECT))
    return second_camera(first, second, paths)


def read_camera_from_velodyne(day: Path) -> NDArray[np.float64]:
    """(4, 4) float64: from the Velodyne's frame to the rectified camera 2."""
    path = day / CAM_TO_CAM
    values = read_values(path, {_RECTIFY: 9, _PROJECT: 12})
    camera_from_rectified0 = camera_from_reference(projection(path, values, _PROJECT))
    rectified0_from_camera0 = rigid(path, values[_RECTIFY], np.zeros(3))
    chain: NDArray[np.float64] = camera_from_rectified0 @ rectified0_from_camera0 @ _read_rigid(day / VELO_TO_CAM)
    return chain


def read_camera_from_imu(day: Path) -> NDArray[np.float64]:
    """(4, 4) float64: from the inertial navigation system's frame to the rectified camera 2."""
    chain: NDArray[np.float64] = read_camera_from_velodyne(day) @ _read_rigid(day / IMU_TO_VELO)
    return chain


def _read_rigid(path: Path) -> NDArray[np.float64]:
    values = read_values(path, {"R": 9, "T": 3})
    return rigid(path, values["R"], values["T"])


_TIME = re.compile(r"(?:19|20|21)[0-9]{2}-[0-9]{2}-[0-9]{2}(?:[ T][0-9:.]+)?")  # a century that 64 bits of ns can hold
_FORMAT = "a time such as 2011-09-26 13:02:25.964389445"


def read_timestamps(path: Path, numbers: range) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
    """Read the times of a drive's frames.

    `timestamps_s`: seconds since the first frame. None where the file is missing or its times do not increase.
    """
    if not path.exists():
        return None, ()
    times = _read_timestamps(path, numbers)
    timestamps_s: NDArray[np.float64] = (times - times[0]) / np.timedelta64(1, "s")
    if not np.all(np.diff(timestamps_s) > 0.0):
        return None, (f"{path}: the times do not increase, so they are not used",)
    return timestamps_s, ()


def pose_time_notes(images: Path, poses: Path, numbers: range) -> tuple[str, ...]:
    """A sentence on how far the records of poses are from their images in time; none where a file cannot be used."""
    try:
        apart_ms = np.abs(
            (_read_timestamps(poses, numbers) - _read_timestamps(images, numbers)) / np.timedelta64(1, "ms")
        )
    except DataError:
        return ()
    return (
        f"the pose of an image was recorded {np.median(apart_ms):.1f} ms from it in the median, "
        f"{apart_ms.max():.1f} ms at most, and is not moved to its time",
    )


def _read_timestamps(path: Path, numbers: range) -> NDArray[np.datetime64]:
    """(n,) datetime64: the times of frames."""
    lines = read_text(path, f"in each line {_FORMAT}").splitlines()
    if len(lines) < numbers.stop:
        raise DataError(path, counted(len(lines), "line"), f"at least {numbers.stop}, one for each image")
    return np.array([_time(f"{path}:{number + 1}", lines[number]) for number in numbers])


def _time(place: str, line: str) -> np.datetime64:
    if _TIME.fullmatch(line.strip()) is None:
        raise DataError(place, repr(line), _FORMAT)
    with damage_reported(place, repr(line), _FORMAT):  # a month 13
        return np.datetime64(line.strip(), "ns")


EARTH_RADIUS_M = 6378137.0
COLUMNS = (
    "lat lon alt roll pitch yaw vn ve vf vl vu ax ay az af al au wx wy wz wf wl wu "
    "pos_accuracy vel_accuracy navstat numsats posmode velmode orimode"
)
"""Fields of a record: degrees, metres and radians first. Of the rest, the two accuracies are used."""
_USED = 6
_ACCURACIES = [COLUMNS.split().index(name) for name in ("pos_accuracy", "vel_accuracy")]
_REST = "0 " * 17 + "0 0 4 10 5 5 6"  # motion, which is not simulated; no accuracies; states of good reception


def read_records(paths: Iterable[Path]) -> NDArray[np.float64]:
    """Read the positions and attitudes of a drive's frames, a file each.

    Returns (n, 6). Latitude and longitude, degrees. Altitude, metres. Roll, pitch and yaw, radians.
    """
    records = [_checked(path, _read_oxts(path)[:_USED]) for path in paths]
    return np.array(records).reshape(-1, _USED)


def read_accuracies(paths: Iterable[Path]) -> NDArray[np.float64]:
    """Read the standard deviations that the records of a drive's frames state, a file each.

    Returns (n, 2). Of the position, metres, and of the velocity, metres per second. 0 where none is stated.
    """
    return np.array([_read_oxts(path)[_ACCURACIES] for path in paths]).reshape(-1, len(_ACCURACIES))


def poses_of_records(records: NDArray[np.float64]) -> NDArray[np.float64]:
    """Poses of the inertial navigation system: world_from_imu.

    Shapes: records (n, 6); returns (n, 4, 4) in the world frame. East, north, up, metres, with its origin at the first
    position.
    """
    scale_m = EARTH_RADIUS_M * np.cos(np.deg2rad(records[:1, 0]))
    lat, lon = np.deg2rad(records[:, :2]).T
    place = np.stack([scale_m * lon, scale_m * np.log(np.tan(np.pi / 4 + lat / 2)), records[:, 2]], axis=-1)
    return from_rotation(Rotation.from_euler("ZYX", records[:, :2:-1]).as_matrix(), place - place[:1])


def records_of_poses(world_from_imu: NDArray[np.float64], *, start: tuple[float, float, float]) -> NDArray[np.float64]:
    """The inverse of `poses_of_records`. Shapes: world_from_imu (n, 4, 4); returns (n, 6). See `read_records`."""
    lat, lon = np.deg2rad(start[:2])
    scale_m = EARTH_RADIUS_M * np.cos(lat)
    place = world_from_imu[:, :3, 3] - world_from_imu[:1, :3, 3]
    lats = 2.0 * np.arctan(np.exp(np.log(np.tan(np.pi / 4 + lat / 2)) + place[:, 1] / scale_m)) - np.pi / 2
    angles = Rotation.from_matrix(world_from_imu[:, :3, :3]).as_euler("ZYX")
    degrees = np.rad2deg(np.stack([lats, lon + place[:, 0] / scale_m], axis=-1))
    return np.concatenate([degrees, start[2] + place[:, 2:], angles[:, ::-1]], axis=1)


def write_record(path: Path, record: NDArray[np.float64]) -> None:
    """Write one record, (6,) float64, with all digits that a float64 has."""
    path.write_text(" ".join([*map(repr, record.tolist()), _REST]) + "\n", encoding="utf-8")


def _read_oxts(path: Path) -> NDArray[np.float64]:
    """(30,) float64: one record."""
    rows, _ = read_rows(path, COLUMNS)
    if len(rows) != 1:
        raise DataError(path, counted(len(rows), "row"), "one")
    record: NDArray[np.float64] = rows[0]
    return record


def _checked(path: Path, record: NDArray[np.float64]) -> NDArray[np.float64]:
    if not np.isfinite(record).all():
        raise DataError(path, "NaN or infinity", "finite numbers")
    if abs(record[0]) >= 90.0 or abs(record[1]) > 360.0:
        raise DataError(path, f"latitude {record[0]:g} and longitude {record[1]:g}", "degrees on the globe")
    if np.abs(record[3:]).max() > 2.0 * np.pi:
        roll, pitch, yaw = record[3:]
        raise DataError(path, f"roll {roll:g}, pitch {pitch:g} and yaw {yaw:g}", "radians")
    require_near(record[None, 2:3], [path])
    return record


SCAN_SUFFIX = ".bin"
_POINT_BYTES = 16
_MOST_BYTES = 64 * MIB  # a turn of the scanner has about 2 MiB


def read_scan(path: Path) -> NDArray[np.float64]:
    """Read the points of a scan. Returns (n, 3) m. The Velodyne's frame."""
    data = read_bytes(path, "a Velodyne scan", most=_MOST_BYTES)
    if not data or len(data) % _POINT_BYTES:
        raise DataError(
            path, counted(len(data), "byte"), f"a multiple of {_POINT_BYTES} (float32 x y z reflectance), not 0"
        )
    points = np.frombuffer(data, "<f4").reshape(-1, 4)[:, :3]
    if not np.isfinite(points).all():
        raise DataError(path, "NaN or infinity among the points", "finite x y z")
    return points.astype(np.float64)


def write_scan(path: Path, points: NDArray[np.float64]) -> None:
    """Write the points of a scan, (n, 3) float64, metres; their reflectance is 0."""
    path.write_bytes(np.pad(points, ((0, 0), (0, 1))).astype("<f4").tobytes())
