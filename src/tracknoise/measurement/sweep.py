"""One pass over a sequence's images that drives every tracker at every speed."""

from collections.abc import Callable
from collections.abc import Sequence as Items
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.measurement.recording import Recorder, Recording
from tracknoise.sequences.sequence import Sequence
from tracknoise.trackers.frame import Frame
from tracknoise.trackers.tracker import Setting, Tracker, TrackerSettings
from tracknoise.truth.truth import Truth

Progress = Callable[[int, int], None]
"""Called with the count of frames done and of all."""


@dataclass(frozen=True, slots=True)
class Condition:
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
class Sweep:
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


def sweep(
    sequence: Sequence,
    conditions: Items[Condition],
    truth: Truth,
    *,
    n_frames: int,
    seed: int,
    progress: Progress | None = None,
) -> Sweep:
    """Read each image once, in order, and step every condition that is due.

    Parameters
    ----------
    sequence
        The images.
    conditions
        Trackers and speeds.
    truth
        Of the same sequence.
    n_frames
        How many of its frames to read, from the first.
    seed
        For trackers that need randomness.
    progress
        Told after each frame.

    Raises
    ------
    DataError
        If an image or depth map cannot be used.
    TrackerError
        If a tracker reports what it cannot have seen.
    """
    trackers = [_start(condition, sequence, truth, seed) for condition in conditions]
    recorders = [Recorder(truth) for _ in conditions]
    snapshot_frame = _snapshot_frame(n_frames, [condition.speed for condition in conditions])
    snapshot: NDArray[np.uint8] = np.empty((0, 0), np.uint8)
    for index in range(n_frames):
        frame = Frame(index, sequence.image(index))
        for condition, tracker, recorder in zip(conditions, trackers, recorders, strict=True):
            if index % condition.speed == 0:
                recorder.add(index, tracker.step(frame))
        if index == snapshot_frame:
            snapshot = frame.image
        if progress is not None:
            progress(index + 1, n_frames)
    return Sweep([recorder.finish() for recorder in recorders], snapshot_frame, snapshot)


def _start(condition: Condition, sequence: Sequence, truth: Truth, seed: int) -> Tracker:
    name = sequence.id
    return condition.settings.start(
        Setting(
            scene=name.scene,
            lighting=name.lighting,
            rotation=name.rotation,
            size=(sequence.camera.width, sequence.camera.height),
            n_frames=len(sequence),
            speed=condition.speed,
            seed=seed,
            truth=truth,
        )
    )


def _snapshot_frame(n_frames: int, speeds: list[int]) -> int:
    """The middle frame, or the one before it that the slowest condition sees."""
    slowest = min(speeds, default=1)
    return n_frames // 2 // slowest * slowest
