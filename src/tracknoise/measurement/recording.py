"""What one tracker at one speed reported over a sequence, kept as flat arrays."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import TrackerError
from tracknoise.tables.schema import TrackEnd, TruthStatus
from tracknoise.trackers.tracker import Step
from tracknoise.truth.truth import Truth

T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True, slots=True)
class Recording:
    """All observations of one condition, in the order of frames, with the anchors of their tracks.

    Attributes
    ----------
    track, frame : (n,) uint32
        Of each observation; tracks are numbered from 0 in the order of their birth.
    uv : (n, 2) float64
        Observed position, px.
    visibility : (n,) int8
        `TruthStatus` values of the track's true position in that frame; the anchor's status where it has no anchor.
    first_frame : (m,) uint32
        Of each track.
    found : (m,) uint32
        Count of frames in which the tracker found it, the first included.
    end : (m,) int8
        `TrackEnd` values.
    response : (m,) float32
        Detector response at birth; NaN where unknown.
    gradient_rad : (m,) float32
        Orientation of the dominant gradient at birth; NaN where none dominates.
    points_world : (m, 3) float64
        The anchored world point, metres; NaN where there is none.
    frames : (k, 6) uint32
        A row a frame: frame, offered, matched, outliers, new, alive.
    """

    track: NDArray[np.uint32]
    frame: NDArray[np.uint32]
    uv: NDArray[np.float64]
    visibility: NDArray[np.int8]
    first_frame: NDArray[np.uint32]
    found: NDArray[np.uint32]
    end: NDArray[np.int8]
    response: NDArray[np.float32]
    gradient_rad: NDArray[np.float32]
    points_world: NDArray[np.float64]
    frames: NDArray[np.uint32]


@dataclass(frozen=True, slots=True)
class _Births:
    """The tracks that began in a frame: their anchors, and what is known of the image there."""

    frame: int
    points: NDArray[np.float64]
    response: NDArray[np.float32]
    gradient_rad: NDArray[np.float32]


class Recorder:
    """Collects the steps of one condition; tracks get dense numbers in the order of their birth.

    A track is anchored at its birth; where truth is a scan, those that are found in the key frame are anchored then,
    and what was observed of them before is looked at again.
    """

    def __init__(self, truth: Truth) -> None:
        self._truth = truth
        self._live_ids: NDArray[np.int64] = np.empty(0, np.int64)  # sorted, so that it can be searched
        self._live_tracks: NDArray[np.int64] = np.empty(0, np.int64)
        self._live_points: NDArray[np.float64] = np.empty((0, 3))
        self._live_status: NDArray[np.int8] = np.empty(0, np.int8)
        self._n_tracks = 0
        self._births: list[_Births] = []
        self._fixed: tuple[NDArray[np.int64], NDArray[np.float64]] = np.empty(0, np.int64), np.empty((0, 3))
        self._ends: list[tuple[NDArray[np.int64], NDArray[np.int8]]] = []
        self._observations: list[tuple[int, NDArray[np.uint32], NDArray[np.float64], NDArray[np.int8]]] = []
        self._frames: list[tuple[int, ...]] = []

    def add(self, index: int, step: Step, *, gradient_rad: NDArray[np.float32]) -> None:
        """Record one step.

        Parameters
        ----------
        index
            Frame of the nominal sequence.
        step
            What the tracker reported.
        gradient_rad
            (n,) of the features born in this step, in its order: `tracknoise.trackers.gradient.dominant_gradient`.
        """
        self._end(step.ended_ids, step.ended)
        self._begin(index, step, gradient_rad)
        if index == self._truth.key_frame:
            self._fix(index, step)
        self._observe(index, step)
        self._frames.append((index, step.offered, step.matched, step.outliers, step.new, step.alive))

    def finish(self) -> Recording:
        """Everything recorded; tracks still alive end with the sequence."""
        end = np.full(self._n_tracks, TrackEnd.sequence_end, np.int8)
        for tracks, reasons in self._ends:
            end[tracks] = reasons
        counts = [len(tracks) for _, tracks, _, _ in self._observations]
        track = _concatenated([tracks for _, tracks, _, _ in self._observations], np.empty(0, np.uint32))
        births = self._births
        first_frame = np.array([born.frame for born in births], np.uint32)
        points_world = _concatenated([born.points for born in births], np.empty((0, 3)))
        points_world[self._fixed[0]] = self._fixed[1]
        return Recording(
            track=track,
            frame=np.repeat(np.array([index for index, _, _, _ in self._observations], np.uint32), counts),
            uv=_concatenated([uv for _, _, uv, _ in self._observations], np.empty((0, 2))),
            visibility=_concatenated([status for _, _, _, status in self._observations], np.empty(0, np.int8)),
            first_frame=np.repeat(first_frame, [len(born.points) for born in births]),
            found=np.bincount(track, minlength=self._n_tracks).astype(np.uint32),
            end=end,
            response=_concatenated([born.response for born in births], np.empty(0, np.float32)),
            gradient_rad=_concatenated([born.gradient_rad for born in births], np.empty(0, np.float32)),
            points_world=points_world,
            frames=np.array(self._frames, np.uint32).reshape(-1, 6),
        )

    def _end(self, ids: NDArray[np.int64], reasons: NDArray[np.int8]) -> None:
        slots = self._slots(ids)
        self._ends.append((self._live_tracks[slots], reasons))
        alive = np.ones(len(self._live_ids), dtype=bool)
        alive[slots] = False
        self._keep(alive)

    def _begin(self, index: int, step: Step, gradient_rad: NDArray[np.float32]) -> None:
        born = step.born
        points, status = self._anchored(index, step.uv[born])
        tracks = self._n_tracks + np.arange(len(points))
        self._n_tracks += len(points)
        self._births.append(_Births(index, points, step.response[born], gradient_rad))
        ids = np.concatenate([self._live_ids, step.ids[born]])
        order = np.argsort(ids, kind="stable")
        self._live_ids = ids[order]
        self._live_tracks = np.concatenate([self._live_tracks, tracks])[order]
        self._live_points = np.concatenate([self._live_points, points])[order]
        self._live_status = np.concatenate([self._live_status, status])[order]

    def _anchored(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
        if self._truth.key_frame is None:
            return self._truth.anchor(index, uv)
        return np.full((len(uv), 3), np.nan), np.full(len(uv), TruthStatus.no_depth, np.int8)

    def _fix(self, index: int, step: Step) -> None:
        """Anchor what is found in the key frame, and say of its earlier observations whether they could be seen."""
        slots = self._slots(step.ids)
        points, status = self._truth.anchor(index, step.uv)
        self._live_points[slots], self._live_status[slots] = points, status
        valid = status == TruthStatus.valid
        self._fixed = self._live_tracks[slots][valid], points[valid]
        row = np.full(self._n_tracks, -1)
        row[self._fixed[0]] = np.arange(len(self._fixed[0]))
        for earlier, tracks, _, seen in self._observations:
            found = row[tracks]
            seen[found >= 0] = self._truth.visibility(earlier, self._fixed[1][found[found >= 0]])

    def _observe(self, index: int, step: Step) -> None:
        slots = self._slots(step.ids)
        status = self._live_status[slots].copy()
        anchored = status == TruthStatus.valid
        status[anchored] = self._truth.visibility(index, self._live_points[slots[anchored]])
        self._observations.append((index, self._live_tracks[slots].astype(np.uint32), step.uv, status))

    def _slots(self, ids: NDArray[np.int64]) -> NDArray[np.intp]:
        """Where live features lie in the live arrays."""
        slots = np.searchsorted(self._live_ids, ids)
        known = np.isin(ids, self._live_ids, assume_unique=True)
        if not known.all():
            raise TrackerError(f"a tracker reported feature {ids[~known][0]}, which was never begun or has ended")
        return slots

    def _keep(self, alive: NDArray[np.bool_]) -> None:
        self._live_ids, self._live_tracks = self._live_ids[alive], self._live_tracks[alive]
        self._live_points, self._live_status = self._live_points[alive], self._live_status[alive]


def _concatenated(parts: list[NDArray[T]], empty: NDArray[T]) -> NDArray[T]:
    return np.concatenate([empty, *parts])
