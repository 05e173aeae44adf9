"""Visibility: whether a world point can be seen in a frame."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.depth import farthest_neighbour
from tracknoise.sequences.sequence import Surface
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.anchor import cast_depth
from tracknoise.truth.frames import Frames

OCCLUSION_RELATIVE = 0.02
"""A point farther behind the measured surface than this share of its depth is occluded."""

OCCLUSION_LEAST_M = 0.005
"""A point less far behind the measured surface than this is never occluded, metres."""

Depths = tuple[NDArray[np.float64], NDArray[np.bool_]]


class Measured(Protocol):
    """The first surface that a frame shows."""

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


class MeasuredDepth:
    """The frame's depth map: the farthest of the four pixels around, so that a point beside an edge counts as seen."""

    __slots__ = ("_frames",)

    def __init__(self, frames: Frames) -> None:
        self._frames = frames

    def depths(self, index: int, uv: NDArray[np.float64]) -> Depths:
        """Farthest neighbouring depth: see `Measured.depths`. Unknown in a frame without depth."""
        depth = self._frames.depth(index)
        if depth is None:
            return np.zeros(len(uv)), np.zeros(len(uv), np.bool_)
        return farthest_neighbour(depth, uv)


class MeasuredSurface:
    """The exact surface of a simulated world."""

    __slots__ = ("_frames", "_surface")

    def __init__(self, frames: Frames, surface: Surface) -> None:
        self._frames = frames
        self._surface = surface

    def depths(self, index: int, uv: NDArray[np.float64]) -> Depths:
        """Exact depth: see `Measured.depths`. Unknown where the ray hits nothing."""
        return cast_depth(self._frames, self._surface, index, uv)


def visibility(frames: Frames, measured: Measured, index: int, points_world: NDArray[np.float64]) -> NDArray[np.int8]:
    """Whether world points can be seen in a frame.

    A point is occluded if it lies more than max(2 % of the measured depth, 5 mm) behind the measured surface; where
    nothing is measured, it is not.

    Parameters
    ----------
    frames
        The sequence.
    measured
        The surface that hides what is behind it.
    index
        Frame.
    points_world
        (n, 3) float64, metres, finite.

    Returns
    -------
    (n,) int8
        `TruthStatus`: behind_camera, out_of_image, occluded or valid.
    """
    points = frames.to_camera(index, points_world)
    uv = frames.camera.project(points)
    ahead = points[:, 2] > 0
    inside = np.flatnonzero(ahead & frames.camera.contains(uv))
    surface_m, known = measured.depths(index, uv[inside])
    behind_m = points[inside, 2] - surface_m
    occluded = known & (behind_m > np.maximum(OCCLUSION_RELATIVE * surface_m, OCCLUSION_LEAST_M))
    status = np.where(ahead, TruthStatus.out_of_image, TruthStatus.behind_camera).astype(np.int8)
    status[inside] = np.where(occluded, TruthStatus.occluded, TruthStatus.valid)
    return status
