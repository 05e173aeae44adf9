"""What one tracker at one speed reported over a sequence, as flat arrays."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import TrackerError
from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.tracker import Step, check_quality, check_step

T = TypeVar("T", bound=np.generic)

Quality = Mapping[str, NDArray[np.float32]]
Orientation = Callable[[NDArray[np.float64]], NDArray[np.float32]]
"""Orientation of the dominant gradient, (n,) rad, at positions (n, 2) in a frame; NaN where none dominates."""


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """All observations of one tracker at one speed, in the order of frames."""

    # track, frame: (n,): of each observation; tracks are numbered from 0 in the order of their birth
    track: NDArray[np.uint32]
    frame: NDArray[np.uint32]
    uv: NDArray[np.float64]  # (n, 2): observed position, px
    quality: Quality  # (n,): what the tracker reported about each observation, by name; NaN where unknown
    first_frame: NDArray[np.uint32]  # (m,): of each track
    found: NDArray[np.uint32]  # (m,): number of frames in which the tracker found it, including the first
    end: NDArray[np.int8]  # (m,): `TrackEnd` values
    response: NDArray[np.float32]  # (m,): detector response at birth; NaN where unknown
    gradient_rad: NDArray[np.float32]  # (m,): orientation of the dominant gradient at birth; NaN where none dominates
    frames: NDArray[np.uint32]  # (k, 6): one row per frame: frame, offered, matched, outliers, new, alive
    first_uv: NDArray[np.float64] | None = None  # (n, 2): see `Step.first_uv`


@dataclass(frozen=True, slots=True)
class _Births:
    """The tracks that began in a frame: the response of the detector, and the gradient of the image."""

    frame: int
    response: NDArray[np.float32]
    gradient_rad: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class _Observed:
    """The observations in a frame."""

    frame: int
    track: NDArray[np.uint32]
    uv: NDArray[np.float64]
    quality: Quality
    first_uv: NDArray[np.float64] | None


class Recorder:
    """Collects the steps of one tracker at one speed, and numbers the tracks without gaps as they begin."""

    def __init__(self) -> None:
        self._live_ids: NDArray[np.int64] = np.empty(0, np.int64)  # sorted, so that it can be searched
        self._live_tracks: NDArray[np.int64] = np.empty(0, np.int64)
        self._n_tracks = 0
        self._births: list[_Births] = []
        self._ends: list[tuple[NDArray[np.int64], NDArray[np.int8]]] = []
        self._observed: list[_Observed] = []
        self._frames: list[tuple[int, ...]] = []

    def add(self, index: int, step: Step, *, gradient_rad: Orientation) -> NDArray[np.uint32]:
        """Record one step. Returns: numbers of the tracks observed in this step, in its order."""
        _require_step(step)
        check_quality(step.quality, len(step.ids))
        check_step(step, self._live_ids)
        self._end(step.ended_ids, step.ended)
        self._begin(index, step, gradient_rad(step.uv[step.born]))
        tracks = self._live_tracks[self._slots(step.ids)].astype(np.uint32)
        self._observed.append(_Observed(index, tracks, step.uv, step.quality, step.first_uv))
        self._frames.append((index, step.offered, step.matched, step.outliers, step.new, step.alive))
        return tracks

    def finish(self) -> Recording:
        """Everything recorded; tracks still alive end with the sequence."""
        end = np.full(self._n_tracks, TrackEnd.sequence_end, np.int8)
        for tracks, reasons in self._ends:
            end[tracks] = reasons
        observed, births = self._observed, self._births
        first_uv = [step.first_uv for step in observed if step.first_uv is not None]
        track = _concatenated([step.track for step in observed], np.empty(0, np.uint32))
        return Recording(
            track=track,
            frame=_repeated([step.frame for step in observed], [len(step.track) for step in observed]),
            uv=_concatenated([step.uv for step in observed], np.empty((0, 2))),
            quality=_joined_quality(observed),
            first_frame=_repeated([born.frame for born in births], [len(born.response) for born in births]),
            found=np.bincount(track, minlength=self._n_tracks).astype(np.uint32),
            end=end,
            response=_concatenated([born.response for born in births], np.empty(0, np.float32)),
            gradient_rad=_concatenated([born.gradient_rad for born in births], np.empty(0, np.float32)),
            frames=np.array(self._frames, np.uint32).reshape(-1, 6),
            first_uv=_concatenated(first_uv, np.empty((0, 2))) if first_uv else None,
        )

    def _end(self, ids: NDArray[np.int64], reasons: NDArray[np.int8]) -> None:
        slots = self._slots(ids)
        self._ends.append((self._live_tracks[slots], reasons))
        alive = np.ones(len(self._live_ids), dtype=bool)
        alive[slots] = False
        self._live_ids, self._live_tracks = self._live_ids[alive], self._live_tracks[alive]

    def _begin(self, index: int, step: Step, gradient_rad: NDArray[np.float32]) -> None:
        tracks = self._n_tracks + np.arange(step.new)
        self._n_tracks += step.new
        self._births.append(_Births(index, step.response[step.born], gradient_rad))
        ids = np.concatenate([self._live_ids, step.ids[step.born]])
        order = np.argsort(ids, kind="stable")
        self._live_ids = ids[order]
        self._live_tracks = np.concatenate([self._live_tracks, tracks])[order]

    def _slots(self, ids: NDArray[np.int64]) -> NDArray[np.intp]:
        """Rows of live features in the live arrays."""
        return np.searchsorted(self._live_ids, ids)


def _require_step(reported: object) -> None:
    if not isinstance(reported, Step):
        raise TrackerError(f"a tracker reported a value of type {type(reported).__name__}, expected a Step")


def _joined_quality(observed: list[_Observed]) -> Quality:
    """Quality of all observations, in alphabetical order of names; NaN in steps that do not have a name."""
    names = sorted({name for step in observed for name in step.quality})
    return {
        name: np.concatenate([step.quality.get(name, _unknown(len(step.track))) for step in observed]) for name in names
    }


def _unknown(count: int) -> NDArray[np.float32]:
    return np.full(count, np.nan, np.float32)


def _repeated(frames: list[int], counts: list[int]) -> NDArray[np.uint32]:
    return np.repeat(np.array(frames, np.uint32), counts)


def _concatenated(parts: list[NDArray[T]], empty: NDArray[T]) -> NDArray[T]:
    return np.concatenate([empty, *parts])
