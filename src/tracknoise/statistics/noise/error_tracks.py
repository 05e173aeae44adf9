"""Errors of tracks about their first positions, with the magnification of the image and its motion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.statistics.steps import followers


@dataclass(frozen=True, slots=True, eq=False)
class ErrorTracks:
    """Observations of all tracks, in the order of condition, track and frame, each up to the same age.

    Attributes
    ----------
    rows : (n,) intp
        Rows of the observations table.
    track : (n,) intp
        A number for each track.
    frame, speed : (n,) int64
        Of each observation.
    age : (n,) float64
        Frames of the recording since birth.
    error_px : (n, 2) float64
        About the first position; NaN where it is unknown or hidden, and for outliers.
    outlier : (n,) bool
        Whether the error is beyond the limit.
    limit_px : (conditions,) float64
        Limit of each condition; NaN where it has no errors.
    magnification : (n,) float64
        M_k = Z_0 / Z_k; 1 where the depth is unknown.
    walked : (n,) float64
        Sum of s / M_i^2 over the frames i of the tracker since birth, s frames of the recording apart.
    motion_px : (n, 2) float64
        Motion of the true position since the observation before; NaN at birth.
    """

    rows: NDArray[np.intp]
    track: NDArray[np.intp]
    frame: NDArray[np.int64]
    speed: NDArray[np.int64]
    age: NDArray[np.float64]
    error_px: NDArray[np.float64]
    outlier: NDArray[np.bool_]
    limit_px: NDArray[np.float64]
    magnification: NDArray[np.float64]
    walked: NDArray[np.float64]
    motion_px: NDArray[np.float64]

    def before(self, steps: int) -> NDArray[np.intp]:
        """Places of known errors that have a known error so many frames of the tracker before, in the row above."""
        late = followers(self.track, self.frame, self.speed, steps)
        known = ~np.isnan(self.error_px[:, 0])
        return late[known[late] & known[late - steps]]
