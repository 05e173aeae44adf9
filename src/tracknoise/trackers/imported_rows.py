"""From rows of observations to tracks in the frames of a sequence, with the mistakes that the rows show.

Positions are pixels, or on the normalised image plane: x/z and y/z of the ray, without distortion.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.pose import nearest
from tracknoise.geometry.projection import projection_jacobian
from tracknoise.tables.schema import covariances
from tracknoise.text import counted, counted_of, significant
from tracknoise.trackers.id_slots import jumps_note, split_at_births
from tracknoise.trackers.image_names import frames_named, numbers_named, times_named
from tracknoise.trackers.track_columns import Moment
from tracknoise.trackers.tracker import SequenceContext, StatedPoints, are_impossible


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """What a file states about each observation, in its order. At least one of frame, time and image is given."""

    path: Path  # the file
    track: NDArray[np.int64]  # (n,): which track
    uv: NDArray[np.float64]  # (n, 2): position as the file states it; any where the feature was not seen
    frame: NDArray[np.int64] | None = None  # (n,): number of the frame as the file states it
    time_s: NDArray[np.float64] | None = None  # (n,): time, seconds; NaN where unknown, if there are frames
    time_ns: NDArray[np.int64] | None = None  # (n,): time, whole nanoseconds, which float64 does not hold exactly
    image: NDArray[np.str_] | None = None  # (n,): name of the image file
    # (n,): number of the line, or of the row if the file has no lines; None where it has neither
    line: NDArray[np.int64] | None = None
    has_lines: bool = True  # whether `line` counts lines
    response: NDArray[np.float32] | None = None  # (n,): NaN where unknown; None where no response is known
    quality: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)  # (n,): by name; NaN where unknown
    seen: NDArray[np.bool_] | None = None  # (n,): whether the feature was seen; None where it was in all rows
    states_all: bool = False  # whether the file speaks of all frames, so that one without rows has no feature
    names: Mapping[Moment, str] = field(default_factory=dict)  # what the file calls frames, times and images
    notes: tuple[str, ...] = ()  # what the reader left out, one sentence each

    def place(self, row: int) -> str:
        """Where a row is, for an error."""
        if self.line is None:
            frame = "" if self.frame is None else f", frame {self.frame[row]}"
            return f"{self.path}: track {self.track[row]}{frame}"
        return f"{self.path}:{self.line[row]}" if self.has_lines else f"{self.path}: row {self.line[row]}"

    def where(self, kept: NDArray[np.intp] | NDArray[np.bool_]) -> "Rows":
        """Some of the rows, by index or mask."""
        arrays = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        selected: dict[str, Any] = {
            name: values[kept] for name, values in arrays.items() if isinstance(values, np.ndarray)
        }
        return replace(self, **selected, quality={name: values[kept] for name, values in self.quality.items()})

    def chosen(self, kept: NDArray[np.intp], frame: NDArray[np.intp], uv: NDArray[np.float64]) -> "Rows":
        """Some of the rows, by index, with frames and positions."""
        framed = replace(self.where(kept), frame=frame.astype(np.int64), uv=uv)
        return replace(framed, time_s=None, time_ns=None, image=None)

    @property
    def observed(self) -> "Rows":
        """The rows in which the feature was seen."""
        return self if self.seen is None else self.where(self.seen)

    def has(self, by: Moment) -> bool:
        """Whether the file states frames, times or images."""
        if by is Moment.time:
            return self.time_s is not None or self.time_ns is not None
        return (self.frame if by is Moment.frame else self.image) is not None

    def stated(self, by: Moment, row: int) -> str:
        """What a row states of its frame, time or image, for an error."""
        time = self.time_s if self.time_ns is None else self.time_ns
        values = {Moment.frame: self.frame, Moment.time: time, Moment.image: self.image}[by]
        return f"{self.names.get(by, by)} {'' if values is None else values[row]}"

    def refuse(self, bad: NDArray[np.bool_], name: str, values: NDArray[np.generic], expected: str) -> None:
        """Raise an error that shows the first bad value; values (n,) or (n, k)."""
        rows = np.flatnonzero(bad)
        if len(rows):
            row = int(rows[0])
            raise DataError(self.place(row), f"{name} {values[row].tolist()!r}", expected)


LARGEST_EXACT = 2**53 - 1
"""Beyond it, different whole numbers are the same as floating-point numbers."""
LARGEST = 2**63 - 1
"""Largest number of a track or frame."""


def whole_numbers(
    place: Callable[[int], str], values: NDArray[Any], name: str, *, most: int | None = None
) -> NDArray[np.int64]:
    """Whole numbers up to the largest one, by default the largest that is exact.

    `place`: of a value by its index, for errors.
    """
    if most is None:
        most = LARGEST_EXACT if values.dtype.kind == "f" else LARGEST
    bad = np.flatnonzero((values != np.rint(values)) | (np.abs(values) > most))
    if len(bad):
        first = values[bad[0]].item()
        limit = f" of at most {most}" if abs(first) > most else ""
        raise DataError(place(int(bad[0])), f"{name} {first!r}", f"a whole number{limit}")
    numbers: NDArray[np.int64] = values.astype(np.int64)
    return numbers


IN_FLOAT32 = "a number within the range of float32"
"""What is expected of a response or quality."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Observations of imported tracks in the frames of a sequence, sorted by frame and track."""

    # track, frame: (n,): frames are indices in the nominal sequence
    track: NDArray[np.int64]
    frame: NDArray[np.int64]
    uv: NDArray[np.float64]  # (n, 2): px; an integer is the centre of a pixel
    response: NDArray[np.float32]  # (n,): NaN where unknown
    quality: Mapping[str, NDArray[np.float32]]  # (n,): columns ``quality_<name>`` by name; NaN where unknown
    silent: frozenset[int] = frozenset()  # frames of which nothing is stated: no track ends there
    points: StatedPoints | None = None  # all positions, where some are stated of features that were not seen


