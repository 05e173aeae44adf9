"""Light on matt (Lambertian) surfaces: ambient, directional and point lights."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Lamp:
    """A directional light, at infinity."""

    azimuth_deg: float  # azimuth of the light, clockwise from north seen from above
    elevation_deg: float  # elevation above the horizon
    strength: float  # irradiance of a surface that faces it, as a share of the full range of the sensor

    @property
    def towards(self) -> NDArray[np.float64]:
        """(3,) float64: unit direction to the lamp, world frame."""
        azimuth, elevation = np.deg2rad([self.azimuth_deg, self.elevation_deg])
        level = np.cos(elevation)
        return np.array([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)])

    def irradiance(self, normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Irradiance of surfaces, without shadows: strength max(0, n . l).

        `normals`: (n, 3) float64, unit, towards the visible side. Returns (n,) float64.
        """
        lit: NDArray[np.float64] = self.strength * np.maximum(np.einsum("ni,i->n", normals, self.towards), 0.0)
        return lit


@dataclass(frozen=True, slots=True)
class PointLamp:
    """A point light: its direction and strength differ between the points of a surface."""

    position_m: tuple[float, float, float]  # position, metres, world frame
    # irradiance of a surface that faces it at a distance of 1 m, as a share of the full range of the sensor
    strength: float

    def irradiance(self, points: NDArray[np.float64], height_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Irradiance of surface points, without shadows: strength max(0, n . l) / r^2, where n . l is height / r.

        Parameters
        ----------
        points
            (n, 3) float64, metres, world frame.
        height_m
            (n,) float64, height of the lamp above the plane of each point's surface, on the visible side.

        Returns
        -------
        (n,) float64
        """
        offset = points - np.array(self.position_m)
        r2 = np.einsum("ni,ni->n", offset, offset)
        lit: NDArray[np.float64] = self.strength * np.maximum(height_m, 0.0) / (r2 * np.sqrt(r2))
        return lit


@dataclass(frozen=True, slots=True)
class Lighting:
    """All light in a world."""

    ambient: float  # irradiance of every surface, as a share of the full range of the sensor
    lamps: tuple[Lamp, ...] = ()  # directional lights
    point_lamps: tuple[PointLamp, ...] = ()  # point lights


LIGHTINGS: Mapping[str, Lighting] = MappingProxyType(
    {
        "default": Lighting(0.55, (Lamp(200.0, 50.0, 0.5), Lamp(100.0, 30.0, 0.15))),
        "east": Lighting(0.4, (Lamp(90.0, 25.0, 0.75),)),
        "west": Lighting(0.4, (Lamp(270.0, 25.0, 0.75),)),
        "overhead": Lighting(0.35, (Lamp(180.0, 85.0, 0.8),)),
    }
)
"""Lightings by name."""
