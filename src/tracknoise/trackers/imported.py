"""Imported tracks: what any other front end wrote to a file, or holds in memory."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from annotated_types import Ge, Le
from numpy.typing import ArrayLike

from tracknoise.checks import Positive, require, require_bounds
from tracknoise.exceptions import SettingsError
from tracknoise.options import PathTemplate
from tracknoise.tables.identity import PLACEHOLDERS, Direction, SequenceId
from tracknoise.trackers.imports.arrays import ImportedArrays
from tracknoise.trackers.imports.assign import Assignment
from tracknoise.trackers.imports.formats import SUFFIXES, TrackFormat, detected, origin_of, read_rows
from tracknoise.trackers.imports.normalised import Normalised
from tracknoise.trackers.imports.pixels import PixelOrigin, Raster, Units
from tracknoise.trackers.imports.replay import ImportedTracker, subsampled
from tracknoise.trackers.tracker import SequenceContext

_LARGEST_OFFSET_S = 4e9


@dataclass(frozen=True, slots=True)
class Imported:
    """Settings of imported tracks. `docs/imported-tracks.md` describes the formats.

    Parameters
    ----------
    path
        A file of tracks. ``{dataset}``, ``{scene}``, ``{lighting}``, ``{rotation}``, ``{direction}``, ``{camera}`` and
        ``{speed}`` in the path are replaced by those of the condition.
    format
        Its format; by default what its name and beginning show.
    first_frame
        Number that the file gives the first frame of the sequence: 1 if it counts frames from 1.
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
    """

    kind: ClassVar[str] = "imported"
    description: ClassVar[str] = "tracks that another front end wrote: CSV, Parquet, XIVO, event text, TAP, COLMAP"
    reports_causes: ClassVar[bool] = False

    path: PathTemplate
    _: KW_ONLY
    format: TrackFormat | None = None
    first_frame: Annotated[int, Ge(0)] = 0
    units: Units = Units.pixels
    origin: PixelOrigin | None = None
    raster: tuple[Positive, Positive] | None = None
    time_offset_s: Annotated[float, Ge(-_LARGEST_OFFSET_S), Le(_LARGEST_OFFSET_S)] = 0.0
    max_gap_s: Positive | None = None

    def __post_init__(self) -> None:
        try:
            SequenceId("", "").expand(self.path, speed=1)
            known = True
        except ValueError:
            known = False
        require(known, "path", self.path, f"no placeholders but {', '.join(f'{{{name}}}' for name in PLACEHOLDERS)}")
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
    ) -> ImportedArrays:
        """Tracks that are in memory: see `ImportedArrays.of`."""
        return ImportedArrays.of(track, frame, u_px, v_px, response=response, quality=quality, units=units)

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
        whole = context.source_frames is None
        rows = read_rows(path, kind, n_frames=context.n_frames if whole else None)
        assignment = Assignment(
            Normalised() if self.units == Units.normalised else Raster(self.origin or origin_of(kind), self.raster),
            self.first_frame,
            self.time_offset_s,
            self.max_gap_s,
            asynchronous=kind is TrackFormat.events,
        )
        tracks, notes = assignment.tracks(rows, context)
        return ImportedTracker(tracks, notes + subsampled(context, every_speed="{speed}" in self.path))

    def _require_files_of_views(self, sequence: SequenceId) -> None:
        """Refuse the file of upright, forward images for others: its positions and frames are not those of these."""
        views = {"rotation": sequence.rotation != 0, "direction": sequence.direction != Direction.forward}
        for name, differs in views.items():
            if differs and f"{{{name}}}" not in self.path:
                found = f"path {self.path!r} for {name} {getattr(sequence, name)}"
                raise SettingsError(f"imported: found {found}, expected {{{name}}} in it, and one file for each {name}")
