"""The time at which each row of an image is exposed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel


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
    """

    readout_s: float
    axis: int = 1

    def delays_s(self, camera: CameraModel, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) float64: time from that of the frame to that of pixels (n, 2), seconds."""
        side = camera.height if self.axis == 1 else camera.width
        delays: NDArray[np.float64] = self.readout_s * ((uv[:, self.axis] + 0.5) / side - 0.5)
        return delays
