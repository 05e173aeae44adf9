"""Imported tracks: what any other front end wrote to a file."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from tracknoise.checks import require
from tracknoise.options import PathTemplate
from tracknoise.tables.identity import PLACEHOLDERS, SequenceId
from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.features import ALIVE, Features, report
from tracknoise.trackers.frame import Frame
from tracknoise.trackers.track_file import Tracks, read_tracks
from tracknoise.trackers.tracker import SequenceContext, Step


@dataclass(frozen=True, slots=True)
class Imported:
    """Settings of imported tracks.

    Parameters
    ----------
    path
        A ``.csv`` file with a header, or a ``.parquet`` file, with columns ``track`` (a whole number), ``frame``
        (index in the nominal sequence, counted from 0), ``u_px`` and ``v_px`` (integer = pixel centre). Optional are
        ``response``, the detector response, and columns whose names start with ``quality_``, such as
        ``quality_confidence``: numbers that the front end states about each observation, which become columns of the
        same names in the table `observations`. Their cells may be empty. Other columns are ignored. The order of rows
        does not matter. ``{dataset}``, ``{scene}``, ``{lighting}``, ``{rotation}``, ``{direction}``, ``{camera}`` and
        ``{speed}`` in the path are replaced by those of the condition.
    """

    kind: ClassVar[str] = "imported"
    description: ClassVar[str] = "tracks that another front end wrote to a CSV or Parquet file"

    path: PathTemplate

    def __post_init__(self) -> None:
        try:
            SequenceId("", "").expand(self.path, speed=1)
            known = True
        except ValueError:
            known = False
        require(known, "path", self.path, f"no placeholders but {', '.join(f'{{{name}}}' for name in PLACEHOLDERS)}")
        suffix = Path(self.path).suffix
        require(suffix in (".csv", ".parquet"), "path", self.path, "a file that ends in .csv or .parquet")

    def start(self, context: SequenceContext) -> "ImportedTracker":
        """Read the file of one sequence and speed.

        Raises
        ------
        DataError
            If it is missing, lacks a column, holds no track, something that is not a number, a frame that the
            sequence does not have, or two rows for one track and frame. The error names the line.
        """
        path = context.sequence.expand(self.path, speed=context.speed)
        return ImportedTracker(read_tracks(path, n_frames=context.n_frames))


class ImportedTracker:
    """Imported tracks, reported frame by frame.

    A track begins with its first row among the frames that the tracker sees. It ends as ``lost`` in the first frame
    without a row; later rows are a new track, since a lifetime counts consecutive frames.

    Parameters
    ----------
    tracks
        All rows.
    """

    def __init__(self, tracks: Tracks) -> None:
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
