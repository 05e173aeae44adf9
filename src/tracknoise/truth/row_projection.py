"""Where a rolling shutter shows points: each at the time at which its own row is exposed.

The row v of a point decides its time t + r ((v + 0.5) / H - 0.5), and the pose at this time decides its row. With g(d)
the delay of the row in which the pose after the delay d shows the point,

    g(d) = d    (truth.shutter)

is solved for each point by secant steps that begin with d = 0 and d = g(0). The image moves by a small part of its
height while it is read out, so that two or three steps are enough.
"""

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.row_poses import RollingPoses

_MOST_STEPS = 12
_SOLVED = 1e-12
"""Relative to the readout: 1e-9 rows of an image of 1000."""
_LEAST_SLOPE = 0.1
"""A smaller slope of g(d) - d is rounding, or the image is as fast as the shutter: then a step goes to g(d)."""

Seen = tuple[NDArray[np.float64], NDArray[np.float64]]


def project_by_rows(poses: RollingPoses, camera: CameraModel, index: int, points_world: NDArray[np.float64]) -> Seen:
    """Positions of world points in a frame with a rolling shutter: (truth.shutter).

    Parameters
    ----------
    poses
        Of the sequence.
    camera
        Of the frame.
    index
        Frame, which has a pose.
    points_world
        (n, 3) float64, metres.

    Returns
    -------
    uv : (n, 2) float64
        px; NaN where a point has no image, or has none at the time of the middle of the image.
    points : (n, 3) float64
        The points in the camera frame at the time of their row, metres.
    """

    def seen_after(delay_s: NDArray[np.float64]) -> tuple[Seen, NDArray[np.float64]]:
        """Positions and points after delays, and by how much the delays of the rows differ; 0 where there is none."""
        points = transform(invert(poses.after(index, delay_s)), points_world)
        uv = camera.project(points)
        return (uv, points), np.nan_to_num(poses.delays_s(uv) - delay_s)

    before_s = np.zeros(len(points_world))
    seen, miss_before_s = seen_after(before_s)
    delay_s, most_s = miss_before_s, poses.most_s
    for _ in range(_MOST_STEPS):
        seen, miss_s = seen_after(delay_s)
        if np.all(np.abs(miss_s) <= _SOLVED * most_s):
            break
        step_s = _secant_step(delay_s - before_s, miss_s, miss_before_s)
        before_s, miss_before_s, delay_s = delay_s, miss_s, np.clip(delay_s + step_s, -most_s, most_s)
    return seen


def _secant_step(
    moved_s: NDArray[np.float64], miss_s: NDArray[np.float64], miss_before_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Step to the root of the line through the last two values."""
    change_s = miss_before_s - miss_s
    usable = np.abs(change_s) > _LEAST_SLOPE * np.abs(moved_s)
    return miss_s * np.where(usable, moved_s / np.where(usable, change_s, 1.0), 1.0)
