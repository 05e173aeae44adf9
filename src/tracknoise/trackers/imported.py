"""Imported tracks: what any other front end wrote to a file, or holds in memory."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import ArrayLike, NDArray

from tracknoise.checks import Positive, require, require_bounds, settle_members
from tracknoise.exceptions import SettingsError, first_line
from tracknoise.options import PathTemplate
from tracknoise.tables.identity import PLACEHOLDERS, Direction, SequenceId
from tracknoise.tables.schema import TrackEnd
from tracknoise.time_units import TimeUnit
from tracknoise.trackers.features import ALIVE, Features, report
from tracknoise.trackers.imported_rows import (
    IN_FLOAT32,
    LARGEST,
    LARGEST_EXACT,
    LARGEST_OFFSET_S,
    Assignment,
    Columns,
    Ids,
    Normalised,
    PixelOrigin,
    Raster,
    Rows,
    Tracks,
    Units,
)
from tracknoise.trackers.refinement import SHIFT, Refinement
from tracknoise.trackers.track_columns import Moment, Selection
from tracknoise.trackers.track_files import SUFFIXES, TrackFormat, detected, origin_of, read_rows
from tracknoise.trackers.tracker import Frame, SequenceContext, StatedPoints, Step, is_quality_name


def _subsampled(tracks: Tracks, context: SequenceContext) -> tuple[str, ...]:
    """A note if the tracks were not made at the speed at which they are measured: they have rows between its frames."""
    if not np.any(tracks.frame % context.speed):
        return ()
    note = "imported tracks are those of speed 1, subsampled: what a tracker does at this speed is not measured"
    return (f"at speed {context.speed}, {note}",)


_AS_REPORTED = Refinement()
LARGEST_SCORE = 1e300
"""Largest limit of a score, so that it is finite."""


class ImportedTracker:
    """Imported tracks, reported frame by frame.

    A track begins with its first row among the frames that the tracker sees. It ends as ``lost`` in the first frame
    in which others have a row and it has none; later rows are a new track, since a lifetime counts consecutive frames.
    """

    def __init__(self, tracks: Tracks, notes: tuple[str, ...] = (), refine: Refinement = _AS_REPORTED) -> None:
        self.notes = notes
        self._tracks = tracks
        self._refiner = refine.refiner()
        self._image: Frame | None = None
        self._features = Features.begin(0, np.empty((0, 2)))
        self._names = np.empty(0, dtype=np.int64)
        self._next_id = 0

    @property
    def points(self) -> StatedPoints | None:
        """See `tracknoise.trackers.tracker.PointTracker`; None where positions are refined."""
        return self._tracks.points if self._refiner is None else None

    def names_of(self, ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """What the file calls features that are alive, (n,) by their ids."""
        order = np.argsort(self._features.ids)
        return self._names[order[np.searchsorted(self._features.ids, ids, sorter=order)]]

    def rows_of(self, index: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Names (n,) of the tracks in a frame, ascending, and their positions (n, 2), px."""
        start, stop = np.searchsorted(self._tracks.frame, [index, index + 1])
        return self._tracks.track[start:stop], self._tracks.uv[start:stop]

    def step(self, frame: Frame) -> Step:
        """Report the rows of a frame."""
        if frame.index in self._tracks.silent:
            return self._unchanged()
        start, stop = np.searchsorted(self._tracks.frame, [frame.index, frame.index + 1])
        names, uv = self._tracks.track[start:stop], self._tracks.uv[start:stop]
        before = self._features
        _, live, row = np.intersect1d(self._names, names, assume_unique=True, return_indices=True)
        row = row[np.argsort(live)]
        end = np.full(len(before), TrackEnd.lost, dtype=np.int8)
        end[live] = ALIVE
        first = np.delete(np.arange(len(names)), row)
        refined_uv, quality = self._refined(
            frame, before.chosen(np.sort(live), before.uv[np.sort(live)]), uv[row], len(first)
        )
        tracked, new = before.chosen(np.sort(live), refined_uv), Features.begin(self._next_id, uv[first])
        self._features = tracked.joined(new)
        self._names = names[np.concatenate([row, first])]
        self._next_id += len(new)
        shown = start + np.concatenate([row, first])
        return report(
            offered=before.ids,
            end=end,
            matched=len(row),
            found=tracked,
            new=new,
            response=self._tracks.response[start:stop][first],
            quality={name: values[shown] for name, values in self._tracks.quality.items()} | quality,
        )

    def _unchanged(self) -> Step:
        """The report of a frame of which nothing is known: all features stay alive, and none is observed."""
        nothing = Features.begin(self._next_id, np.empty((0, 2)))
        return report(
            offered=self._features.ids,
            end=np.full(len(self._features), ALIVE, dtype=np.int8),
            matched=0,
            found=nothing,
            new=nothing,
            response=np.empty(0, dtype=np.float32),
            missed=len(self._features),
        )

    def _refined(
        self, frame: Frame, tracked: Features, uv: NDArray[np.float64], n_new: int
    ) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float32]]]:
        """Positions of features that were found again, and the quality of these and of new ones."""
        before, self._image = self._image, None if self._refiner is None else frame
        if self._refiner is None:
            return uv, {}
        shift = np.empty(0, dtype=np.float32)
        if before is not None:
            uv, shift = self._refiner.refined(before, frame, tracked, uv)
        return uv, {SHIFT: np.concatenate([shift, np.full(n_new, np.nan, dtype=np.float32)])}


