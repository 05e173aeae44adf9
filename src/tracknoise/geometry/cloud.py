"""Point clouds and their depth maps."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap


def cloud_depth(camera: CameraModel, points: NDArray[np.float64], *, nearest_m: float, radius_px: float) -> DepthMap:
    """Sparse depth map of a cloud of points: each pixel has the depth of the nearest point that is projected into it.

    Parameters
    ----------
    camera
        The camera of the depth map.
    points
        (n, 3) float64, metres, camera frame, finite.
    nearest_m
        Points of less depth are ignored, metres.
    radius_px
        See `DepthMap`.
    """
    seen = points[points[:, 2] >= nearest_m]
    uv = camera.project(seen)
    inside = camera.contains(uv)
    columns, rows = np.floor(uv[inside] + 0.5).astype(np.intp).T
    depth_m = np.full((camera.height, camera.width), np.inf)
    np.minimum.at(depth_m, (rows, columns), seen[inside, 2])
    return DepthMap(depth_m, np.isfinite(depth_m), radius_px)
