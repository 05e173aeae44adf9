"""Interfaces of truths: a session per tracker and condition receives observations and returns their true positions."""

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.surroundings import Surroundings
from tracknoise.sequences.sequence import Sequence


@dataclass(frozen=True, slots=True, eq=False)
class TruePositions:
    """True positions of all observations of one tracker under one condition.

    The n observations are in the order in which the session received them. The m tracks are in the order of their
    numbers.

    Attributes
    ----------
    uv : (n, 2) float64
        True position of each observation, px; NaN where it is unknown.
    status : (n,) int8
        `tracknoise.tables.schema.TruthStatus` of each observation.
    depth_m : (m,) float64
        Depth of the point of each track in its first frame, metres; NaN where it is unknown.
    covariance : (n, 2, 2) float64, or None
        Covariance of the error of each true position, px^2; NaN where it is unknown. None if this kind of truth states
        none: it is then computed from the accuracy of poses and depths (`tracknoise.truth.uncertainty`).
    epipolar : (n, 2) float64, or None
        Signed distance of each observation from the epipolar line of the first one of its track, px, and the variance
        of this distance for white noise of 1 px, px^2; NaN where it is unknown. None if this kind of truth has none.
    leverage : (n, 2, 2) float64, or None
        Where true positions are fitted to the observations: covariance of each true position for white noise of 1 px in
        these, no unit; NaN where it is unknown. None for other kinds of truth.
    depth_sigma_m : (m,) float64, or None
        Standard deviation of each of these depths, metres; NaN where it is unknown. None where it follows from the
        stated accuracy of depths.
    surroundings
        What lies around the point of each track in its first frame, (m,). None if this kind of truth has no dense
        depth.
    first_uv : (n, 2) float64, or None
        Of observations in a second camera: true positions in the first, px. None for others.
    """

    uv: NDArray[np.float64]
    status: NDArray[np.int8]
    depth_m: NDArray[np.float64]
    covariance: NDArray[np.float64] | None = None
    epipolar: NDArray[np.float64] | None = None
    leverage: NDArray[np.float64] | None = None
    surroundings: Surroundings | None = None
    depth_sigma_m: NDArray[np.float64] | None = None
    first_uv: NDArray[np.float64] | None = None


class TruthSession(Protocol):
    """Receives the observations of one tracker under one condition, and computes their true positions."""

    def observe(self, index: int, tracks: NDArray[np.uint32], uv: NDArray[np.float64], born: NDArray[np.bool_]) -> None:
        """Receive all observations in one frame.

        Called once per frame that the tracker sees, in order. Tracks are numbered from 0 in the order in which they
        begin: ``tracks[born]`` continues the numbers so far.

        Parameters
        ----------
        index
            Frame of the nominal sequence.
        tracks
            (n,) uint32: number of each observed track.
        uv
            (n, 2) float64: observed positions, px.
        born
            (n,) bool: whether the track begins in this frame.

        Raises
        ------
        DataError
            If the depth of a frame cannot be read.
        """
        ...

    def resolve(self) -> TruePositions:
        """Return the true positions of all observations. Called once, after the last frame.

        Raises
        ------
        DataError
            If the depth of a frame cannot be read.
        """
        ...


class Truth(Protocol):
    """One kind of truth for one sequence. All trackers and speeds share it; each combination has its own session.

    A truth that can also compute world points is a `tracknoise.trackers.tracker.OracleTruth`; the oracle tracker needs
    one.
    """

    @property
    def kind(self) -> str:
        """Name of the kind of truth."""
        ...

    @property
    def key_frame(self) -> int | None:
        """The frame in which a scan anchors all features; None if features are anchored in their first frames."""
        ...

    def start(self) -> TruthSession:
        """Start a session for one tracker under one condition."""
        ...


def notes_of(truth: Truth) -> tuple[str, ...]:
    """What is to be known of a truth that was used, one sentence each; empty where it says nothing of itself."""
    notes: tuple[str, ...] = getattr(truth, "notes", ())
    return notes


class TruthSource(Protocol):
    """A kind of truth: a frozen dataclass whose fields are its settings, all with defaults."""

    kind: ClassVar[str]

    def open(self, sequence: Sequence) -> Truth:
        """Make the truth of one sequence.

        Raises
        ------
        DataError
            If the sequence lacks what this kind of truth needs.
        """
        ...
