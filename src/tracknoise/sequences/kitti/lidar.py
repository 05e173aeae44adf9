"""Where a Velodyne HDL-64E looks: 64 rings of points, for simulated scans."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel

FARTHEST_M = 80.0
"""Beyond this nothing is measured."""

_ELEVATIONS_DEG = np.concatenate([np.linspace(2.0, -8.33, 32), np.linspace(-8.83, -24.33, 32)])
_STEP_DEG = 0.1728  # at ten turns a second
_SWAY_DEG = 0.25


def lidar_sweep(
    camera: CameraModel, camera_from_velodyne: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Positions in the image through which the lasers shine in one turn, or the half of it that looks ahead.

    The lasers are taken to start where the camera is: so they measure nothing that the camera does not see.

    Parameters
    ----------
    camera
        That sees the points.
    camera_from_velodyne
        (4, 4) float64. Only the rotation is used.
    rng
        Decides by how little the scanner is turned and tilted, so that no two turns hit the same points.

    Returns
    -------
    (n, 2) float64
        px, inside the image.
    """
    tilt = np.deg2rad(rng.uniform(-_SWAY_DEG, _SWAY_DEG))
    azimuth = np.deg2rad(np.arange(-90.0, 90.0, _STEP_DEG) + rng.uniform(0.0, _STEP_DEG))
    elevation = np.deg2rad(_ELEVATIONS_DEG)[:, None] + tilt * np.cos(azimuth)
    level = np.cos(elevation)
    rays = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1).reshape(-1, 3)
    uv = camera.project(rays @ camera_from_velodyne[:3, :3].T)
    inside: NDArray[np.float64] = uv[camera.contains(uv)]
    return inside
