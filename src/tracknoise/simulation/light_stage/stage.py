"""The light stage: cameras, LEDs, images and the scan."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera import Camera
from tracknoise.simulation.light import Lighting, PointLamp
from tracknoise.simulation.light_stage.leds import led_positions
from tracknoise.simulation.light_stage.tabletop import tabletop
from tracknoise.simulation.motion import looking
from tracknoise.simulation.raycast import Raycaster, surface_points
from tracknoise.simulation.render import Quality, Renderer
from tracknoise.simulation.sensor import expose

POSITIONS = 49
"""Number of camera positions on the arc."""
KEY_FRAME = 24
"""The middle position, from which the scan is made."""
SCAN_STEP_PX = 0.75
"""Distance of neighbouring scan points in the key frame, px of the full image: about 0.15 mm on the objects."""

_ARC_DEG, _ELEVATION_DEG, _DISTANCE_M = 80.0, 30.0, 0.6
_TARGET = np.array([0.0, 0.0, 0.04])
_SCANNED_M = 0.25
_ROWS_AT_ONCE = 64
_WIDTH = 1600
_FOCAL = (2900.0, 2904.0)
_OFF_CENTRE = (12.3, -8.7)
_STRENGTH, _AMBIENT = 0.85, 0.15
_WORLD, _NOISE, _SCAN = range(3)  # independent streams of random numbers


class LightStage:
    """A scene on the stage.

    The camera moves on an arc of 80 degrees around the scene, 0.6 m from its centre and 30 degrees above it. It has 49
    positions from left to right, and always looks at the centre. At each position the scene is photographed once per
    LED, in the light of that LED and a little ambient light.

    Parameters
    ----------
    scene
        Number of the scene. Scene and seed determine the objects on the stage.
    seed
        Random seed of the scenes and the noise.
    width, height
        Size of the images, px; the focal length is proportional to the width, 2900 px at 1600.
    supersampling
        Rays along each side of a pixel.
    shadows
        Whether surfaces block the light.
    noise_sigma
        Standard deviation of the sensor noise, grey levels.
    """

    def __init__(
        self,
        scene: int,
        *,
        seed: int = 0,
        width: int = 1600,
        height: int = 1200,
        supersampling: int = 1,
        shadows: bool = False,
        noise_sigma: float = 2.0,
    ) -> None:
        self.camera = stage_camera(width, height)
        self.world_from_camera = arc()
        self.leds_m = led_positions()
        self._streams, self._noise_sigma = (seed, scene), noise_sigma
        world = tabletop(self._generator(_WORLD))
        self._raycaster = Raycaster(world)
        lamps = tuple(PointLamp((float(x), float(y), float(z)), _STRENGTH) for x, y, z in self.leds_m)
        self._renderer = Renderer(
            world,
            self._raycaster,
            camera=self.camera,
            lighting=Lighting(_AMBIENT, point_lamps=lamps),
            quality=Quality(supersampling, shadows),
        )

    def images(self, index: int) -> Iterator[NDArray[np.uint8]]:
        """The images from one position, one per LED in order.

        Yields
        ------
        (height, width) uint8
        """
        for led, irradiance in enumerate(self._renderer.images_by_lamp(self.world_from_camera[index])):
            yield expose(irradiance, self._noise_sigma, self._generator(_NOISE, index, led))

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels: see `tracknoise.sequences.sequence.Surface.cast`."""
        return surface_points(self._raycaster, self.camera, self.world_from_camera[index], uv)

    def scan(self, *, step_px: float = SCAN_STEP_PX) -> NDArray[np.float64]:
        """Points of the surface within 0.25 m of the centre of the scene that are visible in the key frame.

        Parameters
        ----------
        step_px
            Distance of neighbouring points in the key frame, px. The offset of their grid is random, so that it is not
            aligned with the pixels.

        Returns
        -------
        (n, 3) float64
            Metres, world frame.
        """
        start_u, start_v = self._generator(_SCAN).uniform(-0.5, step_px - 0.5, 2)
        columns = np.arange(start_u, self.camera.width - 0.5, step_px)
        rows = np.arange(start_v, self.camera.height - 0.5, step_px)
        parts = []
        for first in range(0, len(rows), _ROWS_AT_ONCE):
            u, v = np.meshgrid(columns, rows[first : first + _ROWS_AT_ONCE])
            points, hit = self.cast(KEY_FRAME, np.stack([u.ravel(), v.ravel()], axis=-1))
            parts.append(points[hit & (np.linalg.norm(points - _TARGET, axis=1) <= _SCANNED_M)])
        return np.concatenate(parts)

    def _generator(self, stream: int, *numbers: int) -> np.random.Generator:
        return np.random.default_rng([*self._streams, stream, *numbers])


def stage_camera(width: int, height: int) -> Camera:
    """The camera on the stage: its principal point is not in the centre, and its pixels are not exactly square."""
    scale = width / _WIDTH
    fx, fy = (focal * scale for focal in _FOCAL)
    right, down = (shift * scale for shift in _OFF_CENTRE)
    return Camera(width, height, fx, fy, (width - 1) / 2.0 + right, (height - 1) / 2.0 + down)


def arc() -> NDArray[np.float64]:
    """(49, 4, 4) float64: world_from_camera of the positions, from left to right."""
    azimuth = np.deg2rad(np.linspace(-_ARC_DEG / 2.0, _ARC_DEG / 2.0, POSITIONS))
    elevation = np.deg2rad(_ELEVATION_DEG)
    level = np.cos(elevation)
    outward = np.stack(
        [level * np.sin(azimuth), -level * np.cos(azimuth), np.full(POSITIONS, np.sin(elevation))], axis=-1
    )
    return looking(_TARGET + _DISTANCE_M * outward, -outward)
