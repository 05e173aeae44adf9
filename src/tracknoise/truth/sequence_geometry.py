"""What truth needs of a sequence's geometry: poses in both directions, and the depth of the current frame."""

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.poses import has_pose
from tracknoise.sequences.sequence import Sequence, camera_at


class SequenceGeometry:
    """Camera, poses and depth of a sequence, frame by frame. Only the depth map that was read last is kept.

    Parameters
    ----------
    sequence
        The sequence.
    """

    __slots__ = ("_depth", "_index", "sequence")

    def __init__(self, sequence: Sequence) -> None:
        self.sequence = sequence
        self._index: int | None = None
        self._depth: DepthMap | None = None

    def camera_at(self, index: int) -> CameraModel:
        """Camera of one frame."""
        return camera_at(self.sequence, index)

    def has_pose(self, index: int) -> bool:
        """Whether one frame has a pose."""
        return bool(has_pose(self.sequence.world_from_camera[index][None])[0])

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

    def to_world(self, index: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) float64, metres: from the camera frame of one frame to the world."""
        return transform(self.sequence.world_from_camera[index], points)

    def to_camera(self, index: int, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) float64, metres: from the world to the camera frame of one frame."""
        return transform(invert(self.sequence.world_from_camera[index]), points_world)

    def project(self, index: int, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2) float64, px: world points in one frame; NaN behind the camera and where distortion has no image."""
        return self.camera_at(index).project(self.to_camera(index, points_world))
