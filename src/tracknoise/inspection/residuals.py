"""How far points are from where poses, depths and intrinsics predict them."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.pose import invert, transform
from tracknoise.inspection.hypotheses import Hypothesis, Poses
from tracknoise.inspection.optics import focal_px
from tracknoise.inspection.pairs import FEWEST_POINTS, Pair

_KEPT = 256
"""Rays of this many pairs are kept: most hypotheses change poses alone, and the inverse of a distortion is slow."""


def relative_pose(poses: Poses, pair: Pair) -> NDArray[np.float64]:
    """(4, 4) float64: second_from_first; NaN where a pose is missing."""
    relative: NDArray[np.float64] = invert(poses[pair.second]) @ poses[pair.first]
    return relative


def reprojection_px(
    pair: Pair, relative: NDArray[np.float64], camera: CameraModel, assumed: Hypothesis
) -> NDArray[np.float64]:
    """(m, 2) float64: observed minus predicted position of each point with depth, px; infinite behind the camera."""
    known = np.isfinite(pair.depth_first_m)
    bearings = _rays(pair, camera, assumed.resolution, assumed.zoom)[0][known]
    points = bearings * assumed.depths(bearings, pair.depth_first_m[known])[:, None]
    with np.errstate(all="ignore"):
        predicted = assumed.project(camera, transform(relative, points))
    residual = pair.uv_second[known] - predicted
    return np.where(np.isfinite(residual), residual, np.inf)


def epipolar_px(
    pair: Pair, relative: NDArray[np.float64], camera: CameraModel, assumed: Hypothesis
) -> NDArray[np.float64]:
    """(n,) float64: signed distance of each point from its epipolar line, px at the centre of the image."""
    first, second = _rays(pair, camera, assumed.resolution, assumed.zoom)
    turned = first @ relative[:3, :3].T
    lines = np.cross(relative[:3, 3], turned)
    norm = np.linalg.norm(lines[:, :2], axis=1)
    with np.errstate(all="ignore"):
        distance = np.einsum("ni,ni->n", lines, second) / norm * focal_px(camera) * assumed.resolution
    return np.where(np.isfinite(distance), distance, np.inf)


def median_residual_px(pair: Pair, poses: Poses, camera: CameraModel, assumed: Hypothesis, *, has_depth: bool) -> float:
    """Median distance of the points of a pair from their prediction, px; NaN where a pose is missing."""
    relative = relative_pose(poses, pair)
    if not np.isfinite(relative).all():
        return np.nan
    if has_depth:
        residual = np.linalg.norm(reprojection_px(pair, relative, camera, assumed), axis=1)
    else:
        residual = np.abs(epipolar_px(pair, relative, camera, assumed))
    return float(np.median(residual)) if len(residual) >= FEWEST_POINTS else np.nan


@lru_cache(maxsize=_KEPT)
def _rays(
    pair: Pair, camera: CameraModel, resolution: float, zoom: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n, 3) float64 each: rays through the points of both images, z = 1."""
    assumed = Hypothesis("optics", "other optics", resolution=resolution, zoom=zoom)
    return assumed.bearings(camera, pair.uv_first), assumed.bearings(camera, pair.uv_second)
