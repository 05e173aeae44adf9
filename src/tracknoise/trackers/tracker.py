"""What a tracker is: settings that start it, and a step a frame."""

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from tracknoise.tables.identity import SequenceId
from tracknoise.trackers.frame import Frame


@dataclass(frozen=True, slots=True)
class Step:
    """What a tracker reports of one frame.

    Attributes
    ----------
    ids : (n,) int64
        The features found or begun in this frame, in no particular order. An id is never used again.
    uv : (n, 2) float64
        Where they are, px.
    born : (n,) bool
        Which of them were begun in this frame.
    response : (n,) float32
        Detector response at the feature's birth; NaN where unknown. Read where `born` only.
    ended_ids : (m,) int64
        The features that ended in this frame.
    ended : (m,) int8
        Why: `tracknoise.tables.schema.TrackEnd` values.
    offered, matched, outliers, alive
        F(t-1) features the tracker set out with; how many it found again; how many of these it rejected as
        outliers, f1(t); F(t) features it goes on with, new ones included.
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

    @property
    def new(self) -> int:
        """Count of features begun in this frame, f2(t)."""
        return int(np.count_nonzero(self.born))


class Tracker(Protocol):
    """A tracker at work on one sequence at one speed."""

    def step(self, frame: Frame) -> Step:
        """Track into the next frame that this tracker sees."""
        ...


class TruePositions(Protocol):
    """Where features really are; what the oracle needs, and `tracknoise.truth` provides."""

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
            px; NaN behind the camera, and where its distortion has no image.
        """
        ...


@dataclass(frozen=True, slots=True)
class SequenceContext:
    """Where a tracker is started: the sequence and condition, and what only some trackers need.

    Parameters
    ----------
    sequence
        Its name.
    size
        (width, height) of its images, px.
    n_frames
        Count of the frames of the whole sequence; a run may read fewer.
    speed
        Every how many frames of the nominal sequence the tracker sees.
    seed
        From which a tracker that needs randomness derives its own generator.
    truth
        True positions, for the oracle alone.
    """

    sequence: SequenceId
    size: tuple[int, int]
    n_frames: int
    speed: int
    seed: int
    truth: TruePositions


class TrackerSettings(Protocol):
    """A frozen dataclass whose fields are a tracker's settings, all with defaults, and which starts it."""

    kind: ClassVar[str]
    description: ClassVar[str]

    def start(self, context: SequenceContext) -> Tracker:
        """Make a tracker at work on one sequence at one speed.

        Raises
        ------
        TracknoiseError
            If something the settings name (a file, say) cannot be used.
        """
        ...
