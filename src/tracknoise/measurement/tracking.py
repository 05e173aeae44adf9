"""One pass over the images of sequences that runs every tracker at every speed."""

from collections.abc import Callable, Mapping
from collections.abc import Sequence as Items
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tracknoise.measurement.recording import Recorder, Recording
from tracknoise.sequences.row_poses import RowPoses
from tracknoise.sequences.second_camera import pair_of, second_image
from tracknoise.sequences.sequence import Sequence, camera_at, clock_start_of, second_of, times_of
from tracknoise.sequences.views import first_of_part, image_names_of, source_frames, whole_of
from tracknoise.trackers.gradient import dominant_gradient
from tracknoise.trackers.tracker import (
    Frame,
    NotedTracker,
    OracleTruth,
    PointTracker,
    SequenceContext,
    StatedPoints,
    Step,
    Tracker,
    TrackerSettings,
    begins_anywhere,
    sees_second_camera,
)
from tracknoise.truth.beside import beside_session
from tracknoise.truth.truth import TruePositions, Truth, TruthSession

Progress = Callable[[int, int], None]
"""Called with the number of frames done, and of all frames."""


@dataclass(frozen=True, slots=True)
class TrackerSetup:
    """A tracker at a speed."""

    tracker: str  # its name in the tables
    settings: TrackerSettings  # its settings
    speed: int  # It sees frames 0, speed, 2 speed, ... of the nominal sequence.


@dataclass(frozen=True, slots=True)
class TrackingResult:
    """Result of one pass over a sequence."""

    recordings: list[Recording]  # what each tracker setup reported, in the order given
    positions: list[TruePositions]  # the true positions of each recording's observations
    snapshot_frame: int  # the frame that is kept for figures
    snapshot: NDArray[np.uint8]  # (height, width): its image
    notes: tuple[str, ...] = ()  # what trackers state about their results, one sentence each
    # the true positions of a second truth, in the same order; None where there is no second truth
    second_positions: list[TruePositions] | None = None
    # images of the first frames, (height, width) uint8, as far as they were to be kept
    images: Mapping[int, NDArray[np.uint8]] = field(default_factory=dict, repr=False)
    # by tracker and speed: all positions of trackers that state some of points that they say are not visible
    points: Mapping[tuple[str, int], StatedPoints] = field(default_factory=dict, repr=False)


def run_trackers(
    sequences: Items[Sequence],
    conditions: Items[TrackerSetup],
    truths: Items[Truth],
    *,
    n_frames: int,
    seed: int,
    progress: Progress | None = None,
    second_truths: Items[Truth] | None = None,
    kept_bytes: int = 0,
) -> list[TrackingResult]:
    """Read each image once, in order, and run each tracker on the frames that it sees.

    All sequences advance together: a frame of each is read before the next frame of any, so that they can share what
    they read.
    """
    snapshot_frame = _snapshot_frame(n_frames, conditions, truths[0].key_frame)
    seconds: Items[Truth | None] = second_truths or [None for _ in truths]
    passes = [
        _Pass(
            sequence,
            conditions,
            truth,
            second,
            n_frames=n_frames,
            snapshot_frame=snapshot_frame,
            seed=seed,
            kept_bytes=kept_bytes,
        )
        for sequence, truth, second in zip(sequences, truths, seconds, strict=True)
    ]
    for index in range(n_frames):
        for sequence_pass in passes:
            frame = Frame(index, sequence_pass.sequence.image(index), sequence_pass.read_second(index))
            sequence_pass.keep(frame)
            for run in sequence_pass.runs:
                if index % run.speed:
                    continue
                step = run.tracker.step(frame)
                tracks = run.recorder.add(index, step, gradient_rad=partial(dominant_gradient, frame))
                for truth in run.truths:
                    truth.observe(index, tracks, step.uv if step.first_uv is None else step.first_uv, step.born)
        if progress is not None:
            progress(index + 1, n_frames)
    return [sequence_pass.finish() for sequence_pass in passes]


@dataclass(frozen=True, slots=True)
class _Run:
    """One tracker setup on one sequence."""

    speed: int
    tracker: Tracker
    recorder: Recorder
    truths: list[TruthSession]  # the second one last, if there is one