_SWAP = "of a file, the option columns says which is u"
_LARGEST_NORMALISED = 2.0
_LEAST_ROWS = 10
"""With fewer rows, small positions do not prove normalised coordinates."""
_PIXEL_INSIDE_IF_SWAPPED, _PIXEL_INSIDE_AS_STATED = 0.99, 0.9
NOTED_OUTSIDE = 0.01
"""Share of positions outside the image from which on it is noted."""


class Units(StrEnum):
    """What positions of a file are: ``pixels``, or ``normalised``, x/z and y/z of their rays without distortion."""

    pixels = "pixels"
    normalised = "normalised"


class PixelOrigin(StrEnum):
    """What the position (0, 0) of a file is: the centre of the first pixel, or its corner, the corner of the image."""

    centre = "centre"
    corner = "corner"


class Columns(StrEnum):
    """What the two numbers of a position are: u to the right and v down, with a minus where they count from the end."""

    uv = "u v"
    uv_up = "u -v"
    uv_left = "-u v"
    uv_turned = "-u -v"
    vu = "v u"
    vu_left = "v -u"
    vu_up = "-v u"
    vu_turned = "-v -u"

    @property
    def axes(self) -> tuple[int, int]:
        """For u and v: which of the numbers it is, from 1, negative where it counts from the end."""
        names = [name.removeprefix("-") for name in self.split()]
        signs = [-1 if name.startswith("-") else 1 for name in self.split()]
        u, v = names.index("u"), names.index("v")
        return signs[u] * (u + 1), signs[v] * (v + 1)

    @classmethod
    def of(cls, axes: tuple[int, int]) -> "Columns":
        """That of which these are the axes."""
        return next(member for member in cls if member.axes == axes)

    def then(self, axes: tuple[int, int]) -> "Columns":
        """What the numbers are if u and v of these columns have to be read as `axes` again."""
        u, v = (self.axes[abs(axis) - 1] * (1 if axis > 0 else -1) for axis in axes)
        return Columns.of((u, v))

    def ordered(self, rows: "Rows", extent: tuple[float, float]) -> "Rows":
        """Rows whose positions are u and v, covariances too. `extent`: sum of a position and the same from the end."""
        places, signs = np.abs(self.axes) - 1, np.sign(self.axes)
        uv = np.where(signs < 0, np.array(extent) - rows.uv[:, places], rows.uv[:, places])
        quality = dict(rows.quality)
        for uu, cross, vv in covariances(rows.quality):
            stated = rows.quality[uu], rows.quality[vv]
            quality |= {uu: stated[places[0]], vv: stated[places[1]]}
            quality[cross] = (rows.quality[cross] * np.float32(signs.prod())).astype(np.float32)
        return replace(rows, uv=uv, quality=quality)


@dataclass(frozen=True, slots=True)
class Raster:
    """Coordinates of a file.

    Parameters
    ----------
    origin
        What (0, 0) is.
    size
        (width, height) of the images in the units of the file; None if that is their size in px.
    """

    origin: PixelOrigin
    size: tuple[float, float] | None = None

    def check(self, rows: Rows, context: SequenceContext) -> None:
        """Refuse positions that are normalised, whose columns are swapped, or of which none is in the image."""
        image = context.size
        images = f"images of {image[0]} x {image[1]} px"
        if self.size is None and _are_normalised(rows.uv, image):
            low, high = rows.uv.min(), rows.uv.max()
            extent = f"{significant(low, 3)} to {significant(high, 3)}"
            across = 'if they run from 0 to 1 across the image, set raster = [1, 1] and origin = "corner"'
            expected = f"pixels, and these look like normalised coordinates: {across}"
            rest = 'if they are x/z and y/z, set units = "normalised"'
            raise DataError(rows.path, f"positions from {extent} in {images}", f"{expected}; {rest}")
        uv = self.in_image(rows.uv, image)
        stated, swapped = inside(uv, image).mean(), inside(uv[:, ::-1], image).mean()
        if stated < _PIXEL_INSIDE_AS_STATED and swapped > _PIXEL_INSIDE_IF_SWAPPED:
            found = f"{stated:.0%} of positions inside {images}, {swapped:.0%} with u and v swapped"
            expected = "u to the right and v down: the columns are swapped, or width and height of the camera"
            raise DataError(rows.path, found, f"{expected}; {_SWAP}")
        if stated == 0:
            expected = "pixels of these images; for tracks of resized images set raster = [width, height]"
            raise DataError(rows.path, f"no position inside {images}", expected)

    def extent(self, context: SequenceContext) -> tuple[float, float]:
        """Sum of a position of the file and the same position from the other end."""
        width, height = self.size or context.size
        less = 1 if self.origin is PixelOrigin.centre else 0
        return width - less, height - less

    def to_pixels(
        self, uv: NDArray[np.float64], frame: NDArray[np.int64], context: SequenceContext
    ) -> NDArray[np.float64]:
        """Positions (n, 2), px; an integer is the centre of a pixel."""
        return self.in_image(uv, context.size)

    def in_image(self, uv: NDArray[np.float64], image: tuple[int, int]) -> NDArray[np.float64]:
        """Positions (n, 2) in an image of (width, height) px; an integer is the centre of a pixel."""
        if self.size is None:
            return uv if self.origin is PixelOrigin.centre else uv - 0.5
        from_corner = uv + 0.5 if self.origin is PixelOrigin.centre else uv
        with np.errstate(over="ignore", invalid="ignore"):
            pixels: NDArray[np.float64] = from_corner * (np.array(image) / self.size) - 0.5
        return pixels

    def covariances_to_pixels(
        self,
        quality: Mapping[str, NDArray[np.float32]],
        uv: NDArray[np.float64],
        frame: NDArray[np.int64],
        context: SequenceContext,
    ) -> dict[str, NDArray[np.float32]]:
        """Quality with the covariances among it in px^2. All other quality stays as it is."""
        converted = dict(quality)
        if self.size is None:
            return converted
        u, v = np.array(context.size) / self.size
        factors = (np.float32(u * u), np.float32(u * v), np.float32(v * v))
        for names in covariances(quality):
            converted |= {name: quality[name] * factor for name, factor in zip(names, factors, strict=True)}
        return converted


