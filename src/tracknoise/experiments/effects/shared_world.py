"""A world that several sequences render frame by frame: what the last one rendered is used again."""

from collections.abc import Hashable, Iterable

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.simulation.rendered_world import Optics, Poses, RenderedWorld


class SharedWorld(RenderedWorld):
    """As `RenderedWorld`, but remembers the last image and the last depth map, with the poses that they belong to."""

    def irradiance(self, optics: Optics, exposures: Iterable[Poses]) -> NDArray[np.float32]:
        """See `RenderedWorld.irradiance`."""
        listed = list(exposures)
        key = (optics, *(poses.tobytes() for poses in listed))
        if self._image is None or self._image[0] != key:
            self._image = key, super().irradiance(optics, listed)
        return self._image[1]

    def depth(self, camera: CameraModel, poses: Poses) -> DepthMap:
        """See `RenderedWorld.depth`."""
        key = camera, poses.tobytes()
        if self._depth is None or self._depth[0] != key:
            self._depth = key, super().depth(camera, poses)
        return self._depth[1]

    _image: tuple[Hashable, NDArray[np.float32]] | None = None
    _depth: tuple[Hashable, DepthMap] | None = None
