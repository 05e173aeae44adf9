"""Covariance of true positions, from the accuracy of poses, depths, clock, shutter and focal length.

With the derivatives of `tracknoise.truth.sensitivity`, and the variances r^2 and s^2 that (accuracy.growth) gives the
relative rotation and translation after k frames, the covariance of a true position is

    C = s^2 J J' + r^2 B B' + sigma_Z^2 d d' + sigma_c^2 c c' + sigma_r^2 q q' + sigma_f^2 g g'    (truth.floor)

It is zero in the frame of the anchor. A rotation acts about the camera in which it is wrong: B B' is the mean over both
cameras for errors of single poses, and over the straight line between them for errors that every step adds.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.accuracy import TruthAccuracy
from tracknoise.tables.enumerations import FloorSource

if TYPE_CHECKING:
    from tracknoise.truth.sensitivity import AnchoredPoints, Sensitivity, TruthDerivatives

_ROWS_AT_ONCE = 1 << 15
"""Observations that are differentiated together: their derivatives stay in the cache."""

SOURCES: Mapping[FloorSource, tuple[str, ...]] = {
    FloorSource.poses: ("rotation", "translation"),
    FloorSource.depth: ("depth",),
    FloorSource.clock: ("clock",),
    FloorSource.readout: ("readout",),
    FloorSource.focal: ("focal",),
}
"""Sources of errors of true positions, and the topics of an accuracy that state their size."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseLaws:
    """Standard deviations of the errors of poses, for three translations (metres) and three rotations (rad).

    Attributes
    ----------
    white, walk, drift : (6,) float64
        As in `tracknoise.geometry.accuracy.GrowthLaw`, per frame of the sequence.
    """

    white: NDArray[np.float64]
    walk: NDArray[np.float64]
    drift: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """Errors of n true positions, each source by itself.

    Attributes
    ----------
    covariance : mapping of (n, 2, 2) float64
        By source, px^2.
    by_pose : (n, 2, 6) float64
        Derivative by translation and rotation of the relative pose, px per metre and px per radian.
    moved_px : mapping of (n, 2) float64
        By source other than the poses: displacement by one standard deviation, px. That of depth is independent from
        track to track. All others have the same sign in the whole recording.
    """

    covariance: Mapping[FloorSource, NDArray[np.float64]]
    by_pose: NDArray[np.float64]
    moved_px: Mapping[FloorSource, NDArray[np.float64]]


class TrueErrors:
    """Uncertainty of the true positions of a sequence.

    Parameters
    ----------
    derivatives
        Of the true positions.
    accuracy
        Of the truth.
    step
        Frames of the recording from one frame of the sequence to the next.
    """

    __slots__ = ("_accuracy", "_derivatives", "_step", "sources")

    def __init__(self, derivatives: "TruthDerivatives", accuracy: TruthAccuracy, *, step: int) -> None:
        self._derivatives, self._accuracy, self._step = derivatives, accuracy, step
        self.sources = tuple(source for source in SOURCES if not accuracy.topics.isdisjoint(SOURCES[source]))

    @property
    def is_exact(self) -> bool:
        """Whether all that is known about the truth is that it has no errors."""
        return self._accuracy.is_exact

    @property
    def pose_laws(self) -> PoseLaws:
        """Laws of the errors of poses."""
        laws = self._accuracy.translation, self._accuracy.rotation
        return PoseLaws(
            white=np.repeat([law.white for law in laws], 3),
            walk=np.repeat([law.walk * np.sqrt(self._step) for law in laws], 3),
            drift=np.repeat([law.drift * self._step for law in laws], 3),
        )

    def of(self, points: "AnchoredPoints") -> Iterator[tuple[slice, Uncertainty]]:
        """The uncertainty of observations, some at a time."""
        for start in range(0, len(points.frame), _ROWS_AT_ONCE):
            rows = slice(start, start + _ROWS_AT_ONCE)
            part = points.part(rows)
            yield rows, self._uncertainty(part, self._derivatives.sensitivity(part))

    def _uncertainty(self, points: "AnchoredPoints", found: "Sensitivity") -> Uncertainty:
        moved = {source: of(found) for source, of in self._movements().items() if source in self.sources}
        covariance = {source: _outer(px[:, :, None]) for source, px in moved.items()}
        if FloorSource.poses in self.sources:
            lag = self._step * np.abs(points.frame - points.anchor).astype(np.float64)
            covariance[FloorSource.poses] = self._of_poses(found, lag)
        turned = (found.rotation_here + found.rotation_there) / 2.0
        return Uncertainty(covariance, np.concatenate([found.translation, turned], axis=2), moved)

    def _movements(self) -> Mapping[FloorSource, Callable[["Sensitivity"], NDArray[np.float64]]]:
        """Displacement by one standard deviation of each source that has one, px."""
        accuracy = self._accuracy
        clock_s, readout_s = (1e-3 * (value or 0.0) for value in (accuracy.clock_ms, accuracy.readout_ms))
        return {
            FloorSource.depth: lambda found: found.depth * accuracy.depth.sigma_m(found.depth_m)[:, None],
            FloorSource.clock: lambda found: found.clock * clock_s,
            FloorSource.readout: lambda found: found.readout * readout_s,
            FloorSource.focal: lambda found: found.focal * (accuracy.focal_relative or 0.0),
        }

    def _of_poses(self, found: "Sensitivity", lag: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2, 2) float64: covariance by relative poses `lag` frames of the recording apart, px^2."""
        rotation, translation = self._accuracy.rotation, self._accuracy.translation
        here, there = found.rotation_here, found.rotation_there
        ends = (_outer(here) + _outer(there)) / 2.0
        line = ends - _outer(here - there) / 6.0
        moved = translation.variance(lag)[:, None, None] * _outer(found.translation)
        single = np.where(lag > 0.0, 2.0 * rotation.white**2, 0.0)
        stepwise = rotation.variance(lag) - single
        return moved + single[:, None, None] * ends + stepwise[:, None, None] * line


def _outer(factors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2, 2) float64: B B' of (n, 2, m) float64."""
    return np.asarray(factors @ np.swapaxes(factors, 1, 2))
