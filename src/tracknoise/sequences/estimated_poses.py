"""Poses of the frames of a sequence from a file of another program, such as SLAM or structure from motion.

The contents of a file decide its format: TUM, EuRoC, KITTI, rows by the names of images, or a reconstruction of COLMAP.
Poses belong to frames by time, by number, in order, or by the name of the image.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import cast

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign_files import is_folder, is_number, is_regular_file, read_bytes, read_text
from tracknoise.geometry.pose import PosePath, invert, nearest
from tracknoise.sequences.colmap import SCALE_NOTE, poses_of, read_binary_images, read_text_images
from tracknoise.sequences.euroc import pose_rows, read_table
from tracknoise.sequences.kitti_files import POSE_COLUMNS, poses_of_rows
from tracknoise.sequences.likely_times import require_seconds
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.sequences.poses import has_pose, no_poses, numbers, quaternion_poses, read_rows
from tracknoise.sequences.sequence import ImageReader, Reader, Sequence, TruthKind, body_of, clock_start_of, times_of
from tracknoise.sequences.timed_poses import PosesOf, path_through, poses_at, trajectory
from tracknoise.sequences.views import View
from tracknoise.tables.identity import SequenceId
from tracknoise.text import counted, counted_of
from tracknoise.time_units import FASTEST_HZ, TimeUnit, likely_unit, rate_of, unit_of_clock

LONGEST_GAP_S, _LONGEST_OF_KEYFRAMES_S = 0.1, 0.5
"""Longest time between two poses of a file that are interpolated, seconds: 1.5 frames where that is longer, or 1.5
times what is usual between its poses, up to the second."""
_GAPS = 1.5
_SLOWEST_HZ = 0.05
"""Slowest rate of key frames in the usual unit of a format."""
_SAME_TIME_S = 1e-6
"""A frame this close to a pose in time has this pose: times are rounded when they are shifted, or written."""

_TUM, _NO_TIMES, _BY_NAME = "timestamp tx ty tz qx qy qz qw", "tx ty tz qx qy qz qw", "qw qx qy qz tx ty tz"
_EXPECTED = (
    f"poses in the format of TUM ({_TUM}), of EuRoC (comma-separated, ns first), of KITTI (12 numbers a row), rows of "
    f"an image's name and {_BY_NAME}, or a folder of COLMAP"
)
_COLMAP_FOLDERS = (".", "sparse", "sparse/0", "0")
_COLMAP = "COLMAP"
_BINARY, _TEXT = "images.bin", "images.txt"
_HEAD_BYTES = 4096

Found = tuple[NDArray[np.float64], PosePath | None, tuple[str, ...]]
"""Poses of frames (n, 4, 4), NaN where there is none; those at other times; and notes."""


def posed_by(reader: Reader, trajectory: str, of: PosesOf = PosesOf.camera, time_shift_s: float = 0.0) -> Reader:
    """The reader of the same recordings with the poses of another file: see `with_trajectory`.

    Parameters
    ----------
    reader
        Of the recordings, which may have no poses if it can do without them.
    trajectory
        The file; ``{scene}`` and ``{lighting}`` are replaced.
    of
        What its poses are poses of.
    time_shift_s
        Added to the times of the frames to get its clock, seconds.
    """
    return cast(Reader, _Posed(reader, trajectory, of, time_shift_s))  # whose name is not that of a class


@dataclass(frozen=True, slots=True)
class _Posed:
    reader: Reader
    trajectory: str
    poses_of: PosesOf
    time_shift_s: float

    @property
    def name(self) -> str:
        """That of the reader."""
        return self.reader.name

    @property
    def description(self) -> str:
        """That of the reader."""
        return self.reader.description

    @property
    def needs_root(self) -> bool:
        """That of the reader."""
        return self.reader.needs_root

    def sequences(self) -> list[SequenceId]:
        """All sequences, those without poses too."""
        return self.reader.recordings() if isinstance(self.reader, ImageReader) else self.reader.sequences()

    def open(self, sequence: SequenceId) -> OtherPoses:
        """Read and check one sequence and its trajectory."""
        reader = self.reader
        images = reader.open_images(sequence) if isinstance(reader, ImageReader) else reader.open(sequence)
        path = sequence.expand(self.trajectory, speed=1)
        return with_trajectory(images, path, poses_of=self.poses_of, time_shift_s=self.time_shift_s)


def with_trajectory(
    sequence: Sequence, path: Path, *, poses_of: PosesOf = PosesOf.camera, time_shift_s: float = 0.0
) -> OtherPoses:
    """The sequence with the poses of a file, in any of the formats that this module names.

    Times are those of the recording's clock, or seconds since its first frame: the first of both at which there are
    poses. Whole numbers are numbers of frames where the frames have no times, or where as many seconds are longer than
    the recording. Other rows belong to frames without times in order.

    Parameters
    ----------
    sequence
        As recorded: all of its frames, in their order.
    path
        The file, or the folder of COLMAP.
    poses_of
        What the poses are poses of: the camera of the images, or the body that the recording states it to be on.
    time_shift_s
        Added to the times of the frames to get the clock of the file, seconds. For poses of the body, what the
        recording states is added too.

    Raises
    ------
    DataError
        If the file is missing, damaged or in no known format, holds no pose for two frames, or the recording states no
        body.
    """
    body = body_of(sequence) if poses_of is PosesOf.body else None
    if poses_of is PosesOf.body and body is None:
        expected = "a recording that does (T_BS, T_cam_imu), or a trajectory of the camera"
        raise DataError(sequence.source, "no statement of where the camera is on the body", expected)
    file = _read(path)
    poses, along, notes = file.of(sequence, time_shift_s + (0.0 if body is None else body.time_shift_s))
    if body is not None:
        poses = poses @ body.from_camera
        along = None if along is None else PosePath(along.times, along.poses @ body.from_camera)
    kind = f"they are in the format of {file.layout}, of the {poses_of}"
    times_s = times_of(sequence)
    if along is not None and times_s is not None:
        along = path_through(times_s, poses, along, max_gap_s=_longest_gap_s(times_s, along.times))
    return OtherPoses(sequence, poses, str(path), along, (kind, *notes))


@dataclass(frozen=True, slots=True)
class _File:
    """A file whose format is known: how it finds the poses of a sequence, with a shift between both clocks."""

    layout: str
    of: Callable[[Sequence, float], Found]


def _read(path: Path) -> _File:
    """Recognise the format of a file by its contents, and read it."""
    if is_folder(path):
        return _colmap(path, _model(path))
    if b"\0" in read_bytes(path, _EXPECTED)[:_HEAD_BYTES]:
        if path.suffix != Path(_BINARY).suffix:
            raise DataError(path, "a binary file", _EXPECTED)
        return _colmap(path, path)
    header, first = _first_row(path)
    commas, fields = "," in first, first.replace(",", " ").split()
    count, is_numeric = len(fields), all(map(is_number, fields))
    if commas and count >= 8 and is_number(fields[0]) and (header or unit_of_clock(float(fields[0])) is TimeUnit.ns):
        return _euroc(path)
    if is_numeric and count == len(POSE_COLUMNS.split()):
        return _rows(path, "KITTI", *poses_of_rows(*read_rows(path, POSE_COLUMNS)))
    if is_numeric and count == len(_TUM.split()):
        return _tum(path)
    if is_numeric and count == len(_NO_TIMES.split()):
        return _rows(path, "rows of a position and a quaternion", _in_order(path, *read_rows(path, _NO_TIMES)), ())
    if count == 10 and all(map(is_number, fields[:9])):
        return _colmap(path, path)
    if count >= 8 and not is_number(fields[0]) and all(map(is_number, fields[1:])):
        return _named(path, "rows by the names of images", *_poses_by_name(path))
    raise DataError(path, f"a first row of {counted(count, 'field')} ({first[:60]})" if first else "no rows", _EXPECTED)


def _first_row(path: Path) -> tuple[bool, str]:
    """Whether there are names of columns, and the first row of numbers or names of images."""
    header = False
    for line in read_text(path, _EXPECTED).splitlines():
        text = line.strip()
        names = text.lstrip("# ").replace(",", " ").split()
        if "," in text and len(names) >= 8 and not any(map(is_number, names)):
            header = True
        elif text and not text.startswith("#"):
            return header, text.rstrip(",")
    return header, ""


def _tum(path: Path) -> _File:
    rows, places = read_rows(path, _TUM, separator=",")
    unit = _unit(rows[:, 0], TimeUnit.s)
    seconds = rows[:, 0] / unit.per_second
    require_seconds(seconds, places)
    note = () if unit is TimeUnit.s else (f"{path}: the times are taken as {unit}",)
    return _File("TUM", _Timed(path, np.rint(1e9 * seconds).astype(np.int64), rows[:, 1:], places, note))


def _euroc(path: Path) -> _File:
    fields = (line.split(",")[0].strip() for line in read_text(path, _EXPECTED).splitlines())
    unit = _unit(np.array([float(field) for field in fields if is_number(field)]), TimeUnit.ns)
    table = read_table(path, "a time, a position and a quaternion", unit, lambda time_unit: f"times in {time_unit}")
    note = () if unit is TimeUnit.ns else (f"{path}: the times are taken as {unit}",)
    return _File("EuRoC", _Timed(path, table.times_ns, pose_rows(table), table.places, note))


def _unit(times: NDArray[np.float64], usual: TimeUnit) -> TimeUnit:
    """The unit of times (n,): the usual one of a format, where it makes the rate of the poses a likely one.

    Otherwise the one in which they can be times since 1970, or, of other clocks, the one with a likely rate.
    """
    unit, rate = unit_of_clock(float(np.nanmax(np.abs(times), initial=0.0))), rate_of(np.unique(times))
    if rate is None:
        return unit
    if unit is usual or _SLOWEST_HZ <= rate * usual.per_second <= FASTEST_HZ:
        return usual
    taken_hz = rate * unit.per_second
    likely = None if _SLOWEST_HZ <= taken_hz <= FASTEST_HZ else likely_unit(taken_hz, unit)
    return unit if likely is None else likely[0]


def _in_order(path: Path, rows: NDArray[np.float64], places: list[str]) -> NDArray[np.float64]:
    """(n, 4, 4) float64: the pose of each row of a position and a quaternion; NaN of a row without one."""
    row = np.arange(len(rows), dtype=np.float64)
    return poses_at(trajectory(path, row, rows, places), row, max_gap_s=0.0)[0]


@dataclass(frozen=True, slots=True, eq=False)
class _Timed:
    """Poses with times."""

    path: Path
    times_ns: NDArray[np.int64]
    rows: NDArray[np.float64]  # (n, 7) float64: position, quaternion with the scalar last
    places: list[str]
    notes: tuple[str, ...]

    def __call__(self, sequence: Sequence, shift_s: float) -> Found:
        times_s = times_of(sequence)
        if times_s is None:
            return self._of_numbers(len(sequence)) or self._of_untimed(sequence)
        clocks = list(_clocks(sequence, times_s, shift_s))
        if self.times_ns.max() > 1e9 * np.ptp(times_s):  # else they may be seconds since the first frame
            by_number = self._of_numbers(len(sequence))
            if by_number is not None:
                return by_number
        name, frames_ns = max(clocks, key=lambda clock: self._overlap(clock[1]))
        start_ns = frames_ns[0]
        recorded = trajectory(self.path, (self.times_ns - start_ns) / 1e9, self.rows, self.places)
        frames_s = (frames_ns - start_ns) / 1e9
        same = nearest(frames_s, recorded.times_s, max_gap_s=_SAME_TIME_S)
        at_s = np.where(same >= 0, recorded.times_s[same], frames_s)
        poses, notes = poses_at(recorded, at_s, max_gap_s=_longest_gap_s(times_s, recorded.times_s))
        along = PosePath(recorded.times_s + times_s[0], recorded.poses)
        return poses, along, (*self.notes, f"they belong to frames by time, {name}", *notes)

    def _overlap(self, frames_ns: NDArray[np.int64]) -> int:
        """How many frames lie between the first and the last pose."""
        return int(np.count_nonzero((frames_ns >= self.times_ns.min()) & (frames_ns <= self.times_ns.max())))

    def _of_numbers(self, count: int) -> Found | None:
        """Poses of `count` frames by their numbers, where times are such numbers; None where they are not."""
        frames = self.times_ns // 10**9
        first = int(frames.min() > 0 and frames.max() == count)
        frames = frames - first
        if np.any(self.times_ns % 10**9) or len(np.unique(frames)) < len(frames):
            return None
        if frames.min() < 0 or frames.max() >= count:
            return None
        of_frames = no_poses(count)
        of_frames[frames] = _in_order(self.path, self.rows, self.places)
        without = int(np.count_nonzero(~has_pose(of_frames)))
        lost = (f"{counted_of(without, count, 'frame', 'has', 'have')} no pose",) if without else ()
        also = "; counted from 1 they fit as well" if not first and frames.min() > 0 else ""
        return of_frames, None, (*self.notes, f"their times are numbers of frames, from {first}{also}", *lost)

    def _of_untimed(self, sequence: Sequence) -> Found:
        """Poses in order."""
        count, poses = len(sequence), _in_order(self.path, self.rows, self.places)
        if len(poses) != count:
            found = f"{counted(len(poses), 'pose')} for {counted(count, 'frame')} without times"
            raise DataError(self.path, found, "one row per frame")
        return poses, None, (*self.notes, "they belong to frames in order: the frames have no times")


def _clocks(
    sequence: Sequence, times_s: NDArray[np.float64], shift_s: float
) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """Times of frames, ns, by each clock that a trajectory may have; the likeliest first."""
    own_ns = np.rint(1e9 * (times_s + shift_s)).astype(np.int64)
    start_ns = clock_start_of(sequence)
    if start_ns is not None:
        yield "on the clock of the recording", start_ns + own_ns
    elif times_s[0]:
        yield "on the clock of the recording", own_ns
    yield "in seconds since the first frame", own_ns - np.int64(np.rint(1e9 * times_s[0]))


def _longest_gap_s(times_s: NDArray[np.float64], posed_s: NDArray[np.float64]) -> float:
    """From the times of frames and of poses."""
    of_frames, of_poses = (
        _GAPS * float(np.median(np.diff(one))) if len(one) > 1 else 0.0 for one in (times_s, posed_s)
    )
    return max(LONGEST_GAP_S, of_frames, min(of_poses, _LONGEST_OF_KEYFRAMES_S))


def _rows(path: Path, layout: str, poses: NDArray[np.float64], notes: tuple[str, ...]) -> _File:
    """Poses of all frames in order; of more poses than frames, those with the numbers of the images."""

    def of(sequence: Sequence, _: float) -> Found:
        if len(poses) == len(sequence):
            return poses, None, (*notes, "they belong to frames in order")
        numbers = _numbers_of_images(sequence)
        if numbers is None or len(poses) <= numbers[-1]:
            raise DataError(
                path,
                f"{counted(len(poses), 'pose')} for {counted(len(sequence), 'frame')}",
                "one row per frame",
            )
        return poses[numbers], None, (*notes, "they belong to frames by the numbers of the images, from 0")

    return _File(layout, of)


def _model(folder: Path) -> Path:
    """The list of images of a reconstruction in a folder, or one below."""
    places = [folder / name for name in _COLMAP_FOLDERS]
    models = [place for place in places if any(is_regular_file(place / name) for name in (_BINARY, _TEXT))]
    if not models:
        raise DataError(folder, f"no {_BINARY} or {_TEXT}", _EXPECTED)
    return next(models[0] / name for name in (_BINARY, _TEXT) if is_regular_file(models[0] / name))


def _colmap(path: Path, file: Path) -> _File:
    is_binary = b"\0" in read_bytes(file, _EXPECTED)[:_HEAD_BYTES]
    images = read_binary_images(file) if is_binary else read_text_images(file)
    if not images:
        raise DataError(file, "no registered images", "at least two")
    return _named(path, _COLMAP, [image.name for image in images], poses_of(images))


def _poses_by_name(path: Path) -> tuple[list[str], NDArray[np.float64]]:
    """Names of images, and their poses: those of the world in the camera are in the rows. Further numbers are left."""
    names, rows, places = [], [], []
    for number, line in enumerate(read_text(path, _EXPECTED).splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            name, *fields = line.replace(",", " ").split()
            names.append(name)
            places.append(f"{path}:{number}")
            rows.append(numbers(fields[:7], _BY_NAME, places[-1]))
    values = np.array(rows, dtype=np.float64)
    return names, invert(quaternion_poses(values[:, 4:], values[:, [1, 2, 3, 0]], places))


def _named(path: Path, layout: str, names: list[str], poses: NDArray[np.float64]) -> _File:
    def of(sequence: Sequence, _: float) -> Found:
        images = _image_paths(sequence)
        if images is None:
            raise DataError(
                path, "poses by the names of images", "a recording whose images are files, or poses by time"
            )
        index = _by_name(names, images)
        missing = index.count(None)
        if missing > len(images) - min(2, len(images)):
            found = f"poses of images such as {names[0]}, of which the recording has {len(images) - missing}"
            raise DataError(path, found, f"names of its images, such as {images[0].name}")
        of_frames = no_poses(len(images))
        for frame, row in enumerate(index):
            if row is not None:
                of_frames[frame] = poses[row]
        have = counted_of(missing, len(images), "frame", "has", "have")
        lost = (f"{have} no pose",) if missing else ()
        scale = (SCALE_NOTE,) if layout == _COLMAP and TruthKind.birth in sequence.truths else ()
        return of_frames, None, ("they belong to frames by the names of images", *lost, *scale)

    return _File(layout, of)


def _by_name(names: list[str], images: tuple[Path, ...]) -> list[int | None]:
    """Row of each image: that with as many folders of its path as rows have, or its only namesake in both lists."""
    whole = {_parts(name): row for row, name in enumerate(names)}
    depths = sorted({len(parts) for parts in whole}, reverse=True)
    last = [_parts(name)[-1] for name in names]
    alone = {name: row for row, name in enumerate(last) if last.count(name) == 1} if len({*last}) == len(last) else {}
    row_of_image: list[int | None] = []
    for image in images:
        parts = _parts(image.as_posix())
        rows = (whole.get(parts[-depth:]) for depth in depths)
        row_of_image.append(next((row for row in rows if row is not None), alone.get(parts[-1])))
    return row_of_image


def _parts(name: str) -> tuple[str, ...]:
    """Folders and name of an image, without the ending: images may have been converted."""
    return PurePosixPath(name.replace("\\", "/")).with_suffix("").parts


def _image_paths(sequence: Sequence) -> tuple[Path, ...] | None:
    """The image file of each frame as recorded; None where images are no files."""
    while isinstance(sequence, View):
        sequence = sequence.sequence
    paths: tuple[Path, ...] | None = getattr(getattr(sequence, "images", None), "paths", None)
    return paths


def _numbers_of_images(sequence: Sequence) -> list[int] | None:
    """The last number in the name of each image, if they increase; None where there are none."""
    matches = [re.search(r"(\d{1,9})\D*$", path.stem) for path in _image_paths(sequence) or ()]
    numbers = [int(match[1]) for match in matches if match]
    is_usable = len(numbers) == len(sequence) and all(before < after for before, after in pairwise(numbers))
    return numbers if is_usable else None
