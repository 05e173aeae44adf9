"""Triangles with one material."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

NUMBER = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
"""Pattern of a non-negative number, such as a colour channel."""
_LUMA = np.array([0.299, 0.587, 0.114])  # weights of red, green and blue, as in grey images of colour files


@dataclass(frozen=True, slots=True)
class Look:
    """Material of a surface.

    Parameters
    ----------
    texture
        Image file; None for a uniform colour.
    reflectance
        Reflectance of the uniform colour, 0 to 1.
    """

    texture: Path | None = None
    reflectance: float = 0.7


PLAIN = Look()
"""Material of surfaces without colour and texture: light grey."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Triangles with one material.

    Parameters
    ----------
    corners
        (t, 3, 3) float64, metres.
    corner_uv
        (t, 3, 2) float64, repeats of the texture, row 0 first; None if there are no texture coordinates.
    look
        Their material; None if none is defined.
    """

    corners: NDArray[np.float64]
    corner_uv: NDArray[np.float64] | None
    look: Look | None = None


def even(red: float, green: float, blue: float) -> Look:
    """Material of a uniform colour, with channels from 0 to 1. Infinite ones count as bright, NaN as dark."""
    channels = np.nan_to_num([red, green, blue], nan=0.0, posinf=1.0, neginf=0.0)
    return Look(reflectance=float(np.clip(_LUMA @ channels, 0.0, 1.0)))
