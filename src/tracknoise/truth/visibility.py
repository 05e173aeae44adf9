"""The geometry of a sequence: true positions of world points in its frames, and whether they can be seen there.

Where a rolling shutter shows points: each at the time at which its own row is exposed.

The row v of a point decides its time t + r ((v + 0.5) / H - 0.5), and the pose at this time decides its row. With g(d)
the delay of the row in which the pose after the delay d shows the point,

    g(d) = d    (truth.shutter)

is solved for each point by secant steps that begin with d = 0 and d = g(0). The image moves by a small part of its
height while it is read out, so that a few steps are enough.

What truth needs of a sequence's geometry: poses in both directions, and the depth of the current frame.

With a rolling shutter, each pixel belongs to the pose of the camera at the time of its own row.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.depth import DepthMap, farthest_neighbour
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.row_poses import RollingPoses, RowPoses
from tracknoise.sequences.sequence import Sequence, camera_at
from tracknoise.tables.schema import TruthStatus

_MOST_STEPS = 12
_SOLVED = 1e-10
"""Relative to the readout: 1e-7 rows of an image of 1000. Positions are a further order of magnitude closer."""
_LEAST_SLOPE = 0.1
"""A smaller slope of g(d) - d is rounding, or the image is as fast as the shutter: then a step goes to g(d)."""

Seen = tuple[NDArray[np.float64], NDArray[np.float64]]


def project_by_rows(poses: RollingPoses, camera: CameraModel, index: int, points_world: NDArray[np.float64]) -> Seen:
    """Positions of world points in a frame with a rolling shutter: (truth.shutter).

    Shapes: points_world (n, 3) m; returns uv (n, 2) px, points (n, 3) m. `uv`: NaN where a point has no image, or has
    none at the time of the middle of the image. `points`: the points in the camera frame at the time of their row,
    metres.
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


class SequenceGeometry:
    """Camera, poses and depth of a sequence, frame by frame. Only the depth map that was read last is kept."""

    __slots__ = ("_depth", "_index", "_poses", "sequence")

    def __init__(self, sequence: Sequence) -> None:
        self.sequence = sequence
        self._poses = RowPoses(sequence)
        self._index: int | None = None
        self._depth: DepthMap | None = None

    def camera_at(self, index: int) -> CameraModel:
        """Camera of one frame."""
        return camera_at(self.sequence, index)

    def has_pose(self, index: int) -> bool:
        """Whether one frame has a pose; with a rolling shutter, at the time of each of its rows."""
        return bool(self._poses.known[index])

    def depth(self, index: int) -> DepthMap | None:
        """Depth of one frame, or None where it has none. Repeated calls for one frame read it once."""
        if index != self._index:
            self._depth, self._index = self.sequence.depth(index), index
        return self._depth

    def to_world(self, index: int, uv: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) float64, metres: from the camera frame to the world, when pixels (n, 2) of one frame were exposed."""
        return transform(self._poses.at(index, uv), points)

    def to_camera(self, index: int, uv: NDArray[np.float64], points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) float64, metres: from the world to the camera frame, when pixels (n, 2) of one frame were exposed."""
        return transform(invert(self._poses.at(index, uv)), points_world)

    def seen(self, index: int, points_world: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """World points in one frame; with a rolling shutter, at the time at which their own row was exposed.

        `points_world`: (n, 3) float64, metres. Returns `uv` (n, 2) float64: px; NaN behind the camera and where
        distortion has no image; `points` (n, 3) float64: the points in the camera frame at that time, metres.
        """
        if self._poses.rows is not None:
            return project_by_rows(self._poses.rows, self.camera_at(index), index, points_world)
        points = self.to_camera(index, np.empty((0, 2)), points_world)
        return self.camera_at(index).project(points), points

    def project(self, index: int, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2) float64, px: positions of world points in one frame, see `seen`."""
        return self.seen(index, points_world)[0]

    def displaced(
        self, index: int, points_world: NDArray[np.float64], by_px: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """World points of the same depth whose positions in a frame lie beside those of others.

        `points_world`: (n, 3) float64, metres; `by_px`: (n, 2) float64: by how much their positions differ, px. Returns
        (n, 3) float64: metres; NaN where a point has no position, or the pixel no ray.
        """
        uv, points = self.seen(index, points_world)
        return self.to_world(index, uv + by_px, self.camera_at(index).unproject(uv + by_px, points[:, 2]))


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


class UnknownSurface:
    """A surface of which nothing is known."""

    def depths(self, index: int, uv: NDArray[np.float64]) -> Depths:
        """See `VisibleSurface.depths`."""
        return np.zeros(len(uv)), np.zeros(len(uv), np.bool_)


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
        farthest_m, has_depth = farthest_neighbour(depth, uv)
        return farthest_m + OCCLUSION_SIGMAS * depth.accuracy.sigma_m(farthest_m), has_depth


def locate(
    geometry: SequenceGeometry, surface: VisibleSurface, index: int, points_world: NDArray[np.float64]
) -> Located:
    """Project world points into a frame: x_true = pi(camera_from_world X_w), and decide whether they can be seen.

    A point is occluded if it lies more than max(2 % of the surface's depth, 5 mm) behind the visible surface. Where
    the surface is unknown, no point is occluded. In a frame without a pose, no point has a position. With a rolling
    shutter, both depths are those in the camera when the row of the point was exposed. Shapes: points_world (n, 3) m;
    returns uv (n, 2) px, status (n,). `uv`: NaN behind the camera and where its distortion has no image. Points outside
    the image have positions too. no_pose for all if the frame has none.
    """
    if not geometry.has_pose(index):
        return np.full((len(points_world), 2), np.nan), np.full(len(points_world), TruthStatus.no_pose, np.int8)
    uv, points = geometry.seen(index, points_world)
    has_image = (points[:, 2] > 0) & np.isfinite(uv).all(axis=1)
    inside = np.flatnonzero(has_image & geometry.camera_at(index).contains(uv))
    surface_m, has_surface = surface.depths(index, uv[inside])
    behind_m = points[inside, 2] - surface_m
    occluded = has_surface & (behind_m > np.maximum(OCCLUSION_RELATIVE * surface_m, OCCLUSION_LEAST_M))
    status = np.where(has_image, TruthStatus.out_of_image, TruthStatus.behind_camera).astype(np.int8)
    status[inside] = np.where(occluded, TruthStatus.occluded, TruthStatus.valid)
    return uv, status
