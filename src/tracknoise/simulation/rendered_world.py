"""A world that is built when it is first rendered, and its renderers."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.depth import DepthMap
from tracknoise.simulation.light import Lighting
from tracknoise.simulation.raycast import Raycaster, depth_map, surface_points
from tracknoise.simulation.render import Quality, Renderer
from tracknoise.simulation.scenery import Scenery

Poses = NDArray[np.float64]
"""(4, 4), or (height, 4, 4) with a pose for each row."""


@dataclass(frozen=True, slots=True)
class Optics:
    """What a renderer is made for.

    Parameters
    ----------
    camera
        The camera.
    lighting
        The light.
    quality
        The rendering quality.
    """

    camera: CameraModel
    lighting: Lighting
    quality: Quality


class RenderedWorld:
    """Images, depth maps and ray casts of one world. Several sequences can share it.

    Parameters
    ----------
    build
        Builds the world. It must be possible to pickle it: a copy in another process builds its world again.
    """

    def __init__(self, build: Callable[[], Scenery]) -> None:
        self._build = build
        self._renderers: dict[Optics, Renderer] = {}

    def __reduce__(self) -> tuple[type["RenderedWorld"], tuple[Callable[[], Scenery]]]:
        """Only what builds it."""
        return type(self), (self._build,)

    @property
    def notes(self) -> tuple[str, ...]:
        """See `Scenery.notes`."""
        return self._scenery.notes

    def irradiance(self, optics: Optics, exposures: Iterable[Poses]) -> NDArray[np.float32]:
        """(height, width) float32: the mean of the images from one or several poses; see `Renderer.image`."""
        images = [self._renderer(optics).image(poses) for poses in exposures]
        return images[0] if len(images) == 1 else np.mean(images, axis=0, dtype=np.float32)

    def depth(self, camera: CameraModel, poses: Poses) -> DepthMap:
        """Exact depth at the pixel centres, float64."""
        return depth_map(self._raycaster, camera, poses)

    def cast(
        self, camera: CameraModel, poses: NDArray[np.float64], uv: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels: see `surface_points`."""
        return surface_points(self._raycaster, camera, poses, uv)

    def _renderer(self, optics: Optics) -> Renderer:
        if optics not in self._renderers:
            self._renderers[optics] = Renderer(
                self._scenery.world,
                self._raycaster,
                camera=optics.camera,
                lighting=optics.lighting,
                quality=optics.quality,
            )
        return self._renderers[optics]

    @cached_property
    def _scenery(self) -> Scenery:
        return self._build()

    @cached_property
    def _raycaster(self) -> Raycaster:
        return Raycaster(self._scenery.world)
