"""Light: ambient and directional lamps on matt (Lambertian) surfaces."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Lamp:
    """A light infinitely far away.

    Parameters
    ----------
    azimuth_deg
        Where it stands, clockwise from north seen from above.
    elevation_deg
        How high it stands above the horizon.
    strength
        Irradiance of a surface that faces it, as a share of the full range of the sensor.
    """

    azimuth_deg: float
    elevation_deg: float
    strength: float

    @property
    def towards(self) -> NDArray[np.float64]:
        """(3,) float64: unit direction to the lamp, world frame."""
        azimuth, elevation = np.deg2rad([self.azimuth_deg, self.elevation_deg])
        level = np.cos(elevation)
        return np.array([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)])

    def irradiance(self, normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Irradiance of surfaces, without shadows: strength max(0, n . l).

        Parameters
        ----------
        normals
            (n, 3) float64, unit, towards the side that is seen.

        Returns
        -------
        (n,) float64
        """
        lit: NDArray[np.float64] = self.strength * np.maximum(np.einsum("ni,i->n", normals, self.towards), 0.0)
        return lit


@dataclass(frozen=True, slots=True)
class Lighting:
    """All light in a world.

    Parameters
    ----------
    ambient
        Irradiance that reaches every surface alike, as a share of the full range of the sensor.
    lamps
        Directional lights.
    """

    ambient: float
    lamps: tuple[Lamp, ...]


LIGHTINGS: Mapping[str, Lighting] = MappingProxyType(
    {
        "default": Lighting(0.55, (Lamp(200.0, 50.0, 0.5), Lamp(100.0, 30.0, 0.15))),
        "east": Lighting(0.4, (Lamp(90.0, 25.0, 0.75),)),
        "west": Lighting(0.4, (Lamp(270.0, 25.0, 0.75),)),
        "overhead": Lighting(0.35, (Lamp(180.0, 85.0, 0.8),)),
    }
)
"""Lightings by name."""
