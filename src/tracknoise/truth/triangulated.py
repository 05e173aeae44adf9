"""Truth without depth: the point that fits a track best, from the known poses and the track itself.

It is self-referential: what a point can absorb, such as drift along the epipolar line, is not in its errors.

With a rolling shutter, a point is fitted with the poses of the observed rows; its true positions are those in its own.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.poses import require_some_poses
from tracknoise.sequences.row_poses import RowPoses
from tracknoise.sequences.sequence import TRIANGULATED, Sequence, camera_at
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.epipolar import epipolar_distances
from tracknoise.truth.observed_cameras import ObservedCameras
from tracknoise.truth.row_projection import project_by_rows
from tracknoise.truth.triangulation import LEAST_OBSERVATIONS, TrackViews, Triangulation, triangulate
from tracknoise.truth.truth import TruePositions


@dataclass(frozen=True, slots=True)
class Triangulated:
    """The point that fits a track best in all frames with a pose: (truth.triangulated).

    Tracks with fewer than three observations, or whose depth is unknown by
    `tracknoise.truth.triangulation.LEAST_PARALLAX`, have no true positions. All observations after the first have a
    distance from their epipolar line.
    """

    kind: ClassVar[str] = TRIANGULATED

    def open(self, sequence: Sequence) -> "TriangulatedTruth":
        """Make the truth of one sequence.

        Raises
        ------
        DataError
            If fewer than two frames have a pose.
        """
        require_some_poses(sequence.world_from_camera, sequence.source)
        return TriangulatedTruth(sequence)


@dataclass(frozen=True, slots=True, eq=False)
class TriangulatedTruth:
    """Triangulated truth of one sequence.

    Parameters
    ----------
    sequence
        The sequence.
    """

    kind: ClassVar[str] = TRIANGULATED
    key_frame: ClassVar[None] = None

    sequence: Sequence

    def start(self) -> "TriangulatedSession":
        """Start a session for one tracker setup."""
        return TriangulatedSession(self.sequence)


class TriangulatedSession:
    """The tracks of one tracker setup; points are fitted when all observations are known.

    Parameters
    ----------
    sequence
        The sequence.
    """

    __slots__ = ("_observed", "_sequence")

    def __init__(self, sequence: Sequence) -> None:
        self._sequence = sequence
        self._observed: list[tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64], NDArray[np.bool_]]] = []

    def observe(self, index: int, tracks: NDArray[np.uint32], uv: NDArray[np.float64], born: NDArray[np.bool_]) -> None:
        """Keep the observations of a frame: see `tracknoise.truth.truth.TruthSession.observe`."""
        self._observed.append((np.full(len(tracks), index, np.intp), tracks.astype(np.intp), uv, born))

    def resolve(self) -> TruePositions:
        """Fit the points, and project them: see `tracknoise.truth.truth.TruthSession.resolve`."""
        none = (np.empty(0, np.intp), np.empty(0, np.intp), np.empty((0, 2)), np.empty(0, np.bool_))
        frame, track, uv, born = (np.concatenate(parts) for parts in zip(none, *self._observed, strict=True))
        return _Observations(self._sequence, frame, track, uv, np.flatnonzero(born)).positions()


class _Observations:
    """All observations of a session; `births` are the rows in which tracks begin, in the order of their numbers."""

    def __init__(
        self,
        sequence: Sequence,
        frame: NDArray[np.intp],
        track: NDArray[np.intp],
        uv: NDArray[np.float64],
        births: NDArray[np.intp],
    ) -> None:
        self._frame, self._track, self._uv = frame, track, uv
        self._birth, self._n_tracks = births[track], len(births)
        self._sequence, rows = sequence, RowPoses(sequence)
        self._poses, self._rolling = rows.at(frame, uv), rows.rows
        self._cameras = ObservedCameras.of(sequence, frame)
        self._bearings = self._cameras.bearings(uv)
        known = np.asarray(rows.known[frame])
        self._posed = np.asarray(known & known[self._birth])

    def positions(self) -> TruePositions:
        """True positions where a point was found, and the distances from epipolar lines."""
        count = len(self._frame)
        uv, leverage = np.full((count, 2), np.nan), np.full((count, 2, 2), np.nan)
        depth_m = np.full(self._n_tracks, np.nan)
        status = np.where(self._posed, TruthStatus.no_depth, TruthStatus.no_pose).astype(np.int8)
        rows = self._long_tracks()
        if len(rows):
            found = triangulate(self._views(rows))
            tracks = np.unique(self._track[rows])
            uv[rows], leverage[rows] = self._in_own_rows(rows, tracks, found), found.leverage
            depth_m[tracks] = found.points[:, 2]
            inside = self._cameras.chosen(rows).contain(uv[rows])
            seen = np.where(inside, TruthStatus.valid, TruthStatus.out_of_image)
            status[rows] = np.where(np.isnan(uv[rows, 0]), status[rows], seen)
        return TruePositions(uv, status, depth_m, leverage=leverage, epipolar=self._epipolar())

    def _usable(self) -> NDArray[np.bool_]:
        """Observations that have a pose and a ray, as have the first ones of their tracks."""
        has_ray = np.asarray(~np.isnan(self._bearings).any(axis=1))
        return np.asarray(self._posed & has_ray & has_ray[self._birth])

    def _long_tracks(self) -> NDArray[np.intp]:
        """Rows of tracks with enough observations, in the order of tracks, then frames."""
        usable = np.flatnonzero(self._usable())
        number = np.bincount(self._track[usable], minlength=self._n_tracks)
        long = usable[number[self._track[usable]] >= LEAST_OBSERVATIONS]
        return long[np.argsort(self._track[long], kind="stable")]

    def _views(self, rows: NDArray[np.intp]) -> TrackViews:
        _, start, place = np.unique(self._track[rows], return_index=True, return_inverse=True)
        cameras = self._cameras.chosen(rows)
        return TrackViews(
            self._uv[rows], self._bearings[rows], self._from_first(rows), start, place.reshape(-1), cameras.project
        )

    def _in_own_rows(
        self, rows: NDArray[np.intp], tracks: NDArray[np.intp], found: Triangulation
    ) -> NDArray[np.float64]:
        """Positions of the points, (n, 2): with a rolling shutter, at the time of their own rows, not the observed."""
        if self._rolling is None:
            return found.uv
        first = self._birth[rows]
        points_world = transform(self._poses[first], found.points[np.searchsorted(tracks, self._track[rows])])
        uv = np.full((len(rows), 2), np.nan)
        for index in np.unique(self._frame[rows]).tolist():
            here = self._frame[rows] == index
            uv[here], _ = project_by_rows(self._rolling, camera_at(self._sequence, index), index, points_world[here])
        return uv

    def _from_first(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """(n, 4, 4) float64: pose of the first camera of the track in that of each observation."""
        return np.asarray(invert(self._poses[rows]) @ self._poses[self._birth[rows]])

    def _epipolar(self) -> NDArray[np.float64]:
        """(n, 2) float64: distances from epipolar lines and their variances; NaN in the first frame of a track."""
        found = np.full((len(self._frame), 2), np.nan)
        rows = np.flatnonzero(self._usable() & (self._birth != np.arange(len(self._frame))))
        first = self._birth[rows]
        here, there = self._cameras.chosen(rows), self._cameras.chosen(first)
        found[rows] = epipolar_distances(
            self._uv[rows], self._uv[first], here.bearings, there.bearings, self._from_first(rows)
        )
        return found
