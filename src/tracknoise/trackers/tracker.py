"""Interfaces of trackers: settings that start a tracker, and one step per frame."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.tables.identity import SequenceId
from tracknoise.trackers.frame import Frame


@dataclass(frozen=True, slots=True)
class Step:
    """What a tracker reports about one frame.

    Attributes
    ----------
    ids : (n,) int64
        Ids of the features that were found or began in this frame, in any order. An id is never reused.
    uv : (n, 2) float64
        Their positions, px.
    born : (n,) bool
        Whether each of them begins in this frame.
    response : (n,) float32
        Detector response of new features; NaN where unknown. Read only where `born`.
    ended_ids : (m,) int64
        Ids of the features that ended in this frame.
    ended : (m,) int8
        Why each ended: `tracknoise.tables.schema.TrackEnd` values.
    offered, matched, outliers, alive
        Number of features before the step, F(t-1); how many of them were found again; how many of those were
        rejected as outliers, f1(t); number of features after the step, F(t), including new ones.
    quality : (n,) float32 each
        What the tracker reports about each observation, by name; NaN where unknown. Names match
        ``[a-z][a-z0-9_]*``. Each becomes the column ``quality_<name>`` of the table `observations`.
    """

    ids: NDArray[np.int64]
    uv: NDArray[np.float64]
    born: NDArray[np.bool_]
    response: NDArray[np.float32]
    ended_ids: NDArray[np.int64]
    ended: NDArray[np.int8]
    offered: int
    matched: int
    outliers: int
    alive: int
    quality: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)

    @property
    def new(self) -> int:
        """Number of features that begin in this frame, f2(t)."""
        return int(np.count_nonzero(self.born))


class Tracker(Protocol):
    """A tracker that runs on one sequence at one speed."""

    def step(self, frame: Frame) -> Step:
        """Track into the next frame that this tracker sees."""
        ...


@runtime_checkable
class OracleTruth(Protocol):
    """A truth that can place world points and project them: what the oracle tracker needs."""

    def anchor(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
        """World points of features first seen in a frame.

        Parameters
        ----------
        index
            Frame.
        uv
            (n, 2) float64, px.

        Returns
        -------
        points_world : (n, 3) float64
            Metres; NaN where the status is not valid.
        status : (n,) int8
            `tracknoise.tables.schema.TruthStatus` values: valid, no_depth or edge.
        """
        ...

    def project(self, index: int, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels of world points in a frame.

        Parameters
        ----------
        index
            Frame.
        points_world
            (n, 3) float64, metres.

        Returns
        -------
        (n, 2) float64
            px; NaN behind the camera, and where the distortion model has no image point.
        """
        ...


@runtime_checkable
class DisplacingTruth(OracleTruth, Protocol):
    """A truth that can also move points across the line of sight: for oracles whose features leave their points."""

    def displaced(
        self, index: int, points_world: NDArray[np.float64], by_px: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """World points of the same depth whose positions in a frame lie beside those of others.

        Parameters
        ----------
        index
            Frame.
        points_world
            (n, 3) float64, metres.
        by_px
            (n, 2) float64: by how much their positions differ, px.

        Returns
        -------
        (n, 3) float64
            Metres; NaN where a point has no position, or the pixel no ray.
        """
        ...


@dataclass(frozen=True, slots=True)
class SequenceContext:
    """The sequence and condition for which a tracker is started, and further inputs of some trackers.

    Parameters
    ----------
    sequence
        Identity of the sequence.
    size
        (width, height) of its images, px.
    n_frames
        Number of frames of the whole sequence; a run may read fewer.
    speed
        The tracker sees frames 0, speed, 2 speed, ... of the nominal sequence.
    seed
        Random seed, for trackers that need one.
    truth
        True positions, for the oracle only; None if this kind of truth cannot place points.
    repeat
        Number of the repetition with other random seeds; 0 for the first measurement.
    frames_without_pose
        Frames in which no true position is known.
    timestamps_s
        (n_frames,) float64: the time of each frame, seconds, increasing; None where unknown.
    source_frames
        Frames of the recording that are those of the sequence, where a part of it was chosen; None otherwise.
    camera_at
        Intrinsics of each frame, for trackers whose positions are rays; None where they are unknown.
    """

    sequence: SequenceId
    size: tuple[int, int]
    n_frames: int
    speed: int
    seed: int
    truth: OracleTruth | None
    repeat: int = 0
    frames_without_pose: frozenset[int] = frozenset()
    timestamps_s: NDArray[np.float64] | None = field(default=None, compare=False)
    source_frames: range | None = None
    camera_at: Callable[[int], CameraModel] | None = field(default=None, compare=False)


@runtime_checkable
class NotedTracker(Protocol):
    """A `Tracker` that states what should be known about its results."""

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence each, known when the tracker starts."""
        ...


class TrackerSettings(Protocol):
    """A frozen dataclass whose fields are a tracker's settings, and which starts the tracker."""

    kind: ClassVar[str]
    description: ClassVar[str]

    def start(self, context: SequenceContext) -> Tracker:
        """Start the tracker on one sequence at one speed.

        Raises
        ------
        TracknoiseError
            If something that the settings name, such as a file, cannot be used.
        """
        ...


def reports_causes(settings: TrackerSettings) -> bool:
    """Whether a tracker reports why tracks end, and which features it rejects as outliers.

    Settings of a tracker that does not have a class variable ``reports_causes = False``. Causes of ends and numbers of
    outliers are then null in all tables.
    """
    return bool(getattr(settings, "reports_causes", True))


@dataclass(frozen=True, slots=True)
class RepeatedTracker:
    """A tracker with other random seeds.

    Parameters
    ----------
    settings
        The tracker.
    repeat
        See `SequenceContext`.
    """

    kind: ClassVar[str] = "repeated"
    description: ClassVar[str] = "another tracker with other random seeds"

    settings: TrackerSettings
    repeat: int

    @property
    def reports_causes(self) -> bool:
        """As the tracker itself: see `reports_causes`."""
        return reports_causes(self.settings)

    def start(self, context: SequenceContext) -> Tracker:
        """Start the tracker on one sequence at one speed."""
        return self.settings.start(replace(context, repeat=self.repeat))