_PLACE = Path("imported arrays")


@dataclass(frozen=True, slots=True, eq=False)
class ImportedArrays:
    """Tracks in memory as settings of a tracker. `Imported.from_arrays` makes them.

    Parameters
    ----------
    rows
        Observations with frames.
    units
        What their positions are.
    refine
        Whether positions are refined by Lucas-Kanade.
    """

    kind: ClassVar[str] = "imported"
    description: ClassVar[str] = "tracks of another front end, in memory"
    reports_causes: ClassVar[bool] = False
    begins_anywhere: ClassVar[bool] = True

    rows: Rows
    units: Units = Units.pixels
    refine: Refinement = _AS_REPORTED

    @classmethod
    def of(
        cls,
        track: ArrayLike,
        frame: ArrayLike,
        u_px: ArrayLike,
        v_px: ArrayLike,
        *,
        response: ArrayLike | None = None,
        quality: Mapping[str, ArrayLike] | None = None,
        units: str = Units.pixels,
        refine: Refinement = _AS_REPORTED,
    ) -> "ImportedArrays":
        """Make settings of arrays with one element per observation, in any order.

        Parameters
        ----------
        track, frame
            (n,) whole numbers: the track, and the index of the frame in the sequence, from 0.
        u_px, v_px
            (n,) finite numbers: the position; an integer is the centre of a pixel. With normalised units, x/z and y/z
            in the frame of the camera, without distortion.
        response
            (n,): response of the detector; NaN where unknown.
        quality
            (n,) each, by name: what the front end states about each observation; NaN where unknown.
        units
            ``pixels`` or ``normalised``.
        refine
            Whether positions are refined by Lucas-Kanade.

        Raises
        ------
        SettingsError
            If an array has another length or type, an element is not finite, or the units are unknown.
        """
        if units not in tuple(Units):
            raise SettingsError(f"imported arrays: units {units!r}, expected one of {', '.join(Units)}")
        tracks = _whole("track", track)
        uv = np.column_stack([_finite("u_px", u_px, len(tracks)), _finite("v_px", v_px, len(tracks))])
        if not len(tracks):
            raise SettingsError("imported arrays: found no observation, expected at least one")
        _require_named(quality)
        rows = Rows(
            _PLACE,
            tracks,
            uv,
            frame=_whole("frame", frame, len(tracks), most=LARGEST),
            line=np.arange(len(tracks)),
            has_lines=False,
            response=None if response is None else _narrow("response", response, len(tracks)),
            quality={name: _narrow(f"quality {name}", values, len(tracks)) for name, values in (quality or {}).items()},
        )
        return cls(rows, Units(units), refine)

    def start(self, context: SequenceContext) -> ImportedTracker:
        """Report the tracks in one sequence at one speed.

        Raises
        ------
        DataError
            If a frame is not in the sequence, a track has two observations in one frame, or positions have other units.
        """
        raster = Normalised() if self.units is Units.normalised else Raster(PixelOrigin.centre)
        tracks, notes = Assignment(raster).tracks(self.rows, context)
        return ImportedTracker(tracks, notes + _subsampled(tracks, context), self.refine)


def _require_named(quality: object) -> None:
    if not isinstance(quality, Mapping | None):
        found = f"quality of type {type(quality).__name__}"
        raise SettingsError(f"imported arrays: found {found}, expected a dictionary of arrays")
    for name in quality or {}:
        if not is_quality_name(name):
            raise SettingsError(f"imported arrays: found quality {name!r}, expected a name such as 'residual'")


