"""Imported tracks, reported frame by frame as a tracker does."""

import numpy as np

from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.features import ALIVE, Features, report
from tracknoise.trackers.frame import Frame
from tracknoise.trackers.imports.rows import Tracks
from tracknoise.trackers.tracker import SequenceContext, Step


def subsampled(context: SequenceContext, *, every_speed: bool) -> tuple[str, ...]:
    """A note if the tracks were not made at the speed at which they are measured.

    Parameters
    ----------
    context
        The sequence and speed.
    every_speed
        Whether each speed has its own tracks.
    """
    if context.speed == 1 or every_speed:
        return ()
    note = "imported tracks are those of speed 1, subsampled: what a tracker does at this speed is not measured"
    return (f"at speed {context.speed}, {note}",)


class ImportedTracker:
    """Imported tracks, reported frame by frame.

    A track begins with its first row among the frames that the tracker sees. It ends as ``lost`` in the first frame
    without a row; later rows are a new track, since a lifetime counts consecutive frames.

    Parameters
    ----------
    tracks
        All rows.
    notes
        What should be known about them, one sentence each.
    """

    def __init__(self, tracks: Tracks, notes: tuple[str, ...] = ()) -> None:
        self.notes = notes
        self._tracks = tracks
        self._features = Features.begin(0, np.empty((0, 2)))
        self._names = np.empty(0, dtype=np.int64)
        self._next_id = 0

    def step(self, frame: Frame) -> Step:
        """Report the rows of a frame."""
        start, stop = np.searchsorted(self._tracks.frame, [frame.index, frame.index + 1])
        names, uv = self._tracks.track[start:stop], self._tracks.uv[start:stop]
        before = self._features
        _, live, row = np.intersect1d(self._names, names, assume_unique=True, return_indices=True)
        row = row[np.argsort(live)]
        end = np.full(len(before), TrackEnd.lost, dtype=np.int8)
        end[live] = ALIVE
        first = np.delete(np.arange(len(names)), row)
        found, new = before.chosen(np.sort(live), uv[row]), Features.begin(self._next_id, uv[first])
        self._features = found.joined(new)
        self._names = names[np.concatenate([row, first])]
        self._next_id += len(new)
        shown = start + np.concatenate([row, first])
        return report(
            offered=before.ids,
            end=end,
            matched=len(row),
            found=found,
            new=new,
            response=self._tracks.response[start:stop][first],
            quality={name: values[shown] for name, values in self._tracks.quality.items()},
        )
