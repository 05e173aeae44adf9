"""World points of the tracks of one tracker setup, and their true positions in each observed frame."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.sequence_geometry import SequenceGeometry
from tracknoise.truth.truth import TruePositions
from tracknoise.truth.visibility import Located

Locate = Callable[[int, NDArray[np.float64]], Located]
"""Takes a frame and world points (n, 3); returns their positions in the frame and whether they can be seen."""

_LEAST_CAPACITY = 1024
_ROUNDING_PX = 1e-6
"""A point that is projected this close to the pixel it was taken from lies on the ray of that pixel."""


class AnchoredTracks:
    """Tracks by number: each has a world point (NaN where unknown) and the status of that point.

    Parameters
    ----------
    geometry
        Of the sequence.
    locate
        Projects points into a frame.
    """

    __slots__ = ("_births", "_count", "_geometry", "_locate", "_located", "_points", "_status")

    def __init__(self, geometry: SequenceGeometry, locate: Locate) -> None:
        self._geometry, self._locate = geometry, locate
        self._count = 0
        self._points = np.empty((_LEAST_CAPACITY, 3))  # the first `_count` rows are in use
        self._status = np.empty(_LEAST_CAPACITY, np.int8)
        self._births: list[tuple[int, slice]] = []
        self._located: list[Located] = []

    def begin(self, index: int, points_world: NDArray[np.float64], status: NDArray[np.int8]) -> None:
        """Add tracks, (n, 3) world points and their status (n,), that begin in a frame."""
        rows = slice(self._count, self._count + len(status))
        self._count = rows.stop
        self._grow()
        self._points[rows], self._status[rows] = points_world, status
        self._births.append((index, rows))

    def anchor(self, tracks: NDArray[np.uint32], points_world: NDArray[np.float64], status: NDArray[np.int8]) -> None:
        """Give tracks that have begun other points."""
        self._points[tracks], self._status[tracks] = points_world, status

    def locate(self, index: int, tracks: NDArray[np.uint32], anchors_uv: NDArray[np.float64]) -> None:
        """Add the true positions of tracks observed in a frame.

        The error of a track is exactly 0 where its point was taken from its own ray, without the rounding of the way to
        the point and back.

        Parameters
        ----------
        index
            Frame.
        tracks
            (n,) uint32.
        anchors_uv
            (n, 2) float64: pixel of this frame from which the point of a track was taken, px; NaN where it was taken
            from another frame.
        """
        projected, seen = self._locate(index, self._points[tracks])
        on_ray = np.abs(projected - anchors_uv).max(axis=1) < _ROUNDING_PX
        uv = np.where(on_ray[:, np.newaxis], anchors_uv, projected)
        status = self._status[tracks]
        known = (status == TruthStatus.valid) | (seen == TruthStatus.no_pose)
        self._located.append((uv, np.where(known, seen, status)))

    def positions(self) -> TruePositions:
        """True positions in all frames, in the order in which they were located."""
        depth_m = [self._geometry.seen(index, self._points[rows])[1][:, 2] for index, rows in self._births]
        return TruePositions(
            uv=np.concatenate([np.empty((0, 2)), *(uv for uv, _ in self._located)]),
            status=np.concatenate([np.empty(0, np.int8), *(status for _, status in self._located)]),
            depth_m=np.concatenate([np.empty(0), *depth_m]),
        )

    def _grow(self) -> None:
        """Double the capacity where needed, so that adding tracks one by one takes linear time."""
        capacity = len(self._status)
        if self._count > capacity:
            more = max(self._count - capacity, capacity)
            self._points = np.concatenate([self._points, np.empty((more, 3))])
            self._status = np.concatenate([self._status, np.empty(more, np.int8)])