def _numbers(name: str, values: ArrayLike, length: int | None = None) -> NDArray[np.float64]:
    array = _array(name, values)
    if array.dtype.kind not in "fiu":
        raise SettingsError(f"imported arrays: {name} is of type {array.dtype}, expected numbers")
    if array.ndim != 1 or length not in (None, len(array)):
        expected = "one axis" if length is None else f"shape ({length},) as track"
        raise SettingsError(f"imported arrays: {name} has shape {array.shape}, expected {expected}")
    with np.errstate(over="ignore"):  # of long doubles
        return array.astype(np.float64)


def _narrow(name: str, values: ArrayLike, length: int) -> NDArray[np.float32]:
    numbers = _numbers(name, values, length)
    _refuse(name, numbers, np.isfinite(numbers) & (np.abs(numbers) > np.finfo(np.float32).max), IN_FLOAT32)
    return numbers.astype(np.float32)


def _refuse(name: str, values: NDArray[Any], bad: NDArray[np.bool_], expected: str) -> None:
    rows = np.flatnonzero(bad)
    if len(rows):
        raise SettingsError(f"imported arrays: {name}[{rows[0]}] is {values[rows[0]]}, expected {expected}")


def _array(name: str, values: ArrayLike) -> NDArray[Any]:
    if np.ma.is_masked(values):
        raise SettingsError(f"imported arrays: {name} has masked elements, expected an array without them")
    try:
        return np.asarray(values)
    except (TypeError, ValueError) as error:
        raise SettingsError(f"imported arrays: {name} is no array ({first_line(error)}), expected numbers") from error


def _finite(name: str, values: ArrayLike, length: int | None = None) -> NDArray[np.float64]:
    numbers = _numbers(name, values, length)
    _refuse(name, numbers, ~np.isfinite(numbers), "a finite number")
    return numbers


def _whole(name: str, values: ArrayLike, length: int | None = None, *, most: float = np.inf) -> NDArray[np.int64]:
    numbers, array = _finite(name, values, length), np.asarray(values)
    _refuse(name, numbers, numbers != np.rint(numbers), "a whole number")
    if array.dtype.kind == "f":
        _refuse(name, numbers, np.abs(numbers) > LARGEST_EXACT, "integers where numbers are so large")
    _refuse(name, array, array > most, f"a whole number of at most {most}")
    return array.astype(np.int64)


_MOST_SKIPPED = 10**9
"""Frames before the first one of a file, at most."""


