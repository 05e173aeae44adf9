"""Worlds small enough to work out by hand, before a camera at the origin that looks north (along y)."""

from collections.abc import Callable

import numpy as np
import pytest

from tracknoise.geometry.cameras import Camera
from tracknoise.simulation.light import Lighting
from tracknoise.simulation.motion import looking
from tracknoise.simulation.ray_casting import Raycaster
from tracknoise.simulation.render import Quality, Renderer
from tracknoise.simulation.world import Quad, World


@pytest.fixture
def camera() -> Camera:
    return Camera(96, 64, 80.0, 80.0, 47.5, 31.5)


@pytest.fixture
def north() -> np.ndarray:
    return looking(np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]))[0]


@pytest.fixture
def facing() -> Callable[..., Quad]:
    """Makes an upright rectangle that faces the camera, with its centre at (x, distance, z)."""

    def make(x: float, z: float, *, width: float, height: float, distance: float, texture: int = 0) -> Quad:
        corner = np.array([x - width / 2, distance, z + height / 2])
        return Quad(corner, np.array([width, 0.0, 0.0]), np.array([0.0, 0.0, -height]), texture=texture)

    return make


@pytest.fixture
def render(camera: Camera, north: np.ndarray) -> Callable[..., np.ndarray]:
    """Renders a world, by default in even light of strength 1, which shows reflectance as it is."""

    def make(world: World, lighting: Lighting | None = None, *, pose: np.ndarray = north, **quality: int) -> np.ndarray:
        light = lighting or Lighting(ambient=1.0, lamps=())
        return Renderer(world, Raycaster(world), camera=camera, lighting=light, quality=Quality(**quality)).image(pose)

    return make
