"""True positions of world points in a frame, and whether the points can be seen there."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.depth import farthest_neighbour
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.sequence_geometry import SequenceGeometry

OCCLUSION_RELATIVE = 0.02
"""A point that lies farther behind the visible surface than this share of the surface's depth is occluded."""

OCCLUSION_LEAST_M = 0.005
"""A point that lies less than this behind the visible surface is never occluded, metres."""

OCCLUSION_SIGMAS = 4.0
"""How much farther away a surface of uncertain depth is taken to be, in standard deviations of that depth."""

Depths = tuple[NDArray[np.float64], NDArray[np.bool_]]
Located = tuple[NDArray[np.float64], NDArray[np.int8]]


class VisibleSurface(Protocol):
    """The first surface along the rays of a frame."""

    def depths(self, index: int, uv: NDArray[np.float64]) -> Depths:
        """Depth of the surface under pixels.

        Parameters
        ----------
        index
            Frame.
        uv
            (n, 2) float64, px, inside the image.

        Returns
        -------
        depth_m : (n,) float64
            Metres along z; arbitrary but finite where unknown.
        known : (n,) bool
        """
        ...


class DepthMapSurface:
    """The frame's depth map: the farthest of the four neighbouring pixels, so that a point beside an edge is visible.

    Parameters
    ----------
    geometry
        Of the sequence.
    """

    __slots__ = ("_geometry",)

    def __init__(self, geometry: SequenceGeometry) -> None:
        self._geometry = geometry

    def depths(self, index: int, uv: NDArray[np.float64]) -> Depths:
        """Farthest depth that a neighbouring pixel may have: see `VisibleSurface.depths`. Unknown without depth."""
        depth = self._geometry.depth(index)
        if depth is None:
            return np.zeros(len(uv)), np.zeros(len(uv), np.bool_)
        farthest_m, known = farthest_neighbour(depth, uv)
        return farthest_m + OCCLUSION_SIGMAS * depth.accuracy.sigma_m(farthest_m), known


def locate(
    geometry: SequenceGeometry, surface: VisibleSurface, index: int, points_world: NDArray[np.float64]
) -> Located:
    """Project world points into a frame: x_true = pi(camera_from_world X_w), and decide whether they can be seen.

    A point is occluded if it lies more than max(2 % of the surface's depth, 5 mm) behind the visible surface. Where
    the surface is unknown, no point is occluded. In a frame without a pose, no point has a position. With a rolling
    shutter, both depths are those in the camera when the row of the point was exposed.

    Parameters
    ----------
    geometry
        Of the sequence.
    surface
        The surface that occludes what lies behind it.
    index
        Frame.
    points_world
        (n, 3) float64, metres; NaN where unknown.

    Returns
    -------
    uv : (n, 2) float64
        px; NaN behind the camera and where its distortion has no image. Points outside the image have positions too.
    status : (n,) int8
        `TruthStatus`: behind_camera where there is no position, out_of_image, occluded or valid, arbitrary where the
        point is unknown; no_pose for all if the frame has none.
    """
    if not geometry.has_pose(index):
        return np.full((len(points_world), 2), np.nan), np.full(len(points_world), TruthStatus.no_pose, np.int8)
    uv, points = geometry.seen(index, points_world)
    has_image = (points[:, 2] > 0) & np.isfinite(uv).all(axis=1)
    inside = np.flatnonzero(has_image & geometry.camera_at(index).contains(uv))
    surface_m, known = surface.depths(index, uv[inside])
    behind_m = points[inside, 2] - surface_m
    occluded = known & (behind_m > np.maximum(OCCLUSION_RELATIVE * surface_m, OCCLUSION_LEAST_M))
    status = np.where(has_image, TruthStatus.out_of_image, TruthStatus.behind_camera).astype(np.int8)
    status[inside] = np.where(occluded, TruthStatus.occluded, TruthStatus.valid)
    return uv, status
