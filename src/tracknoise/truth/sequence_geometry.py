"""What truth needs of a sequence's geometry: poses in both directions, and the depth of the current frame.

With a rolling shutter, each pixel belongs to the pose of the camera at the time of its own row.
"""

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.row_poses import RowPoses
from tracknoise.sequences.sequence import Sequence, camera_at
from tracknoise.truth.row_projection import project_by_rows


class SequenceGeometry:
    """Camera, poses and depth of a sequence, frame by frame. Only the depth map that was read last is kept.

    Parameters
    ----------
    sequence
        The sequence.

    Raises
    ------
    DataError
        If it has a rolling shutter, but no timestamps.
    """

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
        """Depth of one frame, or None where it has none. Repeated calls for one frame read it once.

        Raises
        ------
        DataError
            If the depth cannot be read.
        """
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

        Parameters
        ----------
        index
            Frame.
        points_world
            (n, 3) float64, metres.

        Returns
        -------
        uv : (n, 2) float64
            px; NaN behind the camera and where distortion has no image.
        points : (n, 3) float64
            The points in the camera frame at that time, metres.
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

        Parameters
        ----------
        index
            Frame.
        points_world
            (n, 3) float64, metres.
        by_px
            (n, 2) float64: by how much their positions differ, px.

        Returns
        -------
        (n, 3) float64
            Metres; NaN where a point has no position, or the pixel no ray.
        """
        uv, points = self.seen(index, points_world)
        return self.to_world(index, uv + by_px, self.camera_at(index).unproject(uv + by_px, points[:, 2]))