def _are_normalised(uv: NDArray[np.float64], image: tuple[int, int]) -> bool:
    if len(uv) < _LEAST_ROWS or min(image) < 10 * _LARGEST_NORMALISED:
        return False
    return bool(np.abs(uv).max() <= _LARGEST_NORMALISED and (uv != np.rint(uv)).any())


def inside(uv: NDArray[np.float64], image: tuple[int, int]) -> NDArray[np.bool_]:
    """Whether positions (n, 2) lie in an image of (width, height) px; NaN does not."""
    return np.asarray(((uv >= -0.5) & (uv <= np.array(image) - 0.5)).all(axis=1))


def are_far(uv: NDArray[np.float64], image: tuple[int, int]) -> NDArray[np.bool_]:
    """Whether positions (n, 2) are farther from an image of (width, height) px than its diagonal; NaN is not."""
    diagonal = np.hypot(*image)
    beyond = np.minimum(np.abs(uv - np.clip(uv, -0.5, np.array(image) - 0.5)), 2 * diagonal)  # a square may overflow
    return np.asarray(np.hypot(*beyond.T) > diagonal)


def expected_near(image: tuple[int, int]) -> str:
    """What is expected of a position that `are_far` refuses."""
    return f"at most {np.hypot(*image):.0f} px, the diagonal, from the image of {image[0]} x {image[1]} px"


_INSIDE_IF_PIXELS, _NORMALISED_INSIDE_IF_SWAPPED, _NORMALISED_INSIDE_AS_STATED = 0.9, 0.99, 0.9


@dataclass(frozen=True, slots=True)
class Normalised:
    """Coordinates x/z and y/z in the frame of the camera: x to the right, y down, (0, 0) on the optical axis.

    Positions become pixels by the camera of the sequence with its distortion: that of their frame, where it changes.
    """

    def extent(self, context: SequenceContext) -> tuple[float, float]:
        """Sum of a position of the file and the same position from the other end: (0, 0) is in the middle."""
        return 0.0, 0.0

    def check(self, rows: Rows, context: SequenceContext) -> None:
        """Refuse positions that are pixels, whose columns are swapped, or of which none is in the image."""
        camera, size = _camera_at(context, 0), context.size
        stated = inside(_projected(camera, rows.uv), size).mean()
        if stated >= _NORMALISED_INSIDE_AS_STATED:
            return
        low, high = significant(rows.uv.min(), 3), significant(rows.uv.max(), 3)
        found = f"positions from {low} to {high}, of which {stated:.0%} are inside images of {size[0]} x {size[1]} px"
        if inside(rows.uv, size).mean() > max(_INSIDE_IF_PIXELS, stated):
            expected = "x/z and y/z, and these look like pixels: leave out units, or divide by the intrinsics"
            raise DataError(rows.path, found, expected)
        if inside(_projected(camera, rows.uv[:, ::-1]), size).mean() > _NORMALISED_INSIDE_IF_SWAPPED:
            raise DataError(rows.path, found, f"x/z to the right and y/z down: the columns are swapped; {_SWAP}")
        if stated == 0:
            raise DataError(rows.path, found, "x/z and y/z of the camera of this sequence, without its distortion")

    def to_pixels(
        self, uv: NDArray[np.float64], frame: NDArray[np.int64], context: SequenceContext
    ) -> NDArray[np.float64]:
        """Positions (n, 2), px; an integer is the centre of a pixel. NaN where the camera has no image of a ray."""
        pixels = np.full(uv.shape, np.nan)
        for camera, rows in _by_camera(frame, context):
            pixels[rows] = _projected(camera, uv[rows])
        return pixels

    def covariances_to_pixels(
        self,
        quality: Mapping[str, NDArray[np.float32]],
        uv: NDArray[np.float64],
        frame: NDArray[np.int64],
        context: SequenceContext,
    ) -> dict[str, NDArray[np.float32]]:
        """Quality with the covariances among it in px^2, to first order. All other quality stays as it is."""
        converted = dict(quality)
        names = list(covariances(quality))
        if not names:
            return converted
        jacobian = np.full((len(uv), 2, 2), np.nan)
        for camera, rows in _by_camera(frame, context):
            jacobian[rows] = projection_jacobian(camera, _rays(uv[rows]))[..., :2]
        for uu, uv_name, vv in names:
            stated = np.stack([quality[name] for name in (uu, uv_name, uv_name, vv)], axis=-1).reshape(-1, 2, 2)
            in_px = jacobian @ stated.astype(np.float64) @ np.swapaxes(jacobian, 1, 2)
            entries = {uu: in_px[:, 0, 0], uv_name: in_px[:, 0, 1], vv: in_px[:, 1, 1]}
            converted |= {name: values.astype(np.float32) for name, values in entries.items()}
        return converted


