"""One pass over the images of sequences that drives every tracker at every speed."""

from collections.abc import Callable
from collections.abc import Sequence as Items
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.measurement.recording import Recorder, Recording
from tracknoise.sequences.sequence import Sequence
from tracknoise.trackers.frame import Frame
from tracknoise.trackers.gradient import dominant_gradient
from tracknoise.trackers.tracker import SequenceContext, Tracker, TrackerSettings
from tracknoise.truth.truth import Truth

Progress = Callable[[int, int], None]
"""Called with the count of frames done and of all."""


@dataclass(frozen=True, slots=True)
class TrackerSetup:
    """A tracker at a speed.

    Parameters
    ----------
    tracker
        Its name in the tables.
    settings
        What starts it.
    speed
        It sees frames 0, speed, 2 speed, ... of the nominal sequence.
    """

    tracker: str
    settings: TrackerSettings
    speed: int


@dataclass(frozen=True, slots=True)
class TrackingResult:
    """What a pass over a sequence yields.

    Attributes
    ----------
    recordings
        One a condition, in the order given.
    snapshot_frame
        The frame kept to be drawn.
    snapshot : (height, width) uint8
        Its image.
    """

    recordings: list[Recording]
    snapshot_frame: int
    snapshot: NDArray[np.uint8]


def run_trackers(
    sequences: Items[Sequence],
    conditions: Items[TrackerSetup],
    truths: Items[Truth],
    *,
    n_frames: int,
    seed: int,
    progress: Progress | None = None,
) -> list[TrackingResult]:
    """Read each image once, in order, and step every condition that is due.

    Sequences go in step: each frame is read of all of them before the next, so that they can share what they read.

    Parameters
    ----------
    sequences
        The images.
    conditions
        Trackers and speeds.
    truths
        Of each sequence.
    n_frames
        How many of their frames to read, from the first.
    seed
        For trackers that need randomness.
    progress
        Told after each frame of all sequences.

    Returns
    -------
    list of TrackingResult
        One a sequence.

    Raises
    ------
    DataError
        If an image or depth map cannot be used.
    TrackerError
        If a tracker reports what it cannot have seen.
    """
    snapshot_frame = _snapshot_frame(n_frames, conditions, truths[0].key_frame)
    passes = [
        _Pass(sequence, conditions, truth, snapshot_frame=snapshot_frame, seed=seed)
        for sequence, truth in zip(sequences, truths, strict=True)
    ]
    for index in range(n_frames):
        for one in passes:
            one.step(index)
        if progress is not None:
            progress(index + 1, n_frames)
    return [one.finish() for one in passes]


class _Pass:
    """The trackers at work on one sequence."""

    def __init__(
        self, sequence: Sequence, conditions: Items[TrackerSetup], truth: Truth, *, snapshot_frame: int, seed: int
    ) -> None:
        self._sequence, self._conditions = sequence, conditions
        self._trackers = [_start(condition, sequence, truth, seed) for condition in conditions]
        self._recorders = [Recorder(truth) for _ in conditions]
        self._snapshot_frame = snapshot_frame
        self._snapshot: NDArray[np.uint8] = np.empty((0, 0), np.uint8)

    def step(self, index: int) -> None:
        """Read a frame and show it to every tracker that is due."""
        frame = Frame(index, self._sequence.image(index))
        for condition, tracker, recorder in zip(self._conditions, self._trackers, self._recorders, strict=True):
            if index % condition.speed == 0:
                step = tracker.step(frame)
                recorder.add(index, step, gradient_rad=dominant_gradient(frame, step.uv[step.born]))
        if index == self._snapshot_frame:
            self._snapshot = frame.image

    def finish(self) -> TrackingResult:
        """What was recorded."""
        return TrackingResult([recorder.finish() for recorder in self._recorders], self._snapshot_frame, self._snapshot)


def _start(condition: TrackerSetup, sequence: Sequence, truth: Truth, seed: int) -> Tracker:
    return condition.settings.start(
        SequenceContext(
            sequence=sequence.id,
            size=(sequence.camera.width, sequence.camera.height),
            n_frames=len(sequence),
            speed=condition.speed,
            seed=seed,
            truth=truth,
        )
    )


def _snapshot_frame(n_frames: int, conditions: Items[TrackerSetup], key_frame: int | None) -> int:
    """The middle frame, or the one before it that the slowest condition sees.

    In a key frame errors are zero: with one, it is the frame in the middle of those that follow it.
    """
    slowest = min((condition.speed for condition in conditions), default=1)
    return (n_frames + (key_frame or 0)) // 2 // slowest * slowest
