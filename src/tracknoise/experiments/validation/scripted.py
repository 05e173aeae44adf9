"""Tracks that are written down in advance, and the tracker that reports them.

A script holds what the package must find: the true position, its visibility and the age of each observation, and why
each track ended. The tracker reports observed positions and ends alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.frame import Frame
from tracknoise.trackers.tracker import SequenceContext, Step

Array = NDArray[np.float64]


UNKNOWN = ""
"""End of a track whose cause is not reported."""


@dataclass(frozen=True, slots=True, eq=False)
class Script:
    """All tracks of one tracker at one speed on one sequence, in the order of their birth.

    The steps are the frames that the tracker sees: 0, speed, 2 speed, ... Every array by step has all steps, and
    `alive` says which of them a track has.

    Attributes
    ----------
    frames : (steps,) int64
        Frame of each step.
    alive : (tracks, steps) bool
        Whether the track is observed.
    true_px, error_px : (tracks, steps, 2) float64
        True position, and observed minus true position.
    status : (tracks, steps) <U16
        Names of `tracknoise.tables.schema.TruthStatus`.
    end : (tracks,) <U16
        Names of `TrackEnd`; `UNKNOWN` where the tracker does not report causes.
    depth_m : (tracks,) float64
        Depth of the point in the first frame of the track; NaN where it has no true position.
    zero_frame : (tracks,) int64
        Frame in which the error is zero because the true position is fixed there.
    """

    frames: NDArray[np.int64]
    alive: NDArray[np.bool_]
    true_px: Array
    error_px: Array
    status: NDArray[np.str_]
    end: NDArray[np.str_]
    depth_m: Array
    zero_frame: NDArray[np.int64]

    @property
    def birth(self) -> NDArray[np.intp]:
        """(tracks,) step in which each track begins."""
        first: NDArray[np.intp] = self.alive.argmax(axis=1)
        return first

    @property
    def observed_px(self) -> Array:
        """(tracks, steps, 2) what the tracker reports."""
        return self.true_px + self.error_px


@dataclass(frozen=True, slots=True)
class Scripted:
    """Settings of the tracker that reports scripts.

    Parameters
    ----------
    scripts
        By key of the sequence (`tracknoise.tables.identity.SequenceId.key`) and speed.
    """

    kind: ClassVar[str] = "scripted"
    description: ClassVar[str] = "tracks that are known in advance"

    scripts: Mapping[tuple[str, int], Script] = field(repr=False)

    def start(self, context: SequenceContext) -> "ScriptedTracker":
        """Start on one sequence at one speed."""
        return ScriptedTracker(self.scripts[context.sequence.key, context.speed])


class ScriptedTracker:
    """Reports the tracks of one script."""

    def __init__(self, script: Script) -> None:
        self._script = script
        self._observed_px = script.observed_px
        self._ends = np.array([TrackEnd[name] for name in script.end], dtype=np.int8)

    def step(self, frame: Frame) -> Step:
        """Report one frame."""
        step = int(np.searchsorted(self._script.frames, frame.index))
        before = self._script.alive[:, step - 1] if step else np.zeros(len(self._ends), dtype=bool)
        now = self._script.alive[:, step]
        ended = np.flatnonzero(before & ~now)
        outliers = int(np.count_nonzero(self._ends[ended] == TrackEnd.outlier))
        seen = np.flatnonzero(now)
        return Step(
            ids=seen,
            uv=self._observed_px[seen, step],
            born=~before[seen],
            response=np.full(len(seen), np.nan, dtype=np.float32),
            ended_ids=ended,
            ended=self._ends[ended],
            offered=int(before.sum()),
            matched=int((before & now).sum()) + outliers,
            outliers=outliers,
            alive=len(seen),
        )