def _rays(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) float64: points of the camera frame at depth 1."""
    return np.column_stack([xy, np.ones(len(xy))])


def _projected(camera: CameraModel, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    return camera.project(_rays(xy))


def _camera_at(context: SequenceContext, index: int) -> CameraModel:
    if context.camera_at is None:
        raise SettingsError("imported: units = normalised, but the camera is unknown, expected units = pixels")
    return context.camera_at(index)


def _by_camera(frame: NDArray[np.int64], context: SequenceContext) -> Iterator[tuple[CameraModel, NDArray[np.bool_]]]:
    """Each camera, and which rows are of its frames."""
    frames, place = np.unique(frame, return_inverse=True)
    cameras = [_camera_at(context, index) for index in frames.tolist()]
    for camera in dict.fromkeys(cameras):
        yield camera, np.array([of_frame == camera for of_frame in cameras], dtype=np.bool_)[place]


@dataclass(frozen=True, slots=True, eq=False)
class _Taken:
    """Rows with frames, and how many rows were left out."""

    rows: Rows
    far: int = 0  # rows that are too far from every frame
    passed: int = 0  # rows of a track that are nearest to the same frame as another that is nearer


def in_seconds(rows: Rows, offset_s: float, start_ns: int = 0) -> Rows:
    """The same rows with times in seconds after a start, an offset added. Nanoseconds are added as whole numbers."""
    if rows.time_ns is not None:
        return replace(rows, time_s=(rows.time_ns - start_ns + round(1e9 * offset_s)) / 1e9, time_ns=None)
    assert rows.time_s is not None, "there are times"
    return replace(rows, time_s=rows.time_s + offset_s - 1e-9 * start_ns)


def nearest_frames(rows: Rows, frames_s: NDArray[np.float64], max_gap_s: float) -> _Taken:
    """Assign each row to the frame that is nearest in time.

    Of several rows of a track that are nearest to the same frame, the nearest is kept.
    """
    time_s = _times(rows)
    frame = nearest(time_s, frames_s, max_gap_s=max_gap_s)
    gap = np.abs(time_s - frames_s[frame])
    near = np.flatnonzero(frame >= 0)
    _require_any(rows, near, frames_s)
    _require_one_row_each_time(rows, near[np.lexsort([time_s[near], rows.track[near]])], unless_equal=True)
    order = near[np.lexsort([gap[near], rows.track[near], frame[near]])]
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = (np.diff(frame[order]) != 0) | (np.diff(rows.track[order]) != 0)
    kept = np.sort(order[first])
    return _Taken(rows.chosen(kept, frame[kept], rows.uv[kept]), len(time_s) - len(near), len(near) - len(kept))


def interpolated(rows: Rows, frames_s: NDArray[np.float64], max_gap_s: float) -> _Taken:
    """Positions of each track at the times of frames, linear between the observations before and after."""
    time_s = _times(rows).copy()
    at_frame = nearest(time_s, frames_s, max_gap_s=_ROUNDING_S)
    time_s[at_frame >= 0] = frames_s[at_frame[at_frame >= 0]]
    rows = replace(rows, time_s=time_s)
    seen = np.ones(len(time_s), dtype=np.bool_) if rows.seen is None else rows.seen
    order = np.lexsort([time_s, rows.track])
    _require_one_row_each_time(rows, order[seen[order]])
    track, time_s, uv, seen = rows.track[order], time_s[order], rows.uv[order], seen[order]
    # whether the next row is of the same track, and the feature was seen in both
    same = np.append((track[1:] == track[:-1]) & seen[1:] & seen[:-1], np.False_)
    following = np.append(time_s[1:], np.nan)
    with np.errstate(over="ignore"):
        linked = same & (following - time_s <= max_gap_s)
    first = np.searchsorted(frames_s, time_s)
    last = np.where(linked, np.searchsorted(frames_s, np.where(linked, following, time_s)), first)
    at_row = seen & (first < len(frames_s)) & (frames_s[np.minimum(first, len(frames_s) - 1)] == time_s)
    counts = np.where(linked, last - first, at_row)
    row = np.repeat(np.arange(len(track)), counts)
    frame = first[row] + np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    _require_any(rows, row, frames_s)
    later = np.where(linked[row], row + 1, row)
    span = np.where(linked[row], time_s[later] - time_s[row], 1.0)
    share = (frames_s[frame] - time_s[row]) / span
    return _Taken(rows.chosen(order[row], frame, uv[row] + share[:, None] * (uv[later] - uv[row])))


def _times(rows: Rows) -> NDArray[np.float64]:
    assert rows.time_s is not None, "times are in seconds"
    return rows.time_s


def _require_any(rows: Rows, used: NDArray[np.intp], frames_s: NDArray[np.float64]) -> None:
    if len(used):
        return
    time_s = _times(rows)
    expected = f"times of the frames, from {frames_s[0]:.9g} to {frames_s[-1]:.9g} s; {_time_advice(time_s, frames_s)}"
    raise DataError(rows.path, f"times from {time_s.min():.9g} to {time_s.max():.9g} s", expected)


def _time_advice(time_s: NDArray[np.float64], frames_s: NDArray[np.float64]) -> str:
    if (unit := _likely_unit(time_s, frames_s)) is not None:
        return f'these look like {unit}: set time_unit = "{_SYMBOLS[unit]}"'
    offset_s = float(frames_s[0] - time_s.min())
    if abs(offset_s) > LARGEST_OFFSET_S:
        return 'these are no seconds: set time_unit = "ns", "us" or "ms"'
    advice = "if the clocks differ, set time_offset_s, which is added"
    return f"{advice}: {offset_s:.9f} would put the first row into the first frame"


_SIZES_S: Mapping[float, str] = {1e-3: "milliseconds", 1e-6: "microseconds", 1e-9: "nanoseconds", 1e3: "microseconds"}
"""Units that are taken for seconds, by their size; and one that whole numbers of many digits hide as nanoseconds."""
_SYMBOLS: Mapping[str, str] = {"milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns"}


def _likely_unit(time_s: NDArray[np.float64], frames_s: NDArray[np.float64]) -> str | None:
    """The unit in which times would last about as long as the frames; None where that is seconds, or no unit."""
    with np.errstate(over="ignore"):
        ratio = np.ptp(time_s) / max(np.ptp(frames_s), 1e-9)
    return next((unit for size, unit in _SIZES_S.items() if 0.5 <= ratio * size <= 2.0), None)


def _require_one_row_each_time(rows: Rows, order: NDArray[np.intp], *, unless_equal: bool = False) -> None:
    """Check rows in the order of tracks and times; rows with equal positions may be allowed."""
    track, time_s, uv = rows.track[order], _times(rows)[order], rows.uv[order]
    again = (track[1:] == track[:-1]) & (time_s[1:] == time_s[:-1])
    if unless_equal:
        again &= (uv[1:] != uv[:-1]).any(axis=1)
    twice = np.zeros(len(rows.track), dtype=np.bool_)
    twice[order[1:][again]] = True
    rows.refuse(twice, "track", rows.track, "one row for each track and time")


LARGEST_OFFSET_S = 4e9
"""Seconds beyond the times of any clock."""
NEAREST_GAP = 0.5
"""Largest distance between a row and its frame, as a share of the median time between frames."""
INTERPOLATED_GAP = 1.5
"""Largest distance between two rows with a frame between them, as such a share."""
_ROUNDING_S = 4e-7
"""Times of events that differ less from that of a frame are the same: microseconds, and seconds since 1970."""
_LARGEST_POSITION = 1e30
_MOST_CONTRADICTING = 0.01
"""Share of rows whose frame and time may differ, as times between two frames are rounded."""
_LEAST_COMPARED = 0.5
"""Share of rows that must show a frame in two ways, so that the two are compared."""
_LEAST_FRAMES = 3
"""With fewer frames, a regular distance between them proves nothing."""


class Ids(StrEnum):
    """What ids name: ``tracks``, or the ``slots`` of an array, each of which has one feature after another."""

    tracks = "tracks"
    slots = "slots"


@dataclass(frozen=True, slots=True)
class Assignment:
    """How the rows of a file belong to the frames of a sequence."""

    raster: Raster | Normalised  # coordinates of positions
    first_frame: int = 0  # number that the file gives the first frame of the sequence
    time_offset_s: float = 0.0  # added to the times of the file to get those of the sequence, seconds
    # Largest distance between a row and its frame, or between two rows with a frame between them, seconds. Default:
    # `NEAREST_GAP` or `INTERPOLATED_GAP` times the median time between frames.
    max_gap_s: float | None = None
    # Whether positions are interpolated at the times of frames. Otherwise each row belongs to the nearest frame.
    asynchronous: bool = False
    frames_by: Moment | None = None  # what counts where rows have two of them; None: they must agree
    ids: Ids = Ids.tracks
    columns: Columns = Columns.uv  # what the numbers of a position are

    def tracks(self, rows: Rows, context: SequenceContext) -> tuple[Tracks, tuple[str, ...]]:
        """Tracks in the frames of a sequence, and what should be known about them, one sentence each."""
        _require_computable(rows.observed)
        _require_seen(rows.observed)
        rows = replace(rows, quality=_with_diagonal(rows.quality))
        rows = self.columns.ordered(rows, self.raster.extent(context))
        observed = rows.observed
        self.raster.check(observed, context)
        _require_covariances(observed)
        by = self._moment(rows, context)
        compared = tuple(self._compared(observed, by, context))
        taken = self._framed(rows, by, context)
        framed, unseen = self._in_pixels(taken.rows, context)
        _require_near(framed, context.size)
        frame, uv, quality = _frames(framed), framed.uv, framed.quality
        order = np.lexsort([framed.track, frame])
        _require_one_row_each_frame(framed, frame, order)
        hidden = None if rows.seen is None else self._hidden(rows.where(~rows.seen), by, context)
        stated = np.unique(frame if hidden is None else np.concatenate([frame, hidden.frame]))
        silent = np.empty(0, dtype=np.int64) if rows.states_all else _silent(rows.path, stated, context)
        track, named = self._named(framed.track[order], frame[order], uv[order], context.size)
        unknown = np.full(len(order), np.nan, dtype=np.float32)
        tracks = Tracks(
            track,
            frame[order],
            uv[order],
            unknown if framed.response is None else framed.response[order],
            {name: values[order] for name, values in quality.items()},
            frozenset(silent.tolist()),
            None if hidden is None or self.ids is Ids.slots else _with_hidden(track, frame[order], uv[order], hidden),
        )
        notes = _notes(observed, tracks, taken, context)
        return tracks, (
            *rows.notes,
            *compared,
            *_unseen_notes(unseen),
            *notes,
            *_silent_notes(stated, silent, context),
            *named,
        )

    def _named(
        self, track: NDArray[np.int64], frame: NDArray[np.int64], uv: NDArray[np.float64], size: tuple[int, int]
    ) -> tuple[NDArray[np.int64], tuple[str, ...]]:
        """Which track each observation is of, sorted by frame and track, and what ids show: see `Ids`."""
        if self.ids is Ids.slots:
            return split_at_births(track, frame, uv)
        note = jumps_note(track, frame, uv)
        return track, () if note is None else (note,)

    def _moment(self, rows: Rows, context: SequenceContext) -> Moment:
        """What says in which frame an observation is."""
        if self.frames_by is not None:
            if not rows.has(self.frames_by):
                raise DataError(rows.path, f"no {self.frames_by}", f"a column of it where frames_by = {self.frames_by}")
            return self.frames_by
        moments = [by for by in Moment if rows.has(by)]
        if not moments:
            raise DataError(rows.path, "rows without a frame, time or image", "one of them in each row")
        return next((by for by in moments if by is not Moment.time or context.timestamps_s is not None), moments[0])

    def _compared(self, rows: Rows, by: Moment, context: SequenceContext) -> Iterator[str]:
        """Refuse frames, times and images of a file that contradict each other, unless one of them is chosen.

        A sentence for each that could not be compared.
        """
        others = [] if self.frames_by is not None else [other for other in Moment if other is not by]
        frame = self._frame_by(rows, by, context)
        for other in others:
            if not rows.has(other) or (other is Moment.image and context.image_names is None):
                continue
            named = self._frame_by(rows, other, context, beside=True)
            in_both = (frame >= 0) & (named >= 0)
            differ = in_both & (frame != named)
            if np.count_nonzero(in_both) < _LEAST_COMPARED * len(frame):
                yield f"column {rows.names[other]} of {rows.path.name} fits to no frame, and is not used"
            elif np.count_nonzero(differ) > _MOST_CONTRADICTING * np.count_nonzero(in_both):
                row = int(np.flatnonzero(differ)[0])
                apart = np.unique(np.abs(named - frame)[differ])
                span = counted(int(apart[0]), "frame") if len(apart) == 1 else f"{apart[0]} to {apart[-1]} frames"
                found = f"{rows.stated(by, row)} and {rows.stated(other, row)}, which is that of frame {named[row]}"
                share = f"they differ by {span} in {differ.sum() / in_both.sum():.0%} of the rows"
                expected = f'columns that agree; frames_by = "{by}" or "{other}" chooses one of them'
                raise DataError(rows.place(row), f"{found}: {share}", expected)

    def _frame_by(self, rows: Rows, by: Moment, context: SequenceContext, *, beside: bool = False) -> NDArray[np.int64]:
        """The frame of each row by one of the things that the file states, -1 where it shows none.

        `beside`: whether frames are known by another, so that times count that are near to one of a frame, in any unit.
        """
        if by is Moment.image:
            assert rows.image is not None, "rows have images"
            return self._imaged(rows, rows.image, context)
        if by is Moment.frame:
            return _placed(_frames(rows) - self.first_frame, context)
        frame = np.full(len(rows.track), -1, dtype=np.int64)
        if context.timestamps_s is None:
            return frame
        time_s = _times(self._timed(rows, context.timestamps_s, context.clock_start_ns))
        has_time = np.flatnonzero(np.isfinite(time_s))
        limit = self._largest_gap_s(context.timestamps_s, context.source_frames) * (0.5 if beside else 1.0)
        for unit in (1.0, *_SIZES_S) if beside else (1.0,):
            frame[has_time] = nearest(unit * time_s[has_time], context.timestamps_s, max_gap_s=limit)
            if np.count_nonzero(frame >= 0) >= _LEAST_COMPARED * len(frame):
                break
        return frame

    def _imaged(self, rows: Rows, image: NDArray[np.str_], context: SequenceContext) -> NDArray[np.int64]:
        """The frame of each row by the name of its image: by the files of the sequence, or a time or number in it."""
        if context.image_names is not None:
            return frames_named(image, context.image_names)
        if (time_s := times_named(image)) is not None:
            timed = replace(rows, time_s=time_s, time_ns=None)
            return self._frame_by(timed, Moment.time, context)
        return _placed(numbers_named(image) - self.first_frame, context)

    def _hidden(self, rows: Rows, by: Moment, context: SequenceContext) -> "_Hidden":
        """Rows of features that were not seen, in frames of the sequence; positions in px where they are stated."""
        frame = self._frame_by(rows, by, context)
        in_sequence = frame >= 0
        track, frame, uv = rows.track[in_sequence], frame[in_sequence], rows.uv[in_sequence]
        has_position = np.isfinite(uv).all(axis=1) & (np.abs(np.nan_to_num(uv)) <= _LARGEST_POSITION).all(axis=1)
        pixels = np.full(uv.shape, np.nan)
        pixels[has_position] = self.raster.to_pixels(uv[has_position], frame[has_position], context)
        return _Hidden(track, frame, pixels)

    def _in_pixels(self, rows: Rows, context: SequenceContext) -> tuple[Rows, NDArray[np.bool_]]:
        """Rows in pixels, covariances too; and which rows the camera has no image of: they are left out."""
        frame = _frames(rows)
        uv = self.raster.to_pixels(rows.uv, frame, context)
        with np.errstate(over="ignore", invalid="ignore"):
            quality = self.raster.covariances_to_pixels(rows.quality, rows.uv, frame, context)
        for name, values in quality.items():
            beyond = np.asarray(np.isinf(values) & np.isfinite(rows.quality[name]))
            rows.refuse(beyond, name, rows.quality[name], f"{IN_FLOAT32}, in px^2 too")
        in_px = replace(rows, uv=uv, quality=quality)
        unseen = np.isnan(uv[:, 0]) | np.isnan(uv[:, 1])
        kept = np.flatnonzero(~unseen)
        return in_px.chosen(kept, frame[kept], uv[kept]) if unseen.any() else in_px, unseen

    def _framed(self, rows: Rows, by: Moment, context: SequenceContext) -> _Taken:
        """The observations with their frames."""
        if by is Moment.frame:
            observed = rows.observed
            return _Taken(self._numbered(observed, _frames(observed), context))
        if by is Moment.image:
            return _Taken(self._by_image(rows.observed, context))
        if context.timestamps_s is None:
            expected = "frame numbers, because the times of the sequence's frames are unknown"
            raise DataError(rows.path, "times", expected)
        assign = interpolated if self.asynchronous else nearest_frames
        limit = self._largest_gap_s(context.timestamps_s, context.source_frames)
        chosen = rows if self.asynchronous else rows.observed
        timed = self._timed(chosen, context.timestamps_s, context.clock_start_ns)
        taken = assign(timed, context.timestamps_s, limit)
        return replace(taken, far=0) if context.source_frames else taken

    def _by_image(self, rows: Rows, context: SequenceContext) -> Rows:
        """Rows with the frames of their images. Images of a recording that were not chosen go."""
        image = rows.image
        assert image is not None, "rows have images"
        frame = self._imaged(rows, image, context)
        kept = np.flatnonzero(frame >= 0)
        if context.source_frames is None or not len(kept):
            names = context.image_names
            expected = "an image of the sequence" + ("" if names is None else f", such as {names[0]}")
            rows.refuse(frame < 0, rows.names.get(Moment.image, "image"), image, expected)
        return rows.chosen(kept, frame[kept], rows.uv[kept])

    def _timed(self, rows: Rows, frames_s: NDArray[np.float64], start_ns: int | None) -> Rows:
        """Rows with times in seconds of the sequence. Those of the clock of the recording are nearer to its start."""
        timed = in_seconds(rows, self.time_offset_s)
        first = _times(timed).min()
        if start_ns is None or abs(first - 1e-9 * start_ns) >= abs(first - frames_s[0]):
            return timed
        return in_seconds(rows, self.time_offset_s, start_ns)

    def _largest_gap_s(self, frames_s: NDArray[np.float64], source: range | None) -> float:
        """By default a share of the median time between frames of the recording."""
        if self.max_gap_s is not None:
            return self.max_gap_s
        interval = float(np.median(np.diff(frames_s))) / (source.step if source else 1)
        return (INTERPOLATED_GAP if self.asynchronous else NEAREST_GAP) * interval

    def _numbered(self, rows: Rows, frame: NDArray[np.int64], context: SequenceContext) -> Rows:
        """Rows whose frames count from the first of the sequence. Frames of a recording that were not chosen go."""
        if context.source_frames is not None:
            return _chosen(rows, frame - self.first_frame, context)
        n_frames = context.n_frames
        first, last = self.first_frame, self.first_frame + n_frames - 1
        expected = f"a frame from {first} to {last} of the sequence"
        if first == 0 and frame.min() == 1 and frame.max() == n_frames:
            expected += "; frames are counted from 1: set first_frame = 1"
        rows.refuse((frame < first) | (frame > last), "frame", frame, expected)
        return rows.chosen(np.arange(len(frame)), frame - first, rows.uv)


def _placed(frame: NDArray[np.int64], context: SequenceContext) -> NDArray[np.int64]:
    """Frames of a recording as those of the sequence, -1 for what it does not have."""
    source = context.source_frames or range(context.n_frames)
    place, skipped = np.divmod(frame - source.start, source.step)
    return np.where((skipped == 0) & (place >= 0) & (place < len(source)), place, -1)


def _chosen(rows: Rows, frame: NDArray[np.int64], context: SequenceContext) -> Rows:
    """The rows in frames of a recording that were chosen, with their numbers among these."""
    place = _placed(frame, context)
    kept = np.flatnonzero(place >= 0)
    if not len(kept):
        source = context.source_frames or range(context.n_frames)
        found = f"frames from {frame.min()} to {frame.max()}"
        raise DataError(rows.path, found, f"some of the chosen frames, {source[0]} to {source[-1]} of the recording")
    return rows.chosen(kept, place[kept], rows.uv[kept])


def _frames(rows: Rows) -> NDArray[np.int64]:
    assert rows.frame is not None, "rows have frames"
    return rows.frame


@dataclass(frozen=True, slots=True, eq=False)
class _Hidden:
    """Rows of features that were not seen, in frames of a sequence."""

    track: NDArray[np.int64]  # (n,)
    frame: NDArray[np.int64]  # (n,)
    uv: NDArray[np.float64]  # (n, 2): px; NaN where the file states no position


def _with_hidden(
    track: NDArray[np.int64], frame: NDArray[np.int64], uv: NDArray[np.float64], hidden: _Hidden
) -> StatedPoints | None:
    """All positions that are stated, those of observations and others; None where there are no others."""
    has_position = np.isfinite(hidden.uv).all(axis=1)
    if not has_position.any():
        return None
    return StatedPoints(
        np.concatenate([hidden.track[has_position], track]),
        np.concatenate([hidden.frame[has_position], frame]),
        np.concatenate([hidden.uv[has_position], uv]),
        np.arange(np.count_nonzero(has_position) + len(track)) >= np.count_nonzero(has_position),
    )


def _silent(path: Path, stated: NDArray[np.int64], context: SequenceContext) -> NDArray[np.int64]:
    """Frames that the tracker sees and of which the file says nothing, after the first of which it says something.

    Refuses frames of which only every k-th has rows, where the tracker would see these at speed k.
    """
    speed, present = context.speed, stated[stated % context.speed == 0]
    if len(stated) >= _LEAST_FRAMES:
        step = int(np.gcd.reduce(np.diff(stated)))
        if step > 1 and speed % step and stated[0] % step == 0:
            found = f"rows in one of {step} frames only: {', '.join(map(str, stated[:3]))}, ..."
            rest = f"that are seen at speed {speed}; for such tracks set speeds = [{step}]"
            raise DataError(path, found, f"rows in consecutive frames {rest}")
    if not len(present):
        found = f"rows in no frame that is seen at speed {speed}: {', '.join(map(str, stated[:3]))}, ..."
        raise DataError(path, found, "rows in some of these frames, or speeds = [1]")
    return np.setdiff1d(np.arange(present[0], context.n_frames, speed), present)


def _silent_notes(stated: NDArray[np.int64], silent: NDArray[np.int64], context: SequenceContext) -> Iterator[str]:
    """A sentence about frames without rows between frames with rows."""
    between = silent[silent < stated.max(initial=0)]
    if len(between):
        total = len(range(int(stated[0]), int(stated[-1]) + 1, context.speed))
        examples = ", ".join(map(str, between[:3])) + (", ..." if len(between) > 3 else "")
        have = counted_of(total - len(between), total, "frame", "has", "have")
        yield f"{have} rows of imported tracks, not {examples}: a track ends where it is absent and others are present"


def _require_computable(rows: Rows) -> None:
    """Refuse positions with which arithmetic overflows."""
    beyond = np.asarray((np.abs(rows.uv) > _LARGEST_POSITION).any(axis=1))
    rows.refuse(beyond, "position", rows.uv, f"numbers of at most {_LARGEST_POSITION:g}")


def _require_seen(rows: Rows) -> None:
    """Refuse positions that programs write where a feature was not seen: corners are not there twice to all digits."""
    for value in _NOT_SEEN:
        there = np.asarray((rows.uv == value).all(axis=1))
        if (count := np.count_nonzero(there)) > 1:
            expected = (
                f"positions of what was seen: {count} rows have this one; leave them out, or add a column visible"
            )
            rows.refuse(there, "position", rows.uv, expected)


_NOT_SEEN = (0.0, -1.0)
"""Both coordinates of such positions."""


def _with_diagonal(quality: Mapping[str, NDArray[np.float32]]) -> dict[str, NDArray[np.float32]]:
    """Quality in which variances of u and v that stand alone have a covariance of 0."""
    completed = dict(quality)
    for name in [name.removesuffix("_uu") for name in quality if name.endswith("_uu")]:
        if f"{name}_vv" in quality:
            completed.setdefault(f"{name}_uv", np.zeros_like(quality[f"{name}_uu"]))
    return completed


def _require_near(rows: Rows, image: tuple[int, int]) -> None:
    """Refuse positions that no feature has: one of them would decide every second moment."""
    rows.refuse(are_far(rows.uv, image), "position", rows.uv, f"{expected_near(image)}; leave out what was not seen")


def _require_covariances(rows: Rows) -> None:
    for names in covariances(rows.quality):
        entries = np.array([rows.quality[name] for name in names], dtype=np.float64)
        expected = "no negative eigenvalue; NaN where there is no covariance"
        rows.refuse(are_impossible(*entries), ", ".join(names), entries.T, expected)


def _require_one_row_each_frame(rows: Rows, frame: NDArray[np.int64], order: NDArray[np.intp]) -> None:
    again = (np.diff(frame[order]) == 0) & (np.diff(rows.track[order]) == 0)
    twice = np.zeros(len(order), dtype=np.bool_)
    twice[order[1:][again]] = True
    rows.refuse(twice, "track", rows.track, "one row for each track and frame")


def _unseen_notes(unseen: NDArray[np.bool_]) -> Iterator[str]:
    if unseen.any():
        yield f"{unseen.mean():.1%} of imported positions have no image in the camera, and were left out"


def _notes(rows: Rows, tracks: Tracks, taken: _Taken, context: SequenceContext) -> Iterator[str]:
    outside = float(1 - inside(tracks.uv, context.size).mean())
    if outside >= NOTED_OUTSIDE:
        yield f"{outside:.1%} of imported positions are outside the image"
    if taken.passed:
        passed = counted_of(taken.passed, len(rows.track), "imported row", "was", "were")
        yield f"{passed} left out: another of the same track is as near or nearer in time to the same frame"
    if taken.far and context.timestamps_s is not None:
        share, unit = taken.far / len(rows.track), _likely_unit(_times(in_seconds(rows, 0.0)), context.timestamps_s)
        looks = "" if unit is None else f"; their times look like {unit}"
        yield f"{share:.1%} of imported rows are too far in time from every frame, and were left out{looks}"
    if len(tracks.track) > 1 and len(np.unique(tracks.track)) == len(tracks.track):
        yield "each imported track has one row alone, so that no error is seen: does its column name tracks, or rows?"
    if rows.frame is not None and tracks.frame.min() == 1:
        yield "imported tracks have no row in frame 0: if their frames are counted from 1, set first_frame = 1"
