"""From rows of a file to tracks in the frames of a sequence, with the mistakes that the rows show."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.trackers.imports.normalised import Normalised
from tracknoise.trackers.imports.pixels import NOTED_OUTSIDE, Raster, share_outside
from tracknoise.trackers.imports.rows import Rows, Tracks
from tracknoise.trackers.imports.times import in_seconds, interpolated, nearest_frames
from tracknoise.trackers.tracker import SequenceContext

NEAREST_GAP = 0.5
"""Largest distance between a row and its frame, as a share of the median time between frames."""
INTERPOLATED_GAP = 1.5
"""Largest distance between two rows with a frame between them, as such a share."""
_LEAST_FRAMES = 3
"""With fewer frames, a regular distance between them proves nothing."""


@dataclass(frozen=True, slots=True)
class Assignment:
    """How the rows of a file belong to the frames of a sequence.

    Parameters
    ----------
    raster
        Coordinates of positions.
    first_frame
        Number that the file gives the first frame of the sequence.
    time_offset_s
        Added to the times of the file to get those of the sequence, seconds.
    max_gap_s
        Largest distance between a row and its frame, or between two rows with a frame between them, seconds. Default:
        `NEAREST_GAP` or `INTERPOLATED_GAP` times the median time between frames.
    asynchronous
        Whether positions are interpolated at the times of frames. Otherwise each row belongs to the nearest frame.
    """

    raster: Raster | Normalised
    first_frame: int = 0
    time_offset_s: float = 0.0
    max_gap_s: float | None = None
    asynchronous: bool = False

    def tracks(self, rows: Rows, context: SequenceContext) -> tuple[Tracks, tuple[str, ...]]:
        """Tracks in the frames of a sequence, and what should be known about them, one sentence each.

        Raises
        ------
        DataError
            If coordinates are normalised or swapped, a frame is not in the sequence, the frames are only every k-th of
            those that the tracker sees, no time is that of a frame, or a track has two rows in a frame.
        """
        self.raster.check(rows, context)
        framed, left_out = self._framed(rows, context)
        framed, unseen = self._in_pixels(framed, context)
        frame, uv, quality = _frames(framed), framed.uv, framed.quality
        _require_steps(framed, frame, context.speed)
        order = np.lexsort([framed.track, frame])
        _require_one_each(framed, frame, order)
        unknown = np.full(len(order), np.nan, dtype=np.float32)
        tracks = Tracks(
            framed.track[order],
            frame[order],
            uv[order],
            unknown if framed.response is None else framed.response[order],
            {name: values[order] for name, values in quality.items()},
        )
        notes = _notes(rows, tracks, left_out, context, counted=rows.frame is not None)
        return tracks, (*_unseen_notes(unseen), *notes)

    def _in_pixels(self, rows: Rows, context: SequenceContext) -> tuple[Rows, NDArray[np.bool_]]:
        """Rows in pixels, covariances too; and which rows the camera has no image of: they are left out."""
        frame = _frames(rows)
        uv = self.raster.to_pixels(rows.uv, frame, context)
        quality = self.raster.covariances_to_pixels(rows.quality, rows.uv, frame, context)
        in_px = replace(rows, uv=uv, quality=quality)
        unseen = np.isnan(uv[:, 0]) | np.isnan(uv[:, 1])
        kept = np.flatnonzero(~unseen)
        return in_px.chosen(kept, frame[kept], uv[kept]) if unseen.any() else in_px, unseen

    def _framed(self, rows: Rows, context: SequenceContext) -> tuple[Rows, int]:
        """Rows with frames, and how many rows belong to none."""
        if rows.frame is not None:
            return self._numbered(rows, rows.frame, context), 0
        if context.timestamps_s is None:
            expected = "frame numbers, because the times of the sequence's frames are unknown"
            raise DataError(rows.path, "times", expected)
        assign = interpolated if self.asynchronous else nearest_frames
        limit = self._largest_gap_s(context.timestamps_s, context.source_frames)
        framed, left_out = assign(in_seconds(rows, self.time_offset_s), context.timestamps_s, limit)
        return framed, 0 if context.source_frames else left_out

    def _largest_gap_s(self, frames_s: NDArray[np.float64], source: range | None) -> float:
        """By default a share of the median time between frames of the recording."""
        if self.max_gap_s is not None:
            return self.max_gap_s
        interval = float(np.median(np.diff(frames_s))) / (source.step if source else 1)
        return (INTERPOLATED_GAP if self.asynchronous else NEAREST_GAP) * interval

    def _numbered(self, rows: Rows, frame: NDArray[np.int64], context: SequenceContext) -> Rows:
        """Rows whose frames count from the first of the sequence. Frames of a recording that were not chosen go."""
        if context.source_frames is not None:
            return _chosen(rows, frame - self.first_frame, context.source_frames)
        n_frames = context.n_frames
        first, last = self.first_frame, self.first_frame + n_frames - 1
        expected = f"a frame from {first} to {last} of the sequence"
        if first == 0 and frame.min() == 1 and frame.max() == n_frames:
            expected += "; frames are counted from 1: set first_frame = 1"
        rows.refuse((frame < first) | (frame > last), "frame", frame, expected)
        return replace(rows, frame=frame - first)


def _chosen(rows: Rows, frame: NDArray[np.int64], source: range) -> Rows:
    """The rows in frames of a recording that were chosen, with their numbers among these."""
    place, skipped = np.divmod(frame - source.start, source.step)
    kept = np.flatnonzero((skipped == 0) & (place >= 0) & (place < len(source)))
    if not len(kept):
        found = f"frames from {frame.min()} to {frame.max()}"
        raise DataError(rows.path, found, f"some of the chosen frames, {source[0]} to {source[-1]} of the recording")
    return rows.chosen(kept, place[kept], rows.uv[kept])


def _frames(rows: Rows) -> NDArray[np.int64]:
    assert rows.frame is not None, "rows have frames"
    return rows.frame


def _require_steps(rows: Rows, frame: NDArray[np.int64], speed: int) -> None:
    """Refuse frames of which only every k-th has rows, unless the tracker sees no others."""
    present = np.unique(frame)
    if len(present) < _LEAST_FRAMES:
        return
    step = int(np.gcd.reduce(np.diff(present)))
    if step > 1 and (speed % step or present[0] % step):
        found = f"rows in one of {step} frames only: {', '.join(map(str, present[:3]))}, ..."
        expected = f"rows in consecutive frames that are seen at speed {speed}; for such tracks set speeds = [{step}]"
        raise DataError(rows.path, found, expected)


def _require_one_each(rows: Rows, frame: NDArray[np.int64], order: NDArray[np.intp]) -> None:
    again = (np.diff(frame[order]) == 0) & (np.diff(rows.track[order]) == 0)
    twice = np.zeros(len(order), dtype=np.bool_)
    twice[order[1:][again]] = True
    rows.refuse(twice, "track", rows.track, "one row for each track and frame")


def _unseen_notes(unseen: NDArray[np.bool_]) -> Iterator[str]:
    if unseen.any():
        yield f"{unseen.mean():.1%} of imported positions have no image in the camera, and were left out"


def _notes(rows: Rows, tracks: Tracks, left_out: int, context: SequenceContext, *, counted: bool) -> Iterator[str]:
    outside = share_outside(tracks.uv, context.size)
    if outside >= NOTED_OUTSIDE:
        yield f"{outside:.1%} of imported positions are outside the image"
    if left_out:
        share = left_out / len(rows.track)
        yield f"{share:.1%} of imported rows are too far in time from every frame, and were left out"
    if len(tracks.track) > 1 and len(np.unique(tracks.track)) == len(tracks.track):
        yield "each imported track has one row alone, so that no error is seen: does its column name tracks, or rows?"
    if counted and tracks.frame.min() == 1:
        yield "imported tracks have no row in frame 0: if their frames are counted from 1, set first_frame = 1"