@dataclass(frozen=True, slots=True)
class Imported:
    """Settings of imported tracks. `docs/your-tracks.md` describes the formats.

    Parameters
    ----------
    path
        A file of tracks. ``{dataset}``, ``{scene}``, ``{lighting}``, ``{rotation}``, ``{direction}``, ``{camera}`` and
        ``{speed}`` in the path are replaced by those of the condition.
    format
        Its format; by default what its name and beginning show.
    first_frame
        Number that the file gives the first frame of the sequence: 1 if it counts frames from 1; negative if the file
        begins later than the sequence and still counts from 0.
    columns
        What the two numbers of a position are: ``u v``, u to the right and v down; ``v u`` if they are swapped,
        ``u -v`` if v goes up, ``-u v`` if u goes to the left.
    units
        What positions are: ``pixels``, or ``normalised``, which are x/z and y/z in the frame of the camera, without
        distortion. The camera of the sequence, with its distortion, turns the latter into pixels.
    origin
        What the position (0, 0) is: the ``centre`` of the first pixel, or its ``corner``. Default: corner for COLMAP,
        centre for others.
    raster
        (width, height) of the images in the units of the file, such as [256, 256] for tracks of resized images, or
        [1, 1] for positions from 0 to 1. Default: their size in px.
    time_offset_s
        Added to the times of the file to get those of the sequence, seconds.
    max_gap_s
        With times: largest distance between a row and its frame, seconds. For events: between two rows with a frame
        between them. Default: half of the median time between frames; for events one and a half of it.
    topic
        Of a bag: the topic that has the tracks. Default: the only one that may have some.
    camera
        Number or name of the camera whose observations are read, where a file has those of several.
    visible_above
        Rows are observations where a score, such as the column ``confidence``, is larger.
    time_unit
        Unit of times whose column does not name it: ``s``, ``ms``, ``us`` or ``ns``. Default: seconds, and nanoseconds
        for whole numbers of 15 digits or more.
    frames_by
        What shows the frame where a file has several that contradict each other: ``frame``, ``time`` or ``image``.
    ids
        What ids name: ``tracks``, or ``slots`` of an array. In a slot a new track begins where the position jumps.
    refine
        Whether positions are refined by Lucas-Kanade: see `tracknoise.trackers.refinement.Refinement`.
    """

    kind: ClassVar[str] = "imported"
    description: ClassVar[str] = (
        "tracks that another front end wrote: CSV, Parquet, XIVO, event text, TAP, COLMAP, bags"
    )
    reports_causes: ClassVar[bool] = False
    begins_anywhere: ClassVar[bool] = True

    path: PathTemplate
    _: KW_ONLY
    format: TrackFormat | None = None
    first_frame: Annotated[int, Ge(-_MOST_SKIPPED)] = 0
    columns: Columns = Columns.uv
    units: Units = Units.pixels
    origin: PixelOrigin | None = None
    raster: tuple[Positive, Positive] | None = None
    time_offset_s: Annotated[float, Ge(-LARGEST_OFFSET_S), Le(LARGEST_OFFSET_S)] = 0.0
    max_gap_s: Positive | None = None
    topic: str | None = None
    camera: int | str | None = None
    visible_above: Annotated[float, Ge(-LARGEST_SCORE), Le(LARGEST_SCORE)] | None = None
    time_unit: TimeUnit | None = None
    frames_by: Moment | None = None
    ids: Ids = Ids.tracks
    refine: Refinement = field(default_factory=Refinement)

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", str(self.path))
        optional = {"format": TrackFormat, "origin": PixelOrigin, "time_unit": TimeUnit, "frames_by": Moment}
        stated = {name: kind for name, kind in optional.items() if getattr(self, name) is not None}
        settle_members(self, units=Units, columns=Columns, ids=Ids, **stated)
        try:
            SequenceId("", "").expand(self.path, speed=1)
            is_valid = True
        except ValueError:
            is_valid = False
        require(is_valid, "path", self.path, f"no placeholders but {', '.join(f'{{{name}}}' for name in PLACEHOLDERS)}")
        endings = f"a file that ends in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}, or a format"
        require(self.format is not None or Path(self.path).suffix in SUFFIXES, "path", self.path, endings)
        require_bounds(self)
        if self.units == Units.normalised:
            for name in ("origin", "raster"):
                value = getattr(self, name)
                require(value is None, name, value, f"none with units = {self.units}: (0, 0) is the optical axis")

    @staticmethod
    def from_arrays(
        track: ArrayLike,
        frame: ArrayLike,
        u_px: ArrayLike,
        v_px: ArrayLike,
        *,
        response: ArrayLike | None = None,
        quality: dict[str, ArrayLike] | None = None,
        units: str = Units.pixels,
        refine: Refinement = _AS_REPORTED,
    ) -> ImportedArrays:
        """Tracks that are in memory: see `ImportedArrays.of`."""
        return ImportedArrays.of(
            track, frame, u_px, v_px, response=response, quality=quality, units=units, refine=refine
        )

    def start(self, context: SequenceContext) -> ImportedTracker:
        """Read the file of one sequence and speed.

        Raises
        ------
        SettingsError
            If the images are rotated or played backward, and the path does not say which file is of them.
        DataError
            If it is missing or damaged, holds no track, something that is not a number, a frame that the sequence does
            not have, or two rows for one track and frame. The error names the line.
        """
        self._require_files_of_views(context.sequence)
        path = context.sequence.expand(self.path, speed=context.speed)
        kind = self.format or detected(path)
        is_whole = context.source_frames is None
        chosen = Selection(self.topic, self.camera, self.visible_above, self.time_unit, self.frames_by)
        rows = read_rows(path, kind, n_frames=context.n_frames if is_whole else None, chosen=chosen)
        assignment = Assignment(
            Normalised() if self.units == Units.normalised else Raster(self.origin or origin_of(kind), self.raster),
            self.first_frame,
            self.time_offset_s,
            self.max_gap_s,
            asynchronous=kind is TrackFormat.events,
            frames_by=self.frames_by,
            ids=self.ids,
            columns=self.columns,
        )
        tracks, notes = assignment.tracks(rows, context)
        of_speed = () if "{speed}" in self.path else _subsampled(tracks, context)
        return ImportedTracker(tracks, notes + of_speed, self.refine)

    def _require_files_of_views(self, sequence: SequenceId) -> None:
        """Refuse the file of upright, forward images for others: its positions and frames are not those of these."""
        views = {"rotation": sequence.rotation != 0, "direction": sequence.direction != Direction.forward}
        for name, differs in views.items():
            if differs and f"{{{name}}}" not in self.path:
                found = f"path {self.path!r} for {name} {getattr(sequence, name)}"
                raise SettingsError(f"imported: found {found}, expected {{{name}}} in it, and one file for each {name}")
