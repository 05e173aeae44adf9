"""The time at which each row of an image is exposed."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import require
from tracknoise.geometry.cameras import CameraModel

_LONGEST_S = 1.0
"""A longer readout is a time in milliseconds."""


@dataclass(frozen=True, slots=True)
class RollingShutter:
    """A shutter that exposes one row of the image after the other: (truth.shutter).

    The time of a frame is that of the middle of its image. A row v of an image of H rows is exposed at
    t + readout_s ((v + 0.5) / H - 0.5).

    Parameters
    ----------
    readout_s
        Time from the upper edge of the first row to the lower edge of the last, seconds; negative where the last row is
        exposed first.
    axis
        Coordinate along which time passes: 1 for rows (v), 0 for columns (u), as in an image that was turned.

    Raises
    ------
    ValueError
        If the readout is not shorter than 1 s, or the axis is neither 0 nor 1.
    """

    readout_s: float
    axis: int = 1

    def __post_init__(self) -> None:
        require(abs(self.readout_s) < _LONGEST_S, "readout_s", self.readout_s, "seconds between -1 and 1")
        require(self.axis in (0, 1), "axis", self.axis, "0 or 1")

    def side(self, camera: CameraModel) -> int:
        """Number of rows, or of columns for axis 0, that are exposed one after the other."""
        return camera.height if self.axis == 1 else camera.width

    def phase(self, camera: CameraModel, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) float64: time from that of the frame to that of pixels (n, 2), as a share of the readout."""
        phase: NDArray[np.float64] = (uv[:, self.axis] + 0.5) / self.side(camera) - 0.5
        return phase

    def delays_s(self, camera: CameraModel, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) float64: the same time in seconds."""
        return self.readout_s * self.phase(camera, uv)

    def backward(self) -> Self:
        """The shutter of a recording that is played backward."""
        return replace(self, readout_s=-self.readout_s)

    def turned(self) -> Self:
        """The shutter of the image turned a quarter counter-clockwise, where (u, v) becomes (v, width - 1 - u)."""
        return replace(self, readout_s=self.readout_s if self.axis == 1 else -self.readout_s, axis=1 - self.axis)