class _Pass:
    """All tracker setups on one sequence."""

    def __init__(
        self,
        sequence: Sequence,
        conditions: Items[TrackerSetup],
        truth: Truth,
        second: Truth | None,
        *,
        n_frames: int,
        snapshot_frame: int,
        seed: int,
        kept_bytes: int,
    ) -> None:
        self.sequence = sequence
        self.read_second = second_images(sequence)
        oracle = truth if isinstance(truth, OracleTruth) else None
        self.runs = [
            _Run(
                condition.speed,
                start_tracker(condition, sequence, oracle, seed, n_frames),
                Recorder(),
                [
                    beside_session(opened, sequence) if sees_second_camera(condition.settings) else opened.start()
                    for opened in (truth, second)
                    if opened is not None
                ],
            )
            for condition in conditions
        ]
        self._conditions = conditions
        self._points = _points(conditions, [run.tracker for run in self.runs])
        self._snapshot_frame = snapshot_frame
        self._snapshot: NDArray[np.uint8] = np.empty((0, 0), np.uint8)
        self._images: dict[int, NDArray[np.uint8]] = {}
        self._free_bytes = kept_bytes

    def keep(self, frame: Frame) -> None:
        """Keep the image of a frame where it is wanted."""
        if frame.index == self._snapshot_frame:
            self._snapshot = frame.image
        if frame.image.nbytes <= self._free_bytes:
            self._images[frame.index] = frame.image
            self._free_bytes -= frame.image.nbytes

    def finish(self) -> TrackingResult:
        """What was recorded, and the true positions. What each tracker setup collected is released at once."""
        notes = _notes(self._conditions, [run.tracker for run in self.runs])
        recordings, positions, second = [], [], []
        while self.runs:
            run = self.runs.pop(0)
            recordings.append(run.recorder.finish())
            positions.append(run.truths[0].resolve())
            second += [session.resolve() for session in run.truths[1:]]
        return TrackingResult(
            recordings,
            positions,
            self._snapshot_frame,
            self._snapshot,
            notes,
            second or None,
            self._images,
            self._points,
        )


ReadSecond = Callable[[], NDArray[np.uint8] | None]


def second_images(sequence: Sequence) -> Callable[[int], ReadSecond | None]:
    """Gives what reads the image of the second camera of a frame; None without one."""
    second = second_of(sequence)
    return lambda index: None if second is None else partial(second_image, second, index, sequence.source)


def start_tracker(
    condition: TrackerSetup, sequence: Sequence, truth: OracleTruth | None, seed: int, n_frames: int
) -> Tracker:
    """Start the tracker of a setup on a sequence; `truth` for trackers that know it.

    On a part of a sequence, a tracker that begins anywhere is started on the whole one.
    """
    whole, first = whole_of(sequence) if begins_anywhere(condition.settings) else (sequence, 0)
    posed, second = RowPoses(whole).known, second_of(whole)
    tracker = condition.settings.start(
        SequenceContext(
            sequence=whole.id,
            size=(whole.camera.width, whole.camera.height),
            n_frames=len(whole),
            speed=condition.speed,
            seed=seed,
            first_frame=first_of_part(whole),
            truth=truth,
            frames_without_pose=frozenset(np.flatnonzero(~posed).tolist()),
            timestamps_s=times_of(whole),
            clock_start_ns=clock_start_of(whole),
            source_frames=source_frames(whole),
            camera_at=partial(camera_at, whole),
            rotation_at=(lambda index: whole.world_from_camera[index, :3, :3]) if posed.any() else None,
            images=lambda: map(sequence.image, range(0, n_frames, condition.speed)),
            image_names=image_names_of(whole),
            pair=None if second is None else pair_of(whole, second),
        )
    )
    return tracker if whole is sequence else _InPart(tracker, range(first, first + len(sequence)))


@dataclass(frozen=True, slots=True)
class _InPart:
    """A tracker of a whole sequence in some of its frames."""

    tracker: Tracker
    frames: range

    @property
    def notes(self) -> tuple[str, ...]:
        """See `tracknoise.trackers.tracker.NotedTracker`."""
        return self.tracker.notes if isinstance(self.tracker, NotedTracker) else ()

    @property
    def points(self) -> StatedPoints | None:
        """See `tracknoise.trackers.tracker.PointTracker`: those in frames of the part."""
        points = self.tracker.points if isinstance(self.tracker, PointTracker) else None
        if points is None:
            return None
        inside = (points.frame >= self.frames.start) & (points.frame < self.frames.stop)
        frame = points.frame[inside] - self.frames.start
        return StatedPoints(points.point[inside], frame, points.uv[inside], points.visible[inside])

    def step(self, frame: Frame) -> Step:
        """See `tracknoise.trackers.tracker.Tracker.step`; its first frame is that of the part."""
        return self.tracker.step(Frame(self.frames[frame.index], frame.image, lambda: frame.second))


def _notes(conditions: Items[TrackerSetup], trackers: Items[Tracker]) -> tuple[str, ...]:
    """Notes of all trackers with their names, each once."""
    pairs = [(condition.tracker, tracker) for condition, tracker in zip(conditions, trackers, strict=True)]
    noted = (
        f"{name}: {note}" for name, tracker in pairs if isinstance(tracker, NotedTracker) for note in tracker.notes
    )
    return tuple(dict.fromkeys(noted))


def _points(conditions: Items[TrackerSetup], trackers: Items[Tracker]) -> dict[tuple[str, int], StatedPoints]:
    """What trackers state of points that they say are not visible, by name and speed."""
    pairs = zip(conditions, trackers, strict=True)
    stated = {
        (condition.tracker, condition.speed): tracker.points
        for condition, tracker in pairs
        if isinstance(tracker, PointTracker)
    }
    return {condition: points for condition, points in stated.items() if points is not None}


def _snapshot_frame(n_frames: int, conditions: Items[TrackerSetup], key_frame: int | None) -> int:
    """The middle frame, or the latest before it that the slowest tracker setup sees.

    With a key frame, where errors are zero, it is the middle of the frames after that one.
    """
    slowest = min((condition.speed for condition in conditions), default=1)
    return (n_frames + (key_frame or 0)) // 2 // slowest * slowest
